r"""Emitter `thermal`: emission of a surface, with one temperature for all or for each facet.

The radiance is the directional emissivity times the blackbody's in-band radiance.
"""

import re

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.declared import Bounds, needs, one_of
from mi_lcair.errors import InputError
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.plugins.derivatives import (
    check_attached,
    held,
    is_aligned,
    members,
    own_memory,
    same_variables,
    unrecorded,
)
from mi_lcair.plugins.emission import triangles
from mi_lcair.plugins.emission.draw_table import largest, texture_bound
from mi_lcair.plugins.emission.emissivity import Emissivities, emissivity_of, emits
from mi_lcair.plugins.emitters.thermal_emitter import EmitterParameter, ThermalEmitter
from mi_lcair.plugins.properties import BRIGHTEST, HOTTEST, RADIANCE_UNIT, Property
from mi_lcair.tasks import is_traced


class Thermal(ThermalEmitter):
    r"""Thermal emission of the shape that it belongs to.

    ============= ================ =================================================================
    temperature   float or texture kelvin; a `mesh_attribute` named `face_...` gives one
                                   temperature per facet                            (differentiable)
    radiance      float            in place of a temperature: in-band radiance of a source that
                                   is not a blackbody [W m^-2 sr^-1]                (differentiable)
    spectrum      string           in place of a temperature: a CSV file
                                   wavelength_um,radiance_W_m2_sr_um, or a bundled sky table; its
                                   in-band value becomes the parameter `radiance`
    elevation_deg float            line of sight of a sky table, 0..90 above the horizon
    band          string           MWIR, LWIR, SWIR, total, "a-b" in um, or the CSV file of a
                                   response (not needed for `radiance`)
    emissivity    float            emissivity, in place of the material's           (differentiable)
    group         string           label of the emitter, `[A-Za-z0-9_-]+`, at most 64
                                   characters                                                 (self)
    facet_type    string           model, or background: sky or terrain                      (model)
    ============= ================ =================================================================

    .. code-block:: xml

        <emitter type="thermal">
            <string name="band" value="MWIR"/> <float name="temperature" value="300"/>
        </emitter>

    The emissivity comes from the shape's BSDF (see `emissivity`), so a surface emits from the sides
    from which it reflects. With a given `emissivity` a body that refracts, such as `dielectric`,
    emits from its front only. A source with `radiance` or `spectrum` emits that radiance, times
    `emissivity` if it is given. Facet temperatures are a parameter of the mesh
    (`SHAPE.face_temperature`). `bounce_path` converts them to radiance in Float64 whenever they
    change. In two cases the radiance is computed at every hit, which gives the same result but is
    slower: for a texture that varies inside a facet, and under Mitsuba's integrators, which do not
    report that a mesh has changed.
    """

    PROPERTIES = (
        Property("temperature", "float or texture", upper=HOTTEST, is_positive=True, unit="K"),
        Property("radiance", "float", lower=0, upper=BRIGHTEST, unit=RADIANCE_UNIT),
        Property("spectrum", "string", is_file=True),
        Property("elevation_deg", "float", lower=0, upper=90),
        Property("band", "string", is_file=True),
        Property("emissivity", "float", lower=0, upper=1),
        Property("group", "string", "self", is_label=True),
        # Facet types of the thesis, section 3.2.1.5
        Property("facet_type", "string", "model", choices=("model", "sky", "terrain")),
    )
    RULES = (
        needs("elevation_deg", "spectrum", why="it chooses a line of sight of the spectrum"),
        one_of("temperature", "radiance", "spectrum"),
        needs("temperature", "band"),
        needs("spectrum", "band"),
    )

    def __init__(self, props):
        super().__init__(props)
        self.m_flags = mi.EmitterFlags.Surface | mi.EmitterFlags.SpatiallyVarying
        values = self.values
        self.facet_type = values["facet_type"]
        self.temperature = self.radiance = self.texture = self.attribute = None
        self.by_primitive = False  # whether the temperature depends on the facet that was hit
        self.derived_from = None  # the temperatures from which `derived` was computed
        self.bsdf = self.triangles = None  # the shape's BSDF and triangle table, set when needed
        if values["radiance"] is not None:
            self.radiance = mi.Float(values["radiance"])
        elif values["spectrum"] is not None:
            from mi_lcair.physics.sky import spectrum  # loads clear air

            self.spectrum = spectrum(values["spectrum"], values["elevation_deg"])
            self.radiance = mi.Float(self.spectrum.in_band_radiance(self.band))
        elif isinstance(values["temperature"], mi.Texture):
            self.texture = values["temperature"]
            facet_attribute = re.search(r'name = "(face_\w+)"', str(self.texture))
            self.attribute = facet_attribute and facet_attribute[1]
            self.by_primitive = self.texture.class_name() == "MeshAttribute"
        else:
            self.temperature = mi.Float(values["temperature"])
            self.first_temperatures = np.float32([values["temperature"]])

        self.material_emissivity = None
        if values["emissivity"] is not None or self.radiance is not None:
            value = values["emissivity"]
            self.given_emissivity = mi.Float(1.0 if value is None else value)

    # ------------------------------------------------ Parameters and quantities derived from them

    def traverse(self, cb):
        mi.Emitter.traverse(self, cb)
        if self.texture is not None:
            cb.put("temperature", self.texture, mi.ParamFlags.Differentiable)
        elif self.temperature is not None:
            cb.put("temperature", self.temperature, mi.ParamFlags.Differentiable)
        else:
            cb.put("radiance", self.radiance, mi.ParamFlags.Differentiable)
        if self.given_emissivity is not None:
            cb.put("emissivity", self.given_emissivity, mi.ParamFlags.Differentiable)

    def parameters(self) -> list[EmitterParameter]:
        if self.radiance is not None:
            name = "radiance"
            return [EmitterParameter(name, name, RADIANCE_UNIT, BRIGHTEST, name)]
        name, parameters = "temperature", []
        if self.sources():
            key = self.attribute or name
            by_facet = self.attribute is not None
            parameters.append(EmitterParameter(name, name, "K", HOTTEST, key, by_facet))
        if self.given_emissivity is not None:
            parameters.append(EmitterParameter("emissivity", "emissivity", "1", 1.0, "emissivity"))
        return parameters

    def parameters_changed(self, keys=()):
        self.triangles = None  # the shape may have moved
        if self.texture is None:
            self.derive()

    def sources(self) -> tuple:
        """Temperatures from which `derived` is computed.

        This is the parameter, or the mesh's buffer of facet temperatures.
        """
        if self.temperature is not None:
            return (self.temperature,)
        buffer = members(self.get_shape()).get(self.attribute) if self.attribute else None
        return () if buffer is None else (buffer,)

    def derive(self, radiance: float | None = None) -> None:
        """Compute the in-band radiance of a blackbody in Float64, with its derivative.

        radiance: that of its one temperature, if `derive_together` has computed it. This is not
        done in the constructor: it evaluates arrays, and Mitsuba creates the next object of a scene
        in the same thread while it waits.
        """
        for parameter in (self.temperature, self.radiance, self.given_emissivity):
            if parameter is not None:
                dr.make_opaque(parameter)
        # In the memory of NumPy's, they would need recordings of their own
        own_memory([a for a in self.sources() if not (dr.grad_enabled(a) or is_aligned(a))])
        self.derived_from = held(self.sources())
        for temperature in self.derived_from:
            values = dr.detach(temperature).numpy()
            where = f"thermal: temperature{' of facet {}' if len(values) > 1 else ''}"
            Bounds(is_positive=True, unit="K").check_all(values, where.format)
            if self.first_temperatures is None:
                self.first_temperatures = np.array(values)
            if radiance is None:
                Float64 = dr.float64_array_t(mi.Float)
                radiance = in_band_radiance(self.band, Float64(temperature))
            self.derived = mi.Float(radiance)
            dr.make_opaque(self.derived)

    def is_stale(self) -> bool:
        return self.derived_from is None or not same_variables(self.sources(), self.derived_from)

    def refresh(self) -> None:
        """Update the facet radiances and the material's emissivity.

        They depend on parameters of the mesh and the BSDF. Mitsuba does not tell the emitter when
        those change.
        """
        self.find_emissivity()
        if self.is_stale():
            self.derive()
        for table in self.derivations:
            table.refresh()

    def facet_radiance(self):
        if self.derived_from is None:
            self.derive()
        return self.derived if self.radiance is None else self.radiance

    def temperatures(self) -> np.ndarray | None:
        sources = () if self.radiance is not None else self.sources()
        return dr.detach(sources[0]).numpy() if sources else None

    def radiance_bound(self) -> np.ndarray | None:
        if self.facet_radiance() is not None:
            return super().radiance_bound()
        temperature = texture_bound(self.texture, self.get_shape())
        if temperature is None:
            return None
        factor = 1.0 if self.given_emissivity is None else largest(self.given_emissivity)
        return in_band_radiance(self.band, temperature) * factor

    def spectra(self) -> list:
        if not self.has_spectrum:
            raise InputError(
                f"group {self.group}: a source of given `radiance` has no spectrum; "
                "give it a `spectrum`"
                if self.radiance is not None
                else f"group {self.group}: its temperature varies inside the facets, so that its "
                "spectra cannot be told apart; give it a temperature per facet (face_temperature)"
            )
        return super().spectra()

    @property
    def derivations(self) -> list:
        """The emissivity table of the shape's BSDF, in a list; empty if no table is needed."""
        table = self.material_emissivity
        return [table] if isinstance(table, Emissivities) else []

    def find_emissivity(self) -> None:
        if self.bsdf is None:
            bsdf = self.get_shape().bsdf()
            if self.given_emissivity is None:
                self.material_emissivity = unrecorded(emissivity_of, bsdf)
            self.bsdf = bsdf

    # ---------------------------------------------------------------- Emission

    def source_radiance(self, si, active):
        """Radiance at the hit before multiplication by the emissivity [W m^-2 sr^-1]."""
        if self.derived_from is None:
            unrecorded(self.derive)
        if self.radiance is not None:
            return self.radiance
        if self.temperature is not None:
            check_attached(self)
            return self.derived
        if is_traced(self) and self.derived is not None:
            return dr.gather(mi.Float, self.derived, si.prim_index, active)
        Float64 = dr.float64_array_t(mi.Float)
        return mi.Float(in_band_radiance(self.band, Float64(self.texture.eval_1(si, active))))

    def emissivity(self, si, active):
        self.find_emissivity()
        if self.given_emissivity is not None:
            return dr.select(emits(int(self.bsdf.flags()), si.wi.z), self.given_emissivity, 0)
        return self.material_emissivity.eval(self.bsdf, si, active)

    def eval(self, si, active=True):
        if is_traced(self) is False:
            return mi.Spectrum(0)  # the emitter of another scene, whose shape may be deleted
        return mi.Spectrum(
            dr.select(active, self.emissivity(si, active) * self.source_radiance(si, active), 0)
        )

    # ------------------------------------------------ Sampling, uniform over the shape's area

    def sample_surface(self, sample, active):
        """Uniform point of the shape, as a surface interaction, and its density [1/m^2].

        A separate table draws the triangle, because Mitsuba's position samples do not contain the
        triangle's number. Mitsuba's interface gives two Float32 numbers of 23 bits each. In a mesh
        of a million triangles this leaves about 2^11 x 2^14 positions on each triangle.
        `bounce_path` does not use this method: it draws two more numbers.
        """
        shape = self.get_shape()
        if not triangles.is_faceted(shape):
            ps = shape.sample_position(0, sample, active)
            n = triangles.normal_of(ps, mi.Vector4f(triangles.sphere_of(shape)))
            return self.interaction(ps.p, n, ps.uv), ps.pdf
        if self.triangles is None:
            table = unrecorded(triangles.TriangleTable, [shape])
            choice = triangles.Choice(table.area)
            self.triangles = table, choice, table.density(choice.probability)
        table, choice, density = self.triangles
        pi = dr.zeros(mi.PreliminaryIntersection3f, dr.width(sample))
        pi.prim_index, rest = choice.pick_and_rest(sample, active)
        pi.prim_uv, p, n = table.point(pi.prim_index, rest, active)
        pi.shape = mi.ShapePtr(shape)
        hit = shape.compute_surface_interaction(dr.zeros(mi.Ray3f), pi, mi.RayFlags.All, active)
        si = self.interaction(p, n, hit.uv)
        si.prim_index = pi.prim_index
        return si, dr.gather(mi.Float, density, pi.prim_index, active)

    def interaction(self, p, n, uv):
        """A surface interaction of this shape; its direction `wi` is not set yet."""
        si = dr.zeros(mi.SurfaceInteraction3f, dr.width(p))
        si.p, si.n, si.uv, si.sh_frame = p, n, uv, mi.Frame3f(n)
        si.shape = mi.ShapePtr(self.get_shape())
        return si

    def label_facet(self, si):
        """The `uv` of direction and position samples.

        Where the temperature is given per facet, it holds the facet's number, because Mitsuba's
        samples have no other field for it.
        """
        return mi.Point2f(mi.Float(si.prim_index), 0) if self.by_primitive else si.uv

    def labelled(self, p, n, uv):
        """Surface interaction of a sample that `sample_direction` or `sample_position` made."""
        si = self.interaction(p, n, uv)
        if self.by_primitive:
            si.prim_index = mi.UInt32(uv.x)
        return si

    def sample_direction(self, it, sample, active=True):
        if is_traced(self) is False:
            return dr.zeros(mi.DirectionSample3f), mi.Spectrum(0)
        si, density = self.sample_surface(sample, active)
        ds = dr.zeros(mi.DirectionSample3f, dr.width(sample))
        ds.p, ds.n, ds.time, ds.delta = si.p, si.n, it.time, False
        ds.uv = self.label_facet(si)
        ds.emitter = mi.EmitterPtr(self)
        ds.d = si.p - it.p
        ds.dist = dr.norm(ds.d)
        ds.d /= ds.dist
        cos = dr.abs_dot(ds.d, ds.n)
        ds.pdf = dr.select(cos > 0, density * dr.square(ds.dist) / cos, 0)
        active &= ds.pdf > 0
        si.wi = si.to_local(-ds.d)
        return ds, dr.select(active, self.eval(si, active) / dr.select(active, ds.pdf, 1), 0)

    def pdf_direction(self, it, ds, active=True):
        if is_traced(self) is False:
            return mi.Float(0)
        cos = dr.abs_dot(ds.d, ds.n)
        density = 1 / self.get_shape().surface_area()
        return dr.select(active & (cos > 0), density * dr.square(ds.dist) / cos, 0)

    def eval_direction(self, it, ds, active=True):
        """Radiance toward `it` from a direction sample that `sample_direction` made."""
        if is_traced(self) is False:
            return mi.Spectrum(0)
        si = self.labelled(ds.p, ds.n, ds.uv)
        si.wi = si.to_local(-ds.d)
        return self.eval(si, active)

    def sample_position(self, time, sample, active=True):
        si, density = self.sample_surface(sample, active)
        ps = dr.zeros(mi.PositionSample3f, dr.width(sample))
        ps.p, ps.n, ps.uv = si.p, si.n, self.label_facet(si)
        ps.time, ps.pdf, ps.delta = time, density, False
        return ps, dr.select(active, 1 / density, 0)

    def pdf_position(self, ps, active=True):
        return dr.select(active, 1 / self.get_shape().surface_area(), 0)

    def sample_ray(self, time, sample1, sample2, sample3, active=True):
        """A ray from either side, drawn by the cosine, and its weight [W m^-2 sr^-1 x m^2 sr]."""
        si, density = self.sample_surface(sample2, active)
        si.wi = mi.warp.square_to_cosine_hemisphere(sample3)
        si.wi.z = dr.select(sample1 < 0.5, si.wi.z, -si.wi.z)
        return si.spawn_ray(si.to_world(si.wi)), self.eval(si, active) * dr.two_pi / density

    def sample_wavelengths(self, si, sample, active=True):
        """Radiance at an interaction that was made from a sample of `sample_position`."""
        at = self.labelled(si.p, si.n, si.uv)
        at.wi = si.wi
        return dr.zeros(mi.Color0f), self.eval(at, active)

    def bbox(self):
        return self.get_shape().bbox()

    def to_string(self):
        what = (
            f"temperature = {self.texture or self.temperature}"
            if self.radiance is None
            else f"radiance = {self.radiance}"
        )
        return f"Thermal[group = {self.group}, band = {self.band and self.band.name}, {what}]"


def derive_together(plugins) -> None:
    """Derive what thermal emitters of one temperature lack, in one kernel for each band.

    Those with derivatives are left out.
    """
    single = [p for p in plugins if isinstance(p, Thermal) and p.temperature is not None]
    single = [p for p in single if dr.width(p.temperature) == 1 and p.is_stale()]
    single = [p for p in single if not dr.grad_enabled(p.temperature)]
    for band in {id(p.band): p.band for p in single}.values():
        of_band = [p for p in single if p.band is band]
        temperatures = np.concatenate([p.temperature.numpy() for p in of_band])
        radiances = in_band_radiance(band, dr.float64_array_t(mi.Float)(temperatures))
        for plugin, radiance in zip(of_band, mi.Float(radiances).numpy().tolist()):
            plugin.derive(radiance)

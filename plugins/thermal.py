r"""Emitter `thermal`: the surface's own emission, emissivity(direction) times the blackbody's
in-band radiance, facet by facet.
"""

import re

import drjit as dr
import mitsuba as mi
from mi_lcair.plugins.beside_scene import beside_scene
from mi_lcair.plugins.derivatives import check_attached, is_traced, members
from mi_lcair.plugins.emissivity import emissivity_of, reflects
from mi_lcair.plugins.triangles import Choice, TriangleTable, is_faceted

from mi_lcair.errors import InputError, unknown
from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.physics.spectrum import spectrum

LABEL = re.compile(r"[A-Za-z0-9_-]+")
FACET_TYPES = ("model", "sky", "terrain")  # thesis 3.2.1.5


class Thermal(mi.Emitter):
    r"""Thermal emission of the shape that it belongs to.

    ============= ================ ================================================================================
    temperature   float or texture kelvin; `mesh_attribute` named `face_...` gives one per facet     (differentiable)
    radiance      float            instead: in-band radiance of a source that is no blackbody [W m^-2 sr^-1] (diff.)
    spectrum      string           instead: a CSV wavelength_um,radiance_W_m2_sr_um, or a bundled sky table; its in-band
                                   value becomes the parameter `radiance`
    elevation_deg float            line of sight of a sky table, 0..90 above the horizon
    band          string           MWIR, LWIR, SWIR, total, "a-b" in um, or a response's CSV (not for `radiance`)
    emissivity    float            instead of the material's own                                     (differentiable)
    group         string           label of what emits, [A-Za-z0-9_-]+                                         (self)
    facet_type    string           model, or background: sky or terrain                                       (model)
    ============= ================ ================================================================================

    .. code-block:: xml

        <emitter type="thermal">
            <string name="band" value="MWIR"/> <float name="temperature" value="300"/>
        </emitter>

    The emissivity comes from the shape's BSDF (see `emissivity`), so a surface emits from the sides
    from which it reflects. A source with `radiance` or `spectrum` emits it as it is, times
    `emissivity` if that is given. Facet temperatures are the mesh's parameter
    (`SHAPE.face_temperature`); `bounce_path` turns them into radiance once per change, in Float64.
    A texture that varies inside a facet, and facets under a stock integrator, which cannot tell
    when a mesh has changed, are turned into radiance at every hit: right, but slower.
    """

    def __init__(self, props):
        mi.Emitter.__init__(self, props)
        self.m_flags = mi.EmitterFlags.Surface | mi.EmitterFlags.SpatiallyVarying
        self.group = props.get("group", "self")
        if not LABEL.fullmatch(self.group):
            raise InputError(
                f"thermal: group '{self.group}' must consist of letters, digits, '_' and '-'"
            )
        self.band = band(beside_scene(props["band"])) if "band" in props else None
        self.facet_type = props.get("facet_type", "model")
        if self.facet_type not in FACET_TYPES:
            raise unknown("facet_type", self.facet_type, FACET_TYPES)
        given = [name for name in ("temperature", "radiance", "spectrum") if name in props]
        if len(given) != 1:
            raise InputError(
                f"thermal: give one of `temperature`, `radiance` and `spectrum`; found {', '.join(given) or 'none'}"
            )
        if self.band is None and given != ["radiance"]:
            raise InputError(f"thermal: `{given[0]}` needs a `band`")
        self.temperature = self.radiance = self.spectrum = self.texture = self.attribute = None
        self.by_primitive = False  # whether the temperature depends on the facet that was hit
        self.derived = self.derived_from = (
            None  # blackbody radiance, one value or one per facet, and of what
        )
        self.bsdf = self.triangles = None  # of the shape
        if "radiance" in props:
            self.radiance = mi.Float(props["radiance"])
            if not props["radiance"] >= 0:
                raise InputError(f"thermal: radiance = {props['radiance']:g} must be >= 0")
        elif "spectrum" in props:
            self.spectrum = spectrum(
                beside_scene(props["spectrum"]), props.get("elevation_deg", None)
            )
            self.radiance = mi.Float(self.spectrum.in_band_radiance(self.band))
        elif isinstance(props["temperature"], mi.Texture):
            self.texture = props["temperature"]
            facet_attribute = re.search(r'name = "(face_\w+)"', str(self.texture))
            self.attribute = facet_attribute and facet_attribute[1]
            self.by_primitive = self.texture.class_name() == "MeshAttribute"
        else:
            self.temperature = mi.Float(props["temperature"])

        self.given_emissivity = None  # None: the material's
        self.material_emissivity = None
        if "emissivity" in props or self.radiance is not None:
            value = props.get("emissivity", 1.0)
            if not 0 <= value <= 1:
                raise InputError(f"thermal: emissivity = {value:g} must lie in 0..1")
            self.given_emissivity = mi.Float(value)
        self.parameters_changed()

    # ---------------------------------------------------------------- Parameters and what is derived from them

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

    def parameters_changed(self, keys=()):
        self.triangles = None  # the shape may have moved
        if self.temperature is not None:
            self.derive()
        for parameter in (self.radiance, self.given_emissivity):
            if parameter is not None:
                dr.make_opaque(parameter)

    def sources(self) -> tuple:
        """The temperatures that `derived` comes from: the parameter, or the mesh's buffer of facet
        temperatures.
        """
        if self.temperature is not None:
            return (self.temperature,)
        buffer = members(self.get_shape()).get(self.attribute) if self.attribute else None
        return () if buffer is None else (buffer,)

    def derive(self) -> None:
        """In-band radiance of a blackbody at these temperatures, in Float64, with its derivative."""
        for temperature in self.sources():
            dr.make_opaque(temperature)
            values = dr.detach(temperature).numpy()
            bad = ~((values > 0) & (values < float("inf")))
            if bad.any():
                where = f" of facet {int(bad.argmax())}" if len(values) > 1 else ""
                raise InputError(
                    f"thermal: temperature{where} = {values[bad][0]:g} K; it must be positive and finite"
                )
            Float64 = dr.float64_array_t(mi.Float)
            self.derived = mi.Float(in_band_radiance(self.band, Float64(temperature)))
            dr.make_opaque(self.derived)
            self.derived_from = temperature.index, temperature.index_ad

    def refresh(self) -> None:
        """Brings up to date what no change of our own parameters announces: facet radiances, the
        material's emissivity.
        """
        self.find_emissivity()
        if any(
            self.derived_from != (temperature.index, temperature.index_ad)
            for temperature in self.sources()
        ):
            self.derive()

    def find_emissivity(self) -> None:
        if self.bsdf is None:
            bsdf = self.get_shape().bsdf()
            if self.given_emissivity is None:
                self.material_emissivity = emissivity_of(bsdf)
            self.bsdf = bsdf

    # ---------------------------------------------------------------- Emission

    def source_radiance(self, si, active):
        """Radiance of the source before emissivity, at the hit [W m^-2 sr^-1]."""
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
            return dr.select(reflects(int(self.bsdf.flags()), si.wi.z), self.given_emissivity, 0)
        return self.material_emissivity.eval(self.bsdf, si, active)

    def eval(self, si, active=True):
        if is_traced(self) is False:
            return mi.Spectrum(0)  # of another scene, whose shape may be gone
        return mi.Spectrum(
            dr.select(active, self.emissivity(si, active) * self.source_radiance(si, active), 0)
        )

    # ---------------------------------------------------------------- Sampling, uniform over the shape's area

    def sample_surface(self, sample, active):
        """A point of the shape, uniform over its area, as a surface interaction, and the density
        [1/m^2].

        Triangles are drawn from a table of our own: Mitsuba's position samples do not tell which
        one they lie on. Mitsuba's interface gives two Float32 numbers of 23 bits. In a mesh of a
        million triangles they leave about 2^11 x 2^14 places on each. `bounce_path` draws two more
        numbers, and does not use this.
        """
        shape = self.get_shape()
        if not is_faceted(shape):
            ps = shape.sample_position(0, sample, active)
            return self.interaction(ps.p, ps.n, ps.uv), ps.pdf
        if self.triangles is None:
            table = TriangleTable([shape])
            choice = Choice(table.area)
            self.triangles = table, choice, table.density(choice.probability)
        table, choice, density = self.triangles
        pi = dr.zeros(mi.PreliminaryIntersection3f, dr.width(sample))
        pi.prim_index, rest = choice.pick_and_rest(sample, active)
        pi.prim_uv, p, n = table.point(pi.prim_index, rest, active)
        pi.shape = mi.ShapePtr(shape)
        si = self.interaction(
            p,
            n,
            shape.compute_surface_interaction(dr.zeros(mi.Ray3f), pi, mi.RayFlags.All, active).uv,
        )
        si.prim_index = pi.prim_index
        return si, dr.gather(mi.Float, density, pi.prim_index, active)

    def interaction(self, p, n, uv):
        """A surface interaction of this shape, seen from nowhere yet."""
        si = dr.zeros(mi.SurfaceInteraction3f, dr.width(p))
        si.p, si.n, si.uv, si.sh_frame, si.shape = (
            p,
            n,
            uv,
            mi.Frame3f(n),
            mi.ShapePtr(self.get_shape()),
        )
        return si

    def label_facet(self, si):
        """What direction and position samples carry as their uv: the facet where the temperature
        asks for it.
        """
        return mi.Point2f(mi.Float(si.prim_index), 0) if self.by_primitive else si.uv

    def labelled(self, p, n, uv):
        """The interaction at a sample made by `sample_direction` or `sample_position`."""
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
        ps.p, ps.n, ps.uv, ps.time, ps.pdf, ps.delta = (
            si.p,
            si.n,
            self.label_facet(si),
            time,
            density,
            False,
        )
        return ps, dr.select(active, 1 / density, 0)

    def pdf_position(self, ps, active=True):
        return dr.select(active, 1 / self.get_shape().surface_area(), 0)

    def sample_ray(self, time, sample1, sample2, sample3, active=True):
        """A ray that leaves either side, cosine-weighted; weight [W m^-2 sr^-1 x m^2 sr]."""
        si, density = self.sample_surface(sample2, active)
        si.wi = mi.warp.square_to_cosine_hemisphere(sample3)
        si.wi.z = dr.select(sample1 < 0.5, si.wi.z, -si.wi.z)
        return si.spawn_ray(si.to_world(si.wi)), self.eval(si, active) * dr.two_pi / density

    def sample_wavelengths(self, si, sample, active=True):
        """Radiance at an interaction made from a sample of `sample_position`."""
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


mi.register_emitter("thermal", Thermal)

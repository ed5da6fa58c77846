r"""Emitter `thermal`: the surface's own emission, emissivity(direction) times the blackbody's in-band radiance, facet by facet."""
import re

import drjit as dr
import mitsuba as mi

from mi_lcair.errors import InputError
from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.plugins.beside_scene import beside_scene
from mi_lcair.plugins.derivatives import check_attached, members
from mi_lcair.plugins.emissivity import emissivity_of, reflects
from mi_lcair.plugins.facets import Facets

LABEL = re.compile(r"[A-Za-z0-9_-]+")


class Thermal(mi.Emitter):
    r"""Thermal emission of the shape that it belongs to.

    =========== ================ ==================================================================================
    temperature float or texture kelvin; `mesh_attribute` named `face_...` gives one per facet       (differentiable)
    radiance    float            instead: in-band radiance of a source that is no blackbody [W m^-2 sr^-1] (differentiable)
    band        string           MWIR, LWIR, SWIR, total, "a-b" in um, or a response's CSV (needed with `temperature`)
    emissivity  float            instead of the material's own                                       (differentiable)
    group       string           label of what emits, [A-Za-z0-9_-]+                                           (self)
    =========== ================ ==================================================================================

    .. code-block:: xml

        <emitter type="thermal">
            <string name="band" value="MWIR"/> <float name="temperature" value="300"/>
        </emitter>

    The emissivity comes from the shape's BSDF (see `emissivity`), so a surface emits from the sides from which it
    reflects. A source with `radiance` emits it as it is, times `emissivity` if that is given. Facet temperatures are
    the mesh's parameter (`SHAPE.face_temperature`); they are turned into radiance once per change, in Float64. A
    texture that varies inside a facet is turned into radiance at every hit instead: right, but slower.
    """

    def __init__(self, props):
        mi.Emitter.__init__(self, props)
        self.m_flags = mi.EmitterFlags.Surface | mi.EmitterFlags.SpatiallyVarying
        self.group = props.get("group", "self")
        if not LABEL.fullmatch(self.group):
            raise InputError(f"thermal: group '{self.group}' must consist of letters, digits, '_' and '-'")
        self.band = band(beside_scene(props["band"])) if "band" in props else None
        if ("temperature" in props) == ("radiance" in props):
            raise InputError("thermal: give either `temperature` or `radiance`")
        self.temperature = self.radiance = self.texture = self.attribute = None
        self.derived = self.derived_from = None     # blackbody radiance, one value or one per facet, and of what
        self.facets = None                          # drawn from by the stock integrators' emitter sampling
        if "radiance" in props:
            self.radiance = mi.Float(props["radiance"])
            if not props["radiance"] >= 0:
                raise InputError(f"thermal: radiance = {props['radiance']:g} must be >= 0")
        elif self.band is None:
            raise InputError("thermal: `temperature` needs a `band`")
        elif isinstance(props["temperature"], mi.Texture):
            self.texture = props["temperature"]
            facet_attribute = re.search(r'name = "(face_\w+)"', str(self.texture))
            self.attribute = facet_attribute and facet_attribute[1]
        else:
            self.temperature = mi.Float(props["temperature"])

        self.given_emissivity = None    # None: the material's
        self.material_emissivity = None
        if "emissivity" in props or "radiance" in props:
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
        if self.temperature is not None:
            self.derive()
        for parameter in (self.radiance, self.given_emissivity):
            if parameter is not None:
                dr.make_opaque(parameter)

    def sources(self) -> tuple:
        """The temperatures that `derived` comes from: the parameter, or the mesh's buffer of facet temperatures."""
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
                raise InputError(f"thermal: temperature{where} = {values[bad][0]:g} K; it must be positive and finite")
            Float64 = dr.float64_array_t(mi.Float)
            self.derived = mi.Float(in_band_radiance(self.band, Float64(temperature)))
            dr.make_opaque(self.derived)
            self.derived_from = temperature.index, temperature.index_ad

    def is_current(self) -> bool:
        return all(self.derived_from == (temperature.index, temperature.index_ad) for temperature in self.sources())

    def refresh(self) -> None:
        """Brings up to date what no parameter's change announces: facet radiances, and the material's emissivity."""
        self.find_emissivity()
        if not self.is_current():
            self.derive()

    def find_emissivity(self) -> None:
        if self.given_emissivity is None and self.material_emissivity is None:
            self.material_emissivity = emissivity_of(self.get_shape().bsdf())

    # ---------------------------------------------------------------- Emission

    def source_radiance(self, si, active):
        """Radiance of the source before emissivity, at the hit [W m^-2 sr^-1]."""
        if self.radiance is not None:
            return self.radiance
        if self.temperature is not None:
            check_attached(self)
            return self.derived
        if self.attribute is not None and self.derived is not None and self.is_current():
            return dr.gather(mi.Float, self.derived, si.prim_index, active)
        Float64 = dr.float64_array_t(mi.Float)
        return mi.Float(in_band_radiance(self.band, Float64(self.texture.eval_1(si, active))))

    def emissivity(self, si, active):
        bsdf = self.get_shape().bsdf()
        if self.given_emissivity is not None:
            return dr.select(reflects(int(bsdf.flags()), si.wi.z), self.given_emissivity, 0)
        self.find_emissivity()
        return self.material_emissivity.eval(bsdf, si, active)

    def eval(self, si, active=True):
        return mi.Spectrum(dr.select(active, self.emissivity(si, active) * self.source_radiance(si, active), 0))

    # ---------------------------------------------------------------- Sampling, uniform over the shape's area

    def sample_surface(self, sample, active):
        """A point of the shape, uniform over its area, as a surface interaction, and the density [1/m^2].

        Facets are drawn from a table of our own: Mitsuba's position samples do not tell which facet they lie on.
        """
        shape = self.get_shape()
        si = dr.zeros(mi.SurfaceInteraction3f, dr.width(sample))
        if shape.is_mesh():
            self.facets = self.facets or Facets([shape])
            si.prim_index, si.p, si.n, density = self.facets.sample(sample, active)
        else:
            ps = shape.sample_position(0, sample, active)
            si.p, si.n, si.uv, density = ps.p, ps.n, ps.uv, ps.pdf
        si.sh_frame = mi.Frame3f(si.n)
        si.shape = mi.ShapePtr(shape)
        return si, density

    def sample_direction(self, it, sample, active=True):
        si, density = self.sample_surface(sample, active)
        ds = dr.zeros(mi.DirectionSample3f, dr.width(sample))
        ds.p, ds.n, ds.time, ds.delta = si.p, si.n, it.time, False
        ds.uv = mi.Point2f(mi.Float(si.prim_index), 0)      # tells `eval_direction` the facet
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
        cos = dr.abs_dot(ds.d, ds.n)
        density = 1 / self.get_shape().surface_area()
        return dr.select(active & (cos > 0), density * dr.square(ds.dist) / cos, 0)

    def eval_direction(self, it, ds, active=True):
        """Radiance toward `it` from a direction sample that `sample_direction` made (its uv holds the facet)."""
        si = dr.zeros(mi.SurfaceInteraction3f, dr.width(ds))
        si.p, si.n, si.prim_index, si.sh_frame = ds.p, ds.n, mi.UInt32(ds.uv.x), mi.Frame3f(ds.n)
        si.shape = mi.ShapePtr(self.get_shape())
        si.wi = si.to_local(-ds.d)
        return self.eval(si, active)

    def sample_position(self, time, sample, active=True):
        si, density = self.sample_surface(sample, active)
        ps = dr.zeros(mi.PositionSample3f, dr.width(sample))
        ps.p, ps.n, ps.time, ps.pdf, ps.delta = si.p, si.n, time, density, False
        return ps, dr.select(active, 1 / density, 0)

    def pdf_position(self, ps, active=True):
        return dr.select(active, 1 / self.get_shape().surface_area(), 0)

    def sample_ray(self, time, sample1, sample2, sample3, active=True):
        """A ray that leaves the front side, cosine-weighted; weight [W m^-2 sr^-1 x m^2 sr]."""
        si, density = self.sample_surface(sample2, active)
        si.wi = mi.warp.square_to_cosine_hemisphere(sample3)
        return si.spawn_ray(si.to_world(si.wi)), self.eval(si, active) * dr.pi / density

    def sample_wavelengths(self, si, sample, active=True):
        return dr.zeros(mi.Color0f), self.eval(si, active)

    def bbox(self):
        return self.get_shape().bbox()

    def to_string(self):
        what = f"temperature = {self.texture or self.temperature}" if self.band else f"radiance = {self.radiance}"
        return f"Thermal[group = {self.group}, band = {self.band and self.band.name}, {what}]"


mi.register_emitter("thermal", Thermal)

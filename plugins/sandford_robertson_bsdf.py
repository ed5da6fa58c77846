r"""BSDF `sandford_robertson`: the Sandford-Robertson reflection model, its directional emissivity
and its fidelity ladder.
"""

import drjit as dr
import mitsuba as mi
import numpy as np
from mi_lcair.plugins.beside_scene import beside_scene
from mi_lcair.plugins.derivatives import attached, check_attached, flatten

from mi_lcair.errors import InputError
from mi_lcair.physics import materials
from mi_lcair.physics.bands import band
from mi_lcair.physics.directional_table import over_the_hemisphere, read_directional_table
from mi_lcair.physics.reflection import sandford_robertson as sr
from mi_lcair.physics.reflection import sandford_robertson_hemispherical as hemispherical

LOBES = ("brdf", "mirror", "diffuse")
# of the table of HDR, on cos(theta) = t^2: 4e-6 after linear interpolation up to 89.5 degrees
NODES = 1024


def interpolate(table, x):
    """Piecewise linear `table` over 0 <= x <= 1 (uniform nodes)."""
    last = dr.width(table) - 1
    x = x * last
    index = dr.minimum(mi.UInt32(x), last - 1)
    low, high = dr.gather(mi.Float, table, index), dr.gather(mi.Float, table, index + 1)
    return dr.lerp(low, high, x - mi.Float(index))


class SandfordRobertson(mi.BSDF):
    r"""Sandford-Robertson BRDF (thesis Eqs 2.14-2.26) with GGX half-vector sampling.

    ============== ======= =====================================================================================
    epsilon        float   emissivity parameter, >= 0                                    (differentiable)
    rho_d          float   diffuse reflectance parameter, >= 0, epsilon + rho_d <= G(b)  (differentiable)
    b              float   grazing-angle parameter, 0..1                                 (differentiable)
    e              float   width of the specular lobe, 0..1, 0 excluded                  (differentiable)
    material       string  instead of the four: a material's name, or a path to a fit's JSON
    band           string  with `material`: the band it must have been measured for
    materials      string  with `material`: a TOML file of the user's own, consulted first
    allow_band     boolean with `material`: take the nearest band if it was not measured for `band`  (false)
    form           string  thesis | normalized (drops d(theta_r) of Eq 2.19)             (the material's, thesis)
    emissivity     string  kirchhoff: 1 - HDR(theta); model: Eq 2.21; or a CSV theta_deg,emissivity  (kirchhoff)
    lobe           string  brdf; mirror: all of HDR(theta) in the mirror direction; diffuse: all of it Lambertian (brdf)
    ============== ======= =====================================================================================

    .. code-block:: xml

        <bsdf type="sandford_robertson">
            <string name="material" value="gloss_black"/> <string name="band" value="MWIR"/>
        </bsdf>

    `si.wi` points to the observer, `wo` to the source (the model is not reciprocal);
    TransportMode.Importance swaps them. One-sided: reflects and emits on the side of the normal.
    Where the raw model would reflect more than arrives, HDR(theta_r) > 1, the BRDF is divided by
    HDR(theta_r) and the emissivity is 0.
    """

    def __init__(self, props):
        mi.BSDF.__init__(self, props)
        form = None
        if "material" in props:
            self.material = props["material"]
            found = materials.material(
                beside_scene(self.material),
                band(beside_scene(props["band"])) if "band" in props else None,
                beside_scene(props["materials"]) if "materials" in props else None,
                props.get("allow_band", False),
            )
            numbers, form = (found.epsilon, found.rho_d, found.b, found.e), found.form
        else:
            self.material = self.id()
            missing = [name for name in ("epsilon", "rho_d", "b", "e") if name not in props]
            if missing:
                raise InputError(
                    f"sandford_robertson: give `material` and `band`, or {', '.join(missing)}"
                )
            numbers = tuple(props[name] for name in ("epsilon", "rho_d", "b", "e"))
        self.form = props.get("form", form or "thesis")
        sr.check_feasible(*numbers, self.form)
        self.epsilon, self.rho_d, self.b, self.e = (mi.Float(number) for number in numbers)

        self.emissivity = props.get("emissivity", "kirchhoff")
        self.measured = None
        if self.emissivity not in ("kirchhoff", "model"):
            path, cos = beside_scene(self.emissivity), np.linspace(0, 1, NODES) ** 2
            theta, values, _ = read_directional_table(path)
            self.measured = mi.Float(over_the_hemisphere(path, theta, values, np.arccos(cos)))
            dr.make_opaque(self.measured)
        self.set_lobe(props.get("lobe", "brdf"))
        self.derive()

    def set_lobe(self, lobe: str) -> None:
        """Chooses the rung of the fidelity ladder: brdf, mirror or diffuse."""
        if lobe not in LOBES:
            raise InputError(
                f"sandford_robertson: lobe '{lobe}' is unknown; it must be one of {', '.join(LOBES)}"
            )
        self.lobe = lobe
        kind = {
            "brdf": mi.BSDFFlags.GlossyReflection | mi.BSDFFlags.NonSymmetric,
            "mirror": mi.BSDFFlags.DeltaReflection | 0,
            "diffuse": mi.BSDFFlags.DiffuseReflection | 0,
        }[lobe]
        self.m_components = [kind | mi.BSDFFlags.FrontSide]
        self.m_flags = self.m_components[0]

    # ---------------------------------------------------------------- Parameters and what is derived from them

    def sources(self):
        return self.epsilon, self.rho_d, self.b, self.e

    def traverse(self, cb):
        for name in ("epsilon", "rho_d", "b", "e"):
            cb.put(name, getattr(self, name), mi.ParamFlags.Differentiable)

    def parameters_changed(self, keys=()):
        sr.check_feasible(*(float(dr.detach(number)[0]) for number in self.sources()), self.form)
        self.derive()

    def derive(self) -> None:
        """Derives, in Float64 and with derivatives, everything that `eval` and `sample` look up."""
        dr.make_opaque(*self.sources())
        Float64 = dr.float64_array_t(mi.Float)
        S = sr.surface(*(Float64(number) for number in self.sources()), form=self.form)
        cos = dr.square(dr.linspace(Float64, 0, 1, NODES))
        lobe = hemispherical.HDR_lobe(S, dr.acos(cos)) / sr.e2_H(cos, S.e)
        self.derived = S.cast(mi.Float), mi.Float(lobe)
        dr.make_opaque(self.derived)

    def refresh(self) -> None:
        if attached(self.sources()) and not attached(flatten(self.derived)):
            self.derive()

    @property
    def surface(self) -> sr.Surface:
        return self.derived[0]

    # ---------------------------------------------------------------- Hemispherical reflectance and emissivity

    def raw_HDR(self, cos, sin2):
        """Parts of HDR(theta_r) (Eq 2.9) of the raw model: floor and lobe."""
        check_attached(self)
        S = self.surface
        lobe = (
            sr.observer_factor(S, cos, sin2)
            * sr.e2_H(cos, S.e)
            * interpolate(self.derived[1], dr.sqrt(cos))
        )
        return S.floor * S.G * sr.g(cos, sin2, S.b), lobe

    def HDR(self, w):
        """HDR as rendered: at most 1, 0 from below."""
        cos = sr.cos_theta(w)
        floor, lobe = self.raw_HDR(cos, sr.sin2_theta(w))
        return dr.select(w.z > 0, dr.minimum(floor + lobe, 1), 0)

    def first_saturated_angle_deg(self) -> float | None:
        """The smallest angle at which the raw model reflects more than arrives, HDR > 1; None if it
        never does.
        """
        theta = np.linspace(0, 0.5 * np.pi, 1801)[:-1]
        floor, lobe = self.raw_HDR(mi.Float(np.cos(theta)), mi.Float(np.sin(theta) ** 2))
        above = (
            dr.detach(floor + lobe).numpy() > 1 + 1e-5
        )  # the table's own error must not raise the alarm
        return float(np.degrees(theta[above.argmax()])) if above.any() else None

    def lobe_probability(self, w):
        """Probability to sample the lobe instead of the floor, at the angle of `w`."""
        floor, lobe = (dr.detach(part) for part in self.raw_HDR(sr.cos_theta(w), sr.sin2_theta(w)))
        return dr.select(floor + lobe > 0, lobe / dr.maximum(floor + lobe, sr.SMALLEST), 1)

    def has_attribute(self, name, active=True):
        return name == "emissivity"

    def eval_attribute_1(self, name, si, active=True):
        """The attribute `emissivity`: directional emissivity toward si.wi, 0 from below."""
        cos, sin2 = sr.cos_theta(si.wi), sr.sin2_theta(si.wi)
        if name != "emissivity":
            value = mi.Float(0)
        elif self.measured is not None:
            value = interpolate(self.measured, dr.sqrt(cos))
        elif self.emissivity == "model":
            value = sr.emissivity(self.surface, cos, sin2)
        else:
            value = 1 - self.HDR(si.wi)
        return dr.select(active & (si.wi.z > 0), value, 0)

    # ---------------------------------------------------------------- Mitsuba's interface

    def brdf_cos(self, ctx, wi, wo):
        """What `eval` returns for the rungs that are no delta function: f cos(theta) [1/sr]."""
        i, r = (wo, wi) if ctx.mode == mi.TransportMode.Radiance else (wi, wo)
        above = (i.z > 0) & (r.z > 0)
        if self.lobe == "diffuse":
            return dr.select(above, self.HDR(r) * dr.inv_pi * wo.z, 0)
        floor, lobe = self.raw_HDR(sr.cos_theta(r), sr.sin2_theta(r))
        return dr.select(above, sr.f(self.surface, i, r) * wo.z / dr.maximum(floor + lobe, 1), 0)

    def density(self, wi, wo):
        """Density of `sample` for the rungs that are no delta function [1/sr]; detached from the
        parameters.
        """
        cosine = dr.inv_pi * sr.cos_theta(wo)
        if self.lobe == "brdf":
            p = self.lobe_probability(wi)
            cosine = dr.lerp(cosine, sr.lobe_pdf(wo, wi, dr.detach(self.surface.e)), p)
        return dr.select((wi.z > 0) & (wo.z > 0), cosine, 0)

    def sample(self, ctx, si, sample1, sample2, active=True):
        bs = dr.zeros(mi.BSDFSample3f)
        bs.eta = 1
        bs.sampled_component = 0
        bs.sampled_type = mi.UInt32(self.m_flags)
        active = active & (si.wi.z > 0)
        if self.lobe == "mirror":
            bs.wo = mi.Vector3f(-si.wi.x, -si.wi.y, si.wi.z)
            bs.pdf = dr.select(active, mi.Float(1), 0)
            return bs, mi.Spectrum(dr.select(active, self.HDR(si.wi), 0))

        bs.wo = sr.sample_cosine(mi.Vector3f, sample2.x, sample2.y)
        if self.lobe == "brdf":
            half = sr.sample_half_vector(
                dr.detach(si.wi), dr.detach(self.surface.e), sample2.x, sample2.y
            )
            reflected = mi.reflect(dr.detach(si.wi), mi.Normal3f(half))
            bs.wo = dr.select(sample1 < self.lobe_probability(si.wi), reflected, bs.wo)
        bs.pdf = self.density(si.wi, bs.wo)
        active &= bs.pdf > 0
        weight = dr.select(
            active, self.brdf_cos(ctx, si.wi, bs.wo) / dr.select(active, bs.pdf, 1), 0
        )
        return bs, mi.Spectrum(weight)

    def eval(self, ctx, si, wo, active=True):
        if self.lobe == "mirror":
            return mi.Spectrum(0)
        return mi.Spectrum(dr.select(active, self.brdf_cos(ctx, si.wi, wo), 0))

    def pdf(self, ctx, si, wo, active=True):
        if self.lobe == "mirror":
            return mi.Float(0)
        return dr.select(active, self.density(si.wi, wo), 0)

    def eval_pdf(self, ctx, si, wo, active=True):
        return self.eval(ctx, si, wo, active), self.pdf(ctx, si, wo, active)

    def eval_diffuse_reflectance(self, si, active=True):
        return mi.Spectrum(dr.select(active, self.HDR(si.wi), 0))

    def to_string(self):
        numbers = ", ".join(
            f"{name} = {float(dr.detach(getattr(self, name))[0]):g}"
            for name in ("epsilon", "rho_d", "b", "e")
        )
        return f"SandfordRobertson[{numbers}, form = {self.form}, emissivity = {self.emissivity}, lobe = {self.lobe}]"


mi.register_bsdf("sandford_robertson", SandfordRobertson)

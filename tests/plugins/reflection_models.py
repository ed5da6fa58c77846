"""What the battery tests: stock BSDFs, and every rung of every registered reflection model."""

from dataclasses import dataclass, field

import drjit as dr
import mitsuba as mi
import numpy as np
from drjit.llvm.ad import Float64

from mi_lcair.physics.reflection import models
from tests.physics.reflection.surfaces import direction

LOBES = ("brdf", "mirror", "diffuse")
SANDFORD_ROBERTSON = {
    "bare_aluminum-MWIR": {"material": "bare_aluminum", "band": "MWIR"},
    "bare_aluminum-LWIR": {"material": "bare_aluminum", "band": "LWIR"},
    "gloss_black-MWIR": {"material": "gloss_black", "band": "MWIR"},
    "gloss_black-LWIR": {"material": "gloss_black", "band": "LWIR"},
    "bare_aluminum-normalized": {"material": "bare_aluminum", "band": "MWIR", "form": "normalized"},
    "broad": {"epsilon": 0.2, "rho_d": 0.1, "b": 0.5, "e": 0.3},
    "broad-normalized": {"epsilon": 0.2, "rho_d": 0.1, "b": 0.5, "e": 0.3, "form": "normalized"},
    "above-one": {
        "epsilon": 0.05,
        "rho_d": 0.02,
        "b": 0.05,
        "e": 0.3,
    },  # raw HDR up to 1.59: divided by it
    "b=0": {"epsilon": 0.3, "rho_d": 0.2, "b": 0.0, "e": 0.1},
    "b=1": {"epsilon": 0.2, "rho_d": 0.1, "b": 1.0, "e": 0.1},
    "bound": {
        "epsilon": 0.2,
        "rho_d": 0.3 - 5e-7,
        "b": 1.0,
        "e": 0.02,
    },  # epsilon + rho_d within 1e-6 of G
    "over-the-bound": {
        "epsilon": 0.5 + 6e-8,
        "rho_d": 0.0,
        "b": 1.0,
        "e": 0.02,
    },  # by the rounding of Float32
    "perfect-diffuse": {"epsilon": 0.0, "rho_d": 1.0, "b": 0.0, "e": 1.0},
    "blackbody": {"epsilon": 1.0, "rho_d": 0.0, "b": 0.0, "e": 1.0},
}
MICROFACET = {
    "rough-metal": {"alpha": 0.1, "gamma": 2.0, "n": 10.0, "k": 30.0, "rho_d": 0.0},
    "polished-metal": {"alpha": 1e-3, "gamma": 1.5, "n": 3.0, "k": 20.0, "rho_d": 0.0},
    "smooth-paint": {"alpha": 0.02, "gamma": 1.2, "n": 1.5, "k": 0.0, "rho_d": 0.05},
    "rough-paint": {"alpha": 0.4, "gamma": 3.0, "n": 1.4, "k": 0.2, "rho_d": 0.3},
    "long-tail": {"alpha": 0.05, "gamma": 0.5, "n": 2.0, "k": 5.0, "rho_d": 0.5},
    "gamma=1": {"alpha": 0.1, "gamma": 1.0, "n": 2.0, "k": 0.0, "rho_d": 0.9},
    "alpha=1": {"alpha": 1.0, "gamma": 4.0, "n": 50.0, "k": 100.0, "rho_d": 1.0},
    "no-facets": {"alpha": 0.3, "gamma": 2.0, "n": 1.0, "k": 0.0, "rho_d": 0.6},
}
KNOWN = {"sandford_robertson": SANDFORD_ROBERTSON, "microfacet": MICROFACET}
RUNGS = {  # the surfaces whose mirror and diffuse rungs are tested too
    "sandford_robertson": ("bare_aluminum-MWIR", "gloss_black-LWIR", "above-one", "b=1"),
    "microfacet": ("rough-metal", "smooth-paint"),
}


@dataclass
class Model:
    """A surface that the battery tests. width: of its lobe, the alpha of Trowbridge and Reitz;
    plugin: what Mitsuba loads.
    """

    name: str
    width: float
    plugin: dict = field(repr=False)

    @property
    def is_ours(self):
        return self.plugin["type"] in models.MODELS

    @property
    def is_delta(self):
        return self.plugin.get("lobe") == "mirror"

    def load(self):
        return mi.load_dict(self.plugin)

    def HDR(self, bsdf, theta):
        """Hemispherical-directional reflectance in Float64, as rendered: at most 1. None where no
        formula is known.
        """
        if self.is_ours:
            return np.minimum(exact_HDR(bsdf, theta), 1)
        return np.full_like(theta, 0.7) if self.plugin["type"] == "diffuse" else None


def exact_surface(bsdf):
    """The model's surface in Float64, for the parameters that the plugin holds in Float32."""
    return bsdf.model.surface_of(bsdf.values, bsdf.form)


def exact_HDR(bsdf, theta):
    """The raw model's HDR in Float64, for the parameters that the plugin holds in Float32."""
    return bsdf.model.HDR(exact_surface(bsdf), Float64(theta)).numpy()


def surfaces_of(model):
    """The plugin properties of some surfaces by name; of a model that is not known here, points of
    its cube.
    """
    if model.name in KNOWN:
        return KNOWN[model.name]
    points = [np.full(len(model.parameters), place) for place in (0.0, 0.3, 0.7, 1.0)]
    return {f"cube-{u[0]}": dict(zip(model.names, model.values_at(u).tolist())) for u in points}


def rung(model, name, lobe):
    """One surface of a model, on one rung of the ladder."""
    plugin = {"type": model.name, "lobe": lobe, **surfaces_of(model)[name]}
    bsdf = mi.load_dict(plugin)
    width = float(dr.max(model.lobe_width(bsdf.surface))[0]) if lobe == "brdf" else 1.0
    prefix = "" if model.name == "sandford_robertson" else f"{model.name}-"
    return Model(f"{prefix}{name}-{lobe}", width, plugin)


MODELS = [
    Model("diffuse", 1.0, {"type": "diffuse", "reflectance": {"type": "uniform", "value": 0.7}}),
    Model("roughconductor", 0.1, {"type": "roughconductor", "distribution": "ggx", "alpha": 0.1}),
    *(rung(model, name, "brdf") for model in models.MODELS.values() for name in surfaces_of(model)),
    *(
        rung(model, name, lobe)
        for model in models.MODELS.values()
        for lobe in ("mirror", "diffuse")
        for name in RUNGS.get(model.name, tuple(surfaces_of(model))[1:2])
    ),
]


def interaction(wi):
    """Surface interactions seen from wi (local frame)."""
    si = dr.zeros(mi.SurfaceInteraction3f, dr.width(wi))
    si.wi, si.n, si.sh_frame = wi, mi.Normal3f(0, 0, 1), mi.Frame3f(mi.Normal3f(0, 0, 1))
    return si


def seen_at(theta, phi=0.0):
    """Surface interactions seen at the angles theta and phi [rad]."""
    return interaction(direction(theta, phi, mi.Vector3f))


def uniform(count, dimensions, seed=0):
    """Uniform random numbers, as arrays of width `count`."""
    rng = np.random.default_rng(seed)
    return [mi.Float(rng.random(count, dtype=np.float32)) for _ in range(dimensions)]


class HalfVectorDomain:
    """Domain of a chi-square test: the microfacet normal that reflects wi into the sample, its
    slope divided by the lobe's width.

    Coordinates are atan |slope / width| and the azimuth, so that a lobe of any width fills the
    domain.
    """

    def __init__(self, wi, width):
        self.wi, self.width = wi, width

    def bounds(self):
        return mi.ScalarBoundingBox2f([0, -np.pi], [np.pi / 2, np.pi])

    def aspect(self):
        return 1

    def map_forward(self, p):
        sin, cos = dr.sincos(p.x)
        sin_phi, cos_phi = dr.sincos(p.y)
        half = dr.normalize(
            mi.Vector3f(self.width * sin * cos_phi, self.width * sin * sin_phi, cos)
        )
        return 2 * dr.dot(self.wi, half) * half - self.wi

    def map_backward(self, wo):
        half = self.wi + wo
        return mi.Vector2f(
            dr.atan2(dr.hypot(half.x, half.y), self.width * half.z), dr.atan2(half.y, half.x)
        )

    def jacobian(self, wo):
        """domega / d(coordinates), by domega_o = 4 (w . half) domega_half; 0 below the horizon."""
        p = self.map_backward(wo)
        sin, cos = dr.sincos(p.x)
        stretch = dr.sqrt(dr.square(cos) + dr.square(self.width * sin))
        return dr.select(
            wo.z > 0,
            4
            * dr.dot(self.wi, dr.normalize(self.wi + wo))
            * dr.square(self.width)
            * sin
            / stretch**3,
            0,
        )

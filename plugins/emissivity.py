"""Directional emissivity of a BSDF, by Kirchhoff's law: what it does not reflect (thesis Eq 2.4),
seen from the observer.
"""

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.plugins.derivatives import children

HIDING = (
    "MaskBSDF",
    "BumpMap",
    "NormalMap",
    "BlendBSDF",
)  # wrappers that answer 0 for their content's emissivity
AZIMUTHS = (0, 0.7, 1.9)  # where a table looks for anisotropy [rad]
NODES, SAMPLES = 65, 4096  # of a table over cos(theta) = t^2, and per node and azimuth


@dataclass
class Emissivity:
    """Emissivity of one BSDF as a function of the surface interaction; dimensionless, 0 on sides
    that do not reflect.

    kind: "attribute" (the BSDF says it itself), "diffuse" (1 - reflectance) or "table" (1 - HDR,
    sampled). error: standard error of the table; 0 for the other two.
    """

    kind: str
    flags: int
    front: mi.Float | None = None
    back: mi.Float | None = None
    error: float = 0.0

    def eval(self, bsdf, si, active=True):
        if self.kind == "attribute":
            return bsdf.eval_attribute_1("emissivity", si, active)
        if self.kind == "diffuse":
            value = 1 - bsdf.eval_diffuse_reflectance(si, active)[0]
        else:
            cos = si.wi.z
            value = dr.select(cos > 0, interpolated(self.front, cos), interpolated(self.back, -cos))
        return dr.select(active & reflects(self.flags, si.wi.z), value, 0)


def reflects(flags: int, cos):
    """Whether a BSDF with these flags reflects on the side of `cos`; a surface emits from the same
    sides.
    """
    front, back = bool(flags & mi.BSDFFlags.FrontSide), bool(flags & mi.BSDFFlags.BackSide)
    return ((cos > 0) & front) | ((cos < 0) & back)


def interpolated(table, cos):
    """Piecewise linear over t = sqrt(cos theta); 0 where there is no table."""
    if table is None:
        return mi.Float(0)
    x = dr.sqrt(dr.clip(cos, 0, 1)) * (NODES - 1)
    index = dr.minimum(mi.UInt32(x), NODES - 2)
    low, high = dr.gather(mi.Float, table, index), dr.gather(mi.Float, table, index + 1)
    return dr.lerp(low, high, x - mi.Float(index))


def emissivity_of(bsdf) -> Emissivity:
    """How a BSDF emits. Tabulates by the BSDF's own `sample` where it neither says so nor is
    diffuse.

    InputError for a BSDF that transmits, is anisotropic, varies over the surface, or hides its
    content's emissivity.
    """
    flags, name = int(bsdf.flags()), bsdf.class_name()
    layers = children(bsdf) if name == "TwoSidedBRDF" else [bsdf]
    kinds = {layer.class_name() for layer in layers}
    if kinds & set(HIDING):
        raise InputError(
            f"bsdf '{bsdf.id()}': {', '.join(kinds & set(HIDING))} hides the emissivity of what it wraps; "
            "use the BSDF itself, or give the thermal emitter an `emissivity`"
        )
    if all(dr.all(layer.has_attribute("emissivity")) for layer in layers):
        return Emissivity("attribute", flags)
    if kinds == {"SmoothDiffuse"}:
        return Emissivity("diffuse", flags)
    textures = [
        child for layer in layers for child in children(layer) if isinstance(child, mi.Texture)
    ]
    for found, word in (
        (flags & mi.BSDFFlags.Transmission, "transmits"),
        (flags & mi.BSDFFlags.Anisotropic, "is anisotropic"),
        (any(texture.is_spatially_varying() for texture in textures), "varies over the surface"),
    ):
        if found:  # stock BSDFs do not set the flag SpatiallyVarying
            raise InputError(
                f"bsdf '{bsdf.id()}' ({name}) {word}: its emissivity cannot be tabulated; "
                "give the thermal emitter an `emissivity`"
            )
    return tabulate(bsdf, flags)


def tabulate(bsdf, flags: int) -> Emissivity:
    """The table 1 - HDR(theta) over both sides that reflect, with its standard error."""
    if dr.flag(dr.JitFlag.SymbolicScope):
        raise RuntimeError(
            f"bsdf '{bsdf.id()}': its emissivity cannot be tabulated while Dr.Jit records a loop or call; "
            "refresh() the scene's thermal emitters first, as bounce_path does"
        )
    tables, error = [], 0.0
    for side, flag in ((1, mi.BSDFFlags.FrontSide), (-1, mi.BSDFFlags.BackSide)):
        if not flags & flag:
            tables.append(None)
            continue
        mean, deviation = sampled_HDR(bsdf, side)
        standard_error = deviation / np.sqrt(SAMPLES)
        spread = np.ptp(mean, axis=0)
        if np.any(spread > 1e-3 + 8 * standard_error.max(axis=0)):
            raise InputError(
                f"bsdf '{bsdf.id()}' is anisotropic: its emissivity cannot be tabulated; "
                "give the thermal emitter an `emissivity`"
            )
        error = max(error, float(standard_error.max()) / np.sqrt(len(AZIMUTHS)))
        table = mi.Float(1 - np.minimum(mean.mean(axis=0), 1))
        dr.make_opaque(table)
        tables.append(table)
    return Emissivity("table", flags, *tables, error=error)


def sampled_HDR(bsdf, side: int) -> tuple[np.ndarray, np.ndarray]:
    """Mean and standard deviation of the BSDF's sample weight, per azimuth and node; shape
    (azimuths, nodes).
    """
    cos = np.maximum(np.linspace(0, 1, NODES) ** 2, 1e-4)
    phi, cos = (grid.ravel() for grid in np.meshgrid(AZIMUTHS, cos, indexing="ij"))
    wi = mi.Vector3f(
        *(
            dr.repeat(mi.Float(values), SAMPLES)
            for values in (
                np.sqrt(1 - cos**2) * np.cos(phi),
                np.sqrt(1 - cos**2) * np.sin(phi),
                side * cos,
            )
        )
    )
    si = dr.zeros(mi.SurfaceInteraction3f, dr.width(wi))
    si.wi, si.n, si.sh_frame = wi, mi.Normal3f(0, 0, 1), mi.Frame3f(mi.Normal3f(0, 0, 1))
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(0, dr.width(wi))
    _, weight = bsdf.sample(mi.BSDFContext(), si, sampler.next_1d(), sampler.next_2d())
    samples = weight[0].numpy().reshape(len(AZIMUTHS), NODES, SAMPLES)
    return samples.mean(axis=2), samples.std(axis=2)

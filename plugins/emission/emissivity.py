"""Directional emissivity of a BSDF by Kirchhoff's law: 1 - reflectance (thesis Eq 2.4).

The direction is that toward the observer.
"""

import re
import zlib
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.plugins import derivatives
from mi_lcair.plugins.bsdfs.reflection_bsdf import interpolate

# BSDFs that return 0 as the emissivity of the BSDF that they wrap.
HIDING = ("MaskBSDF", "BumpMap", "NormalMap", "BlendBSDF")
SIDES = ((1, mi.BSDFFlags.FrontSide), (-1, mi.BSDFFlags.BackSide))
# Flags of BSDFs around a body that light enters; sheets have the flag Null, or transmit diffusely
REFRACTS = int(mi.BSDFFlags.DeltaTransmission | mi.BSDFFlags.GlossyTransmission)
NO_ID = re.compile(r"object_\d+")  # name that Mitsuba gives to an object without an id
GRAZING = 1e-4  # cosine of a table's first node, because a BSDF is not defined at cosine 0
# Nodes of a table over t, with cos(theta) = t^2. Linear interpolation has an error below 3e-5.
NODES = 129
AZIMUTHS = (0.0, 0.7, 1.9)  # azimuths at which a table is compared to find anisotropy [rad]
# Independent sets of quasi-random points. They are evaluated at the azimuths in turn, and their
# scatter gives the error of the table.
RANDOMISATIONS = 12
POINTS = 2**12  # directions of each randomisation at each node


@dataclass(frozen=True)
class Emissivity:
    """Emissivity of a BSDF at a surface interaction; 0 on sides that do not reflect.

    kind: "attribute" (the BSDF's own attribute `emissivity`) or "diffuse" (1 - reflectance). Other
    BSDFs need `Emissivities`, whose kind is "table". flags: the flags of the BSDF.
    """

    kind: str
    flags: int

    def eval(self, bsdf, si, active=True):
        if self.kind == "attribute":
            return bsdf.eval_attribute_1("emissivity", si, active)
        value = 1 - bsdf.eval_diffuse_reflectance(si, active)[0]
        return dr.select(active & reflects(self.flags, si.wi.z), value, 0)


class Emissivities(derivatives.Deriving):
    """The emissivity of a BSDF as a table of 1 - HDR(theta) over both sides that reflect.

    It has the methods that the module `derivatives` describes. `derived` holds the tables, front
    before back, with derivatives with respect to the BSDF's parameters. `refresh` computes them
    again if a parameter has changed. error: largest standard error of an entry. relative_error: rms
    standard error of the entries, divided by their mean.

    HDR is the mean weight of the BSDF's `sample`, not the integral of its `eval`. Paths are
    reflected by `sample`. Emissivity and the reflectance of the paths must add up to 1, so that an
    isothermal room radiates as a blackbody. Where Mitsuba's sampling is approximate, mean weight
    and integral differ: for the visible normals of the Beckmann distribution by up to 0.003.
    """

    kind = "table"

    def __init__(self, bsdf, flags: int):
        self.bsdf, self.flags = bsdf, flags
        self.sides = [side for side, flag in SIDES if flags & flag]
        self.derived, self.made_of, self.error, self.relative_error = None, None, 0.0, 0.0
        self.derive()

    def id(self) -> str:
        return self.bsdf.id()

    def sources(self) -> list:
        """Dr.Jit variables among the BSDF's parameters."""
        return [
            variable for value in self.parameters() for variable in derivatives.variables(value)
        ]

    def parameters(self) -> list:
        return [value for _, value in mi.traverse(self.bsdf)]

    def numbers(self) -> list[str]:
        """Those parameters of the BSDF that are not Dr.Jit variables, as text."""
        return [str(value) for value in self.parameters() if not derivatives.variables(value)]

    def refresh(self) -> None:
        kept, numbers = self.made_of
        if not derivatives.same_variables(self.sources(), kept) or self.numbers() != numbers:
            derivatives.unrecorded(self.derive)

    def derive(self) -> None:
        """Compute the tables; raises InputError if the BSDF proves anisotropic."""
        self.made_of = derivatives.held(self.sources()), self.numbers()
        with_derivatives = derivatives.attached(self.sources())
        HDR = [sampled_HDR(self.bsdf, side, with_derivatives) for side in self.sides]
        errors = [standard_error(runs) for runs in HDR]
        self.error = float(np.max(errors, initial=0.0))
        for runs in HDR:
            if is_anisotropic(runs):
                raise InputError(
                    f"bsdf '{self.id()}' is anisotropic: its emissivity cannot be tabulated; "
                    "give the thermal emitter an `emissivity`"
                )
        self.derived = tuple(1 - dr.minimum(sum(runs) / len(runs), 1) for runs in HDR)
        dr.make_opaque(self.derived)
        emitted = np.sum([dr.detach(table).numpy() for table in self.derived])
        if emitted > 0:
            rms = np.sqrt(np.mean(np.square(errors)))
            self.relative_error = float(rms * np.size(errors) / emitted)

    def eval(self, bsdf, si, active=True):
        self.refresh()
        cos, value = si.wi.z, mi.Float(0)
        for side, table in zip(self.sides, self.derived):
            t = dr.sqrt(dr.clip(side * cos, 0, 1))
            value = dr.select(side * cos > 0, interpolate(table, t), value)
        return dr.select(active, value, 0)


def reflects(flags: int, cos):
    """Whether a BSDF with these flags reflects on the side of `cos`.

    A surface emits from the sides on which it reflects.
    """
    front, back = bool(flags & mi.BSDFFlags.FrontSide), bool(flags & mi.BSDFFlags.BackSide)
    return ((cos > 0) & front) | ((cos < 0) & back)


def emits(flags: int, cos):
    """Whether a surface with a given emissivity emits on the side of `cos`.

    It emits where it reflects, but not into a body of glass: what emits there is inside of the
    body, and `dielectric` would let it out in addition to the given emissivity.
    """
    return reflects(flags, cos) & ((cos > 0) | (flags & REFRACTS == 0))


def emissivity_of(bsdf) -> Emissivity | Emissivities:
    """The emissivity of a BSDF.

    A BSDF that has no attribute `emissivity` and is not diffuse gets a table. Raises InputError for
    a BSDF that transmits, is anisotropic, varies over the surface, or hides the emissivity of a
    BSDF that it wraps.
    """
    flags, name = int(bsdf.flags()), bsdf.class_name()
    layers = derivatives.children(bsdf) if name == "TwoSidedBRDF" else [bsdf]
    kinds = {layer.class_name() for layer in layers}
    if kinds & set(HIDING):
        raise InputError(
            f"bsdf '{bsdf.id()}': {', '.join(kinds & set(HIDING))} hides the emissivity of the "
            "BSDF inside it; use that BSDF itself, or give the thermal emitter an `emissivity`"
        )
    if all(dr.all(layer.has_attribute("emissivity", mi.Bool(True))) for layer in layers):
        return Emissivity("attribute", flags)
    if kinds == {"SmoothDiffuse"}:
        return Emissivity("diffuse", flags)
    # Mitsuba's BSDFs do not set the flag SpatiallyVarying, so their textures are checked
    for is_so, word in (
        (flags & mi.BSDFFlags.Transmission, "transmits"),
        (flags & mi.BSDFFlags.Anisotropic, "is anisotropic"),
        (is_textured(bsdf), "varies over the surface"),
    ):
        if is_so:
            raise InputError(
                f"bsdf '{bsdf.id()}' ({name}) {word}: its emissivity cannot be tabulated; "
                "give the thermal emitter an `emissivity`"
            )
    return Emissivities(bsdf, flags)


def is_textured(bsdf) -> bool:
    """Whether a texture of a BSDF, or of those inside it, varies over the surface."""
    return any(
        child.is_spatially_varying() if isinstance(child, mi.Texture) else is_textured(child)
        for child in derivatives.children(bsdf)
        if isinstance(child, mi.Texture | mi.BSDF)
    )


def sampled_HDR(bsdf, side: int, with_derivatives: bool) -> list:
    """HDR at the table's nodes, one array for each randomisation.

    The points are a scrambled Sobol sequence. Each node and each randomisation has a separate
    digital shift. The seed comes from the BSDF's id. Different BSDFs therefore have independent
    errors, and a repeated calculation gives the same table. Directions are drawn without
    derivatives, so the derivative of the weight is that of the BSDF's value over a fixed density.

    Parameters
    ----------
    bsdf : mi.BSDF
    side : int
        1 for the front, -1 for the back.
    with_derivatives : bool
        Attach derivatives with respect to the BSDF's parameters.

    Returns
    -------
    list of mi.Float
        RANDOMISATIONS arrays of NODES values.
    """
    from scipy.stats.qmc import Sobol  # slow to import, and few scenes need a table

    random = np.random.default_rng([zlib.crc32(NO_ID.sub("", bsdf.id()).encode()), side > 0])
    points = (Sobol(3, seed=random).random(POINTS) * 2.0**32).astype(np.uint32)
    lane = dr.arange(mi.UInt32, NODES * POINTS)
    node, point = lane // POINTS, lane % POINTS
    cos = dr.maximum(dr.square(mi.Float(node) / (NODES - 1)), GRAZING)
    sin = dr.sqrt(1 - dr.square(cos))
    si = dr.zeros(mi.SurfaceInteraction3f, dr.width(lane))
    si.n, si.sh_frame = mi.Normal3f(0, 0, 1), mi.Frame3f(mi.Normal3f(0, 0, 1))
    ctx, runs = mi.BSDFContext(), []
    for run in range(RANDOMISATIONS):
        shifts = random.integers(0, 2**32, (NODES, 3), dtype=np.uint32)
        digits = dr.gather(mi.Point3u, mi.UInt32(points.ravel()), point) ^ dr.gather(
            mi.Point3u, mi.UInt32(shifts.ravel()), node
        )
        u = mi.Point3f(digits >> 8) * 2.0**-24
        azimuth = dr.opaque(mi.Float, AZIMUTHS[run % len(AZIMUTHS)])
        si.wi = mi.Vector3f(sin * dr.cos(azimuth), sin * dr.sin(azimuth), side * cos)
        with dr.suspend_grad():
            bs, weight = bsdf.sample(ctx, si, u.x, mi.Point2f(u.y, u.z), mi.Bool(True))
        if with_derivatives:
            value = derivatives.value_along(bsdf, ctx, si, u.x, mi.Point2f(u.y, u.z), bs)
            weight *= dr.relative_grad(value)
        runs.append(dr.block_sum(weight[0], POINTS) / POINTS)
        dr.eval(runs[-1])
    return runs


def standard_error(runs) -> np.ndarray:
    """Standard error of the mean of independent runs, at each node."""
    values = np.array([dr.detach(run).numpy() for run in runs], dtype=float)
    return values.std(axis=0, ddof=1) / np.sqrt(len(runs))


def is_anisotropic(runs) -> bool:
    """Whether the means at the azimuths differ by more than their statistical errors."""
    values = np.array([dr.detach(run).numpy() for run in runs], dtype=float)
    by_azimuth = [values[k :: len(AZIMUTHS)] for k in range(len(AZIMUTHS))]
    error = np.sqrt(np.mean([part.var(axis=0, ddof=1) / len(part) for part in by_azimuth], axis=0))
    spread = np.ptp([part.mean(axis=0) for part in by_azimuth], axis=0)
    return bool(np.any(spread > 1e-3 + 8 * error.max()))

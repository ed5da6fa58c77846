"""Directional emissivity of a BSDF, by Kirchhoff's law: what it does not reflect (thesis Eq 2.4),
seen from the observer.
"""

import re
import zlib
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.plugins.derivatives import attached, children, held, same_variables, value_along

HIDING = (
    "MaskBSDF",
    "BumpMap",
    "NormalMap",
    "BlendBSDF",
)  # wrappers that answer 0 for their content's emissivity
SIDES = ((1, mi.BSDFFlags.FrontSide), (-1, mi.BSDFFlags.BackSide))
NO_ID = re.compile(r"object_\d+")  # what has no id is numbered as it is loaded
GRAZING = 1e-4  # cosine at which a table begins: at 0 nothing is defined
NODES = 129  # of a table over cos(theta) = t^2: straight lines between them are right to 3e-5
AZIMUTHS = (0.0, 0.7, 1.9)  # where a table looks for anisotropy [rad]
RANDOMISATIONS = (
    12  # of the quasi-random points, in turn at these azimuths; their scatter tells the error
)
POINTS = 2**12  # directions of one randomisation at each node


@dataclass(frozen=True)
class Emissivity:
    """Emissivity of a BSDF as a function of the surface interaction; dimensionless, 0 on sides that
    do not reflect.

    kind: "attribute" (the BSDF says it itself), "diffuse" (1 - reflectance) or "table" (1 - HDR,
    sampled, see `Table`).
    """

    kind: str
    flags: int

    def eval(self, bsdf, si, active=True):
        if self.kind == "attribute":
            return bsdf.eval_attribute_1("emissivity", si, active)
        value = 1 - bsdf.eval_diffuse_reflectance(si, active)[0]
        return dr.select(active & reflects(self.flags, si.wi.z), value, 0)


class Table:
    """The emissivity of a BSDF as a table of 1 - HDR(theta) over both sides that reflect.

    It follows from the BSDF's parameters as `derivatives` demands: `derived` holds the tables,
    front before back, with the derivatives of the parameters, and `refresh` makes them again where
    a parameter has changed. error: the largest standard error of an entry; relative_error: of all
    emission, rms over the entries.

    HDR is the mean weight of the BSDF's own `sample`, not the integral of its `eval`: paths reflect
    by `sample`, and what they do not reflect must be emitted, or an isothermal room would not
    radiate as a blackbody. The two differ where Mitsuba samples approximately: for Beckmann's
    visible normals by up to 0.003.
    """

    kind = "table"

    def __init__(self, bsdf, flags: int):
        self.bsdf, self.flags = bsdf, flags
        self.sides = [side for side, flag in SIDES if flags & flag]
        self.derived, self.made_of, self.error, self.relative_error = None, None, 0.0, 0.0
        self.derive()

    def class_name(self) -> str:
        return self.bsdf.class_name()

    def id(self) -> str:
        return self.bsdf.id()

    def sources(self) -> list:
        """The variables among the BSDF's parameters."""
        return [variable for value in self.parameters() for variable in variables(value)]

    def parameters(self) -> list:
        return [value for _, value in mi.traverse(self.bsdf)]

    def numbers(self) -> list[str]:
        """Those of the BSDF's parameters that are no variables."""
        return [str(value) for value in self.parameters() if not variables(value)]

    def is_current(self) -> bool:
        """Whether the BSDF's parameters are still those that the table was made of."""
        made_of_variables, made_of_numbers = self.made_of
        return (
            same_variables(self.sources(), made_of_variables) and self.numbers() == made_of_numbers
        )

    def refresh(self) -> None:
        if not self.is_current():
            self.derive()

    def derive(self) -> None:
        """Makes the tables. InputError for a BSDF that is found to be anisotropic."""
        if dr.flag(dr.JitFlag.SymbolicScope):
            raise RuntimeError(
                f"bsdf '{self.id()}': its emissivity cannot be tabulated while Dr.Jit records a loop or call; "
                "refresh() the scene's thermal emitters first, as bounce_path does"
            )
        self.made_of = held(self.sources()), self.numbers()
        with_derivatives = attached(self.sources())
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
            value = dr.select(side * cos > 0, interpolated(table, side * cos), value)
        return dr.select(active, value, 0)


def variables(value) -> list:
    """The Dr.Jit variables of a parameter: those of a vector's components, none of a plain number."""
    if dr.is_tensor_v(value):
        return [value.array]
    if dr.is_array_v(value) and dr.depth_v(value) > 1:
        return [variable for component in value for variable in variables(component)]
    return [value] if dr.is_jit_v(value) else []


def reflects(flags: int, cos):
    """Whether a BSDF with these flags reflects on the side of `cos`; a surface emits from the same
    sides.
    """
    front, back = bool(flags & mi.BSDFFlags.FrontSide), bool(flags & mi.BSDFFlags.BackSide)
    return ((cos > 0) & front) | ((cos < 0) & back)


def interpolated(table, cos):
    """Piecewise linear over t = sqrt(cos theta)."""
    x = dr.sqrt(dr.clip(cos, 0, 1)) * (NODES - 1)
    index = dr.minimum(mi.UInt32(x), NODES - 2)
    low, high = dr.gather(mi.Float, table, index), dr.gather(mi.Float, table, index + 1)
    return dr.lerp(low, high, x - mi.Float(index))


def emissivity_of(bsdf) -> Emissivity | Table:
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
    return Table(bsdf, flags)


def sampled_HDR(bsdf, side: int, with_derivatives: bool) -> list:
    """HDR at the table's nodes from each randomisation; with the derivatives of the BSDF's
    parameters, if wanted.

    The points are a scrambled Sobol sequence with a digital shift of its own for each node and
    randomisation. The BSDF's id seeds them: unlike tables have unlike errors, and the same table
    has the same again. Directions are drawn without derivatives, so that the weight's derivative is
    that of the BSDF's value over a fixed density.
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
            bs, weight = bsdf.sample(ctx, si, u.x, mi.Point2f(u.y, u.z))
        if with_derivatives:
            value = value_along(bsdf, ctx, si, u.x, mi.Point2f(u.y, u.z), bs)
            weight *= dr.relative_grad(value)
        runs.append(dr.block_sum(weight[0], POINTS) / POINTS)
        dr.eval(runs[-1])
    return runs


def standard_error(runs) -> np.ndarray:
    """Of the mean of independent runs, at each node."""
    values = np.array([dr.detach(run).numpy() for run in runs], dtype=float)
    return values.std(axis=0, ddof=1) / np.sqrt(len(runs))


def is_anisotropic(runs) -> bool:
    """Whether the means at the azimuths differ by more than their errors explain."""
    values = np.array([dr.detach(run).numpy() for run in runs], dtype=float)
    by_azimuth = [values[k :: len(AZIMUTHS)] for k in range(len(AZIMUTHS))]
    error = np.sqrt(np.mean([part.var(axis=0, ddof=1) / len(part) for part in by_azimuth], axis=0))
    spread = np.ptp([part.mean(axis=0) for part in by_azimuth], axis=0)
    return bool(np.any(spread > 1e-3 + 8 * error.max()))

"""The interface of reflection models, through which the renderer and the fits use them.

A model is one object, an instance of a subclass of `ReflectionModel`. Its functions take a
`Surface`: the parameters of one surface, or of many at once, and the numbers that the model derives
from them. The functions accept Dr.Jit arrays of any float type and keep derivatives. None of them
needs Mitsuba.

Directions are unit 3-vectors in the surface's frame, whose z axis is the normal. `i` points to the
source and `r` to the observer. A model need not be reciprocal, so the order matters.
"""

import tomllib
from abc import ABC, abstractmethod
from dataclasses import dataclass, fields
from functools import cache
from pathlib import Path
from typing import Any

import drjit as dr
import numpy as np
from drjit.llvm.ad import Float64

from mi_lcair.declared import Bounds
from mi_lcair.errors import check_known, errors_of

# Directions in the frame of a surface, whose z axis is the normal
# ----------------------------------------------------------------
# They are Dr.Jit 3-vectors of any float type.

# Smallest denominator. It replaces 0 where a quotient has a removable limit. Its square, which
# occurs in derivatives, is a normal Float32 number.
SMALLEST = 1e-18


def cos_theta(w):
    """Cosine of the angle between direction w and the normal; 0 below the horizon."""
    return dr.maximum(w.z, 0)


def sin2_theta(w):
    """Squared sine of the angle between direction w and the normal."""
    return dr.square(w.x) + dr.square(w.y)


def sample_cosine(Vector, u1, u2):
    """A random direction with density cos(theta) / pi [1/sr], of the type Vector.

    u1, u2: uniform random numbers in 0..1. u1 gives the azimuth, as in the sampling of lobes;
    the compiler then computes its sine and cosine once for both.
    """
    sin_phi, cos_phi = dr.sincos(dr.two_pi * u1)
    radius = dr.sqrt(u2)
    return Vector(radius * cos_phi, radius * sin_phi, dr.safe_sqrt(1 - u2))


# Quadrature over a hemisphere
# ----------------------------


@cache
def unit_rule(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Gauss-Legendre nodes and weights on 0..1, NumPy arrays (count,)."""
    x, weight = np.polynomial.legendre.leggauss(count)
    return 0.5 * (x + 1), 0.5 * weight


def tiled(Float, numbers: np.ndarray, count: int):
    """NumPy's numbers `count` times. They go through a list, into memory of Dr.Jit.

    NumPy's is aligned by chance, and Dr.Jit compiles a kernel for either case.
    """
    return dr.tile(Float(numbers.tolist()), count)


# Models and their parameters
# ---------------------------

# Rounding error between coordinates of the cube and parameters, relative to a parameter's range.
ROUNDING = 1e-12


@dataclass(frozen=True)
class ModelParameter(Bounds):
    """One parameter of a model.

    Its unit and meaning are those of `Bounds`, and its bounds are those of a fit.

    Attributes
    ----------
    name
        Name in scene files, materials and reports.
    symbol
        Symbol for plots, in TeX.
    precision, absolute_precision
        A fit calls the parameter determined if half the width of its 95 % interval is at most
        `precision` times its value, or at most `absolute_precision` in its unit.
    advice
        What else to measure if the BRDF alone does not determine the parameter. Only for parameters
        that a table of emissivity or DHR determines.
    at_lower
        Verdict of a fit whose interval reaches the lower bound: a format string with {high}, the
        other end of the interval.
    """

    name: str
    symbol: str
    precision: float = 0.25
    absolute_precision: float = 0.0
    advice: str = ""
    at_lower: str = ""


def bundled_parameters(model: str) -> tuple[ModelParameter, ...]:
    """The parameters of a bundled model, from the file `parameters.toml`."""
    text = Path(__file__).with_name("parameters.toml").read_text(encoding="utf-8")
    entries = tomllib.loads(text)[model]
    return tuple(ModelParameter(name, **entry) for name, entry in entries.items())


@dataclass(frozen=True)
class Restriction:
    """A simpler case of a model, in which one coordinate of its cube has a fixed value.

    name: name of the case; coordinate: index of the coordinate; value: its fixed value, 0..1.
    """

    name: str
    coordinate: int
    value: float = 0.0


@dataclass
class Surface:
    """Parameters of a surface, and the numbers that a model derives from them once.

    A model subclasses this class as a dataclass. The fields are Dr.Jit floats of one type. Values
    of type `str` or `bool` are also allowed and are never converted.
    """

    def cast(self, Float) -> "Surface":
        """The same surface in another float type.

        The derived numbers are converted, not recomputed: they keep the precision in which they
        were computed.
        """
        return self.map(Float)

    def repeat(self, count: int) -> "Surface":
        """Each of many surfaces, `count` times in a row.

        A single surface (width 1) is returned unchanged. It applies to any number of lanes.
        """
        return self.map(lambda x: dr.repeat(x, count) if dr.width(x) > 1 else x)

    @property
    def numbers(self) -> list:
        """The fields that are Dr.Jit numbers, in their order."""
        values = (getattr(self, field.name) for field in fields(self))
        return [value for value in values if not isinstance(value, (str, bool))]

    def map(self, function) -> "Surface":
        """The surface with a function applied to each of its numbers, in their order."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        return type(self)(
            **{
                name: value if isinstance(value, (str, bool)) else function(value)
                for name, value in values.items()
            }
        )


class ReflectionModel(ABC):
    """A reflection model: all that loading, rendering and fitting may use of it.

    In all methods, S is the `Surface`, i and r are the directions to source and observer (unit
    3-vectors in the surface's frame), cos and sin2 are cosine and squared sine of a direction's
    angle to the normal, and u1, u2 are uniform random numbers in 0..1. `values` are parameters in
    the order of `parameters`, and u are coordinates of the unit cube.

    Attributes
    ----------
    name
        Name in scene files and materials.
    title
        Name in text and plots.
    parameters
        The parameters, in the order in which the methods take them.
    forms
        Variants of the equations, the default first.
    reciprocal
        Whether f(i, r) = f(r, i).
    has_emissivity
        Whether the model has an equation for its directional emissivity.
    restrictions
        Simpler cases that a fit may choose.
    is_compared
        Whether a fit that is not told its model tries this one.
    rounding
        Relative excess over the bounds that is accepted, see `check_feasible`.
    """

    name: str
    title: str
    parameters: tuple[ModelParameter, ...]
    forms: tuple[str, ...] = ("standard",)
    reciprocal: bool = True
    has_emissivity: bool = False
    restrictions: tuple[Restriction, ...] = ()
    is_compared: bool = True
    rounding: float = 0.0

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters, in their order."""
        return tuple(parameter.name for parameter in self.parameters)

    # ------------------------------------------------------------------ What a surface is

    @abstractmethod
    def surface(self, *values, form: str) -> Any:
        """The `Surface` with these parameters, Dr.Jit Float64 arrays in the model's order."""

    def surface_of(self, values, form: str) -> Any:
        """The `Surface` with these numbers. As literals they would make kernels of their own."""
        return self.surface(*(dr.opaque(Float64, float(value)) for value in values), form=form)

    def check_feasible(self, *values: float, form: str = "standard") -> None:
        """Raise InputError for parameters that no surface can have, by default those out of bounds.

        The message names the parameter, its value and its bound.
        """
        for parameter, value in zip(self.parameters, values):
            parameter.check(value, f"{self.name}: {parameter.name}", self.rounding)

    def check_form(self, form: str) -> None:
        """Raise InputError for a form that the model does not have."""
        with errors_of(self.name):
            check_known("form", self.forms, form)

    # ------------------------------------------------------------------ Reflectance

    @abstractmethod
    def f(self, S, i, r):
        """BRDF f_r(i, r).

        Parameters
        ----------
        S
            The `Surface`, one for all lanes (width 1) or one for each lane.
        i, r
            Directions to source and observer, unit 3-vectors in the surface's frame.

        Returns
        -------
        Dr.Jit array
            BRDF [1/sr]; 0 unless both directions lie above the surface.
        """

    @abstractmethod
    def HDR(self, S, theta_r):
        """Hemispherical-directional reflectance at theta_r [rad], in Float64.

        HDR(theta_r) = int f_r(i, r) cos(theta_i) domega_i.
        """

    @abstractmethod
    def DHR(self, S, theta_i):
        """Directional-hemispherical reflectance at theta_i [rad], in Float64.

        DHR(theta_i) = int f_r(i, r) cos(theta_r) domega_r.
        """

    @abstractmethod
    def floor_HDR(self, S, cos, sin2):
        """The part of HDR that comes from the diffuse floor, in closed form.

        Parameters
        ----------
        S
            The `Surface`.
        cos, sin2
            Cosine and squared sine of theta_r.

        Returns
        -------
        Dr.Jit array
            Reflectance of the floor. For a model without a lobe this is all of HDR.
        """

    def lobe_HDR(self, S, theta_r):
        """The lobe's part of HDR at theta_r [rad], divided by `lobe_scale`, in Float64.

        HDR = floor_HDR + lobe_scale * lobe_HDR. The renderer tabulates lobe_HDR over
        sqrt(cos theta_r), so it must be finite and smooth from 0 to 90 degrees.
        """
        return dr.zeros(type(theta_r), dr.width(theta_r))

    def lobe_scale(self, S, cos, sin2):
        """The factor of the lobe's HDR that varies too fast for a table, in closed form."""
        return type(cos)(1)

    def emissivity(self, S, cos, sin2):
        """Directional emissivity by the model's own equation, for models with `has_emissivity`."""
        raise TypeError(f"{self.name} has no own formula for the emissivity")

    # ------------------------------------------------------------------ Drawing directions
    # The renderer samples the floor with a density proportional to the cosine, and the lobe with
    # the next three methods. A model without a lobe need not define them.

    def sample_lobe(self, S, r, u1, u2, u3):
        """A random direction i to the source, drawn from the lobe.

        Parameters
        ----------
        S
            The `Surface`.
        r
            Direction to the observer, above the surface.
        u1, u2, u3
            Uniform random numbers in 0..1. u3 has fewer digits where the lobe is faint. It serves
            to choose between a few cases; not every lobe needs it.

        Returns
        -------
        Dr.Jit 3-vector
            The direction, of the type of r. It may lie below the surface.
        """
        return sample_cosine(type(r), u1, u2)

    def lobe_pdf(self, S, i, r):
        """Probability density [1/sr] with which `sample_lobe` draws i for the direction r."""
        return cos_theta(i) * dr.inv_pi

    def lobe_width(self, S):
        """Width of the lobe.

        It is the tangent of the half-vector's angle at which the lobe has fallen to a quarter.
        """
        return Float64(1)

    # ------------------------------------------------------------------ Remarks

    def remarks(self, *values: float, form: str) -> list[str]:
        """Remarks for the user when a scene with this surface is loaded, one line each."""
        return []

    # ------------------------------------------------------------------ Searching

    @abstractmethod
    def from_cube(self, u) -> tuple:
        """Parameters at coordinates u of the unit cube, differentiable.

        u: Dr.Jit arrays, one for each parameter. Every point of the cube is feasible, and each
        bound of the feasible set is a face of the cube.
        """

    @abstractmethod
    def to_cube(self, values) -> np.ndarray:
        """Coordinates (..., n) of the parameters `values` (..., n), clipped to the cube."""

    @abstractmethod
    def starting_points(self, count: int, seed: int) -> np.ndarray:
        """Random points (count, n) of the cube, distributed like real surfaces.

        The same seed gives the same points.
        """

    def feasible_range(self, values) -> tuple[np.ndarray, np.ndarray]:
        """Lowest and highest feasible value (n,) of each parameter near `values` (n,).

        Parameters that share a bound with it may change to make the value feasible.
        """
        lower, upper = zip(*((parameter.lower, parameter.upper) for parameter in self.parameters))
        return np.array(lower, dtype=float), np.array(upper, dtype=float)

    def nearest_feasible(self, values, held: int) -> np.ndarray:
        """Feasible parameters (n,) near `values` (n,).

        The parameter with index `held` keeps its value if that is feasible.
        """
        return np.clip(values, *self.feasible_range(values))

    def values_at(self, u) -> np.ndarray:
        """Parameters (n,) at coordinates u (n,), as NumPy numbers."""
        values = self.from_cube([dr.scalar.ArrayXf64(coordinate) for coordinate in u])
        return self.exact_bounds(np.array([value[0] for value in values]))

    def exact_bounds(self, values: np.ndarray) -> np.ndarray:
        """Parameters (..., n), set to their bound where they differ from it by rounding only."""
        bounds = [(parameter.lower, parameter.upper) for parameter in self.parameters]
        ends = np.array(bounds, dtype=float).T
        for bound in ends:
            near = np.abs(values - bound) <= ROUNDING * (ends[1] - ends[0])
            values = np.where(near, bound, values)
        return values

    def bound_names(self, u) -> list[str | None]:
        """Name of the bound on which each parameter lies at coordinates u (n,), or None."""
        values = self.values_at(u)
        lower, upper = self.feasible_range(values)
        margin = ROUNDING * (upper - lower)
        return [
            f"{low:g}" if value - low <= near else f"{high:g}" if high - value <= near else None
            for value, low, high, near in zip(values, lower, upper, margin)
        ]


def emissivity_over_hemisphere(model: ReflectionModel, surface: Surface) -> float:
    """Emissivity of a surface over the hemisphere, 1 - 2 int HDR(theta) cos sin dtheta."""
    x, w = np.polynomial.legendre.leggauss(32)  # over sin^2
    angles = type(surface.numbers[0])(np.arcsin(np.sqrt((x + 1) / 2)))
    return 1 - float(model.HDR(surface, angles).numpy() @ w) / 2

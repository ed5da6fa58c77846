"""What a reflection model is: the interface between one model's equations and everything that
renders, plans or fits.

A model is one object, an instance of a subclass of `ReflectionModel`. Its functions take a
`Surface`: the parameters of one surface, or of many at once, with whatever the model derives from
them. They accept Dr.Jit arrays of any float type and keep derivatives; none needs Mitsuba.

Directions are unit 3-vectors in the surface's frame, z along its normal. `i` points to the source
and `r` to the observer. A model need not be reciprocal, so the order matters.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass, fields
from typing import Any

import drjit as dr
import numpy as np
from drjit.llvm.ad import Float64

from mi_lcair.errors import InputError
from mi_lcair.physics.reflection.directions import cos_theta, sample_cosine

ROUNDING = 1e-12  # of a parameter's range, between the cube and the parameters


@dataclass(frozen=True)
class Parameter:
    """One parameter of a model.

    name: as in scene files, materials and reports; symbol: in TeX, for plots; meaning: one line;
    unit: "1" if it has none. lower, upper: bounds of a fit, in the parameter's unit. precision:
    half the width of its 95 % interval, relative to its value, up to which a fit calls it
    determined; absolute_precision: or this half width in its own unit.

    advice: what else to measure where the BRDF alone leaves the parameter open; only for parameters
    that a table of emissivity or DHR determines. at_lower: verdict of a fit whose interval reaches
    the lower bound, a format of {high}, the interval's other end.
    """

    name: str
    symbol: str
    meaning: str
    lower: float
    upper: float
    unit: str = "1"
    precision: float = 0.25
    absolute_precision: float = 0.0
    advice: str = ""
    at_lower: str = ""


@dataclass(frozen=True)
class Restriction:
    """A simpler case of a model, in which one coordinate of its cube is held: its name, the
    coordinate, the value.
    """

    name: str
    coordinate: int
    value: float = 0.0


@dataclass(frozen=True)
class Rung:
    """A simpler reflection that may stand for a surface: "mirror" or "diffuse"; exact: it is the
    same, not an estimate.
    """

    lobe: str
    exact: bool


@dataclass
class Surface:
    """Parameters of a surface and what a model derives from them once; Dr.Jit floats of one type,
    or plain attributes.

    A model subclasses it as a dataclass. Fields annotated `str` or `bool` are carried along
    unchanged.
    """

    def cast(self, Float) -> "Surface":
        """The same surface in another float type; the derived numbers keep the digits of the wider
        one.
        """
        return self._map(Float)

    def repeat(self, count: int) -> "Surface":
        """Each of many surfaces `count` times in a row; a single surface (width 1) fits any number
        of lanes as it is.
        """
        return self._map(lambda x: dr.repeat(x, count) if dr.width(x) > 1 else x)

    def _map(self, function) -> "Surface":
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        return type(self)(
            **{
                name: value if isinstance(value, (str, bool)) else function(value)
                for name, value in values.items()
            }
        )


class ReflectionModel(ABC):
    """A reflection model: all that scene loading, rendering, planning and fitting may know of it.

    name: in scene files and materials; title: in words; parameters: in the order in which functions
    take them; forms: variants of the equations, the default first; reciprocal: whether f(i, r) =
    f(r, i); restrictions: simpler cases that a fit may choose.
    """

    name: str
    title: str
    parameters: tuple[Parameter, ...]
    forms: tuple[str, ...] = ("standard",)
    reciprocal: bool = True
    has_emissivity: bool = False
    restrictions: tuple[Restriction, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters, in their order."""
        return tuple(parameter.name for parameter in self.parameters)

    # ------------------------------------------------------------------ What a surface is

    @abstractmethod
    def surface(self, *values, form: str) -> Any:
        """The `Surface` of parameter values, Dr.Jit Float64 arrays in the order of `parameters`."""

    @abstractmethod
    def check_feasible(self, *values: float, form: str) -> None:
        """Raise InputError, naming parameter, value and bound, for numbers that no surface can
        have.
        """

    def check_form(self, form: str) -> None:
        """Raise InputError for a form that the model does not have."""
        if form not in self.forms:
            raise InputError(
                f"{self.name}: form '{form}' is unknown; it must be one of {', '.join(self.forms)}"
            )

    # ------------------------------------------------------------------ Reflectance

    @abstractmethod
    def f(self, S, i, r):
        """BRDF f_r(i, r) [1/sr]; 0 unless both directions lie above the surface."""

    @abstractmethod
    def HDR(self, S, theta_r):
        """Hemispherical-directional reflectance at theta_r [rad], int f_r cos(theta_i) domega_i, in
        Float64.
        """

    @abstractmethod
    def DHR(self, S, theta_i):
        """Directional-hemispherical reflectance at theta_i [rad], int f_r cos(theta_r) domega_r, in
        Float64.
        """

    @abstractmethod
    def floor_HDR(self, S, cos, sin2):
        """The part of HDR that comes from the diffuse floor, in closed form.

        cos, sin2: cosine and squared sine of theta_r. All of HDR, for a model without a lobe.
        """

    def lobe_HDR(self, S, theta_r):
        """The rest of HDR, divided by `lobe_scale`, in Float64.

        It is tabulated over sqrt(cos theta_r), so it must be finite and smooth from 0 to 90 degrees.
        """
        return dr.zeros(type(theta_r), dr.width(theta_r))

    def lobe_scale(self, S, cos, sin2):
        """A closed form that carries what of the lobe's HDR varies too fast for the table."""
        return type(cos)(1)

    def emissivity(self, S, cos, sin2):
        """The model's own directional emissivity, of models with `has_emissivity`."""
        raise TypeError(f"{self.name} has no emissivity of its own")

    # ------------------------------------------------------------------ Drawing directions
    # The floor is sampled by the cosine, the lobe by these three. A model without a lobe needs none.

    def sample_lobe(self, S, r, u1, u2):
        """A direction i to the source drawn from the lobe, seen from r; it may lie below the
        surface. u1, u2: uniform in 0..1.
        """
        return sample_cosine(type(r), u1, u2)

    def lobe_pdf(self, S, i, r):
        """Density of `sample_lobe` [1/sr]."""
        return cos_theta(i) * dr.inv_pi

    def lobe_width(self, S):
        """Width of the lobe: the tangent of the half-vector's angle at which it has fallen to a
        quarter.
        """
        return Float64(1)

    # ------------------------------------------------------------------ Planning and remarks

    def lower_rung(self, *values: float, form: str) -> Rung | None:
        """What may stand for a surface with these parameters in a cheaper render; None where
        nothing may.
        """
        return None

    def remarks(self, *values: float, form: str) -> list[str]:
        """What a user should know when a scene with this surface is loaded, one line each."""
        return []

    # ------------------------------------------------------------------ Searching

    @abstractmethod
    def from_cube(self, u) -> tuple:
        """Parameters from coordinates in the unit cube (Dr.Jit arrays, one per parameter),
        differentiable.

        Every point of the cube is feasible, and each bound of the feasible set is a face of the
        cube.
        """

    @abstractmethod
    def to_cube(self, values) -> np.ndarray:
        """Coordinates (..., n) of parameters (..., n), clipped to the cube."""

    @abstractmethod
    def starting_points(self, count: int, seed: int) -> np.ndarray:
        """(count, n) points of the cube, spread as real surfaces are; the same for each seed."""

    def feasible_range(self, values) -> tuple[np.ndarray, np.ndarray]:
        """Lowest and highest value (n,) that each parameter can have next to `values` (n,), where
        parameters that share a bound make room for it.
        """
        lower, upper = zip(*((parameter.lower, parameter.upper) for parameter in self.parameters))
        return np.array(lower, dtype=float), np.array(upper, dtype=float)

    def nearest_feasible(self, values, held: int) -> np.ndarray:
        """Feasible parameters (n,) near `values` (n,); that of index `held` keeps its value."""
        return np.clip(values, *self.feasible_range(values))

    def values_at(self, u) -> np.ndarray:
        """Parameters (n,) at coordinates u (n,)."""
        values = self.from_cube([dr.scalar.ArrayXf64(coordinate) for coordinate in u])
        return self.exact_bounds(np.array([value[0] for value in values]))

    def exact_bounds(self, values: np.ndarray) -> np.ndarray:
        """Parameters (..., n); one that is a bound to the cube's rounding is the bound itself."""
        ends = np.array([(one.lower, one.upper) for one in self.parameters], dtype=float).T
        for bound in ends:
            near = np.abs(values - bound) <= ROUNDING * (ends[1] - ends[0])
            values = np.where(near, bound, values)
        return values

    def bound_names(self, u) -> list[str | None]:
        """For each parameter at coordinates u (n,) the name of the bound it lies on, or None."""
        values = self.values_at(u)
        lower, upper = self.feasible_range(values)
        margin = ROUNDING * (upper - lower)
        return [
            f"{low:g}" if value - low <= by else f"{high:g}" if high - value <= by else None
            for value, low, high, by in zip(values, lower, upper, margin)
        ]

"""Values with their errors, and what contributes to the errors.

The law of propagation of uncertainty (GUM, JCGM 100:2008, 5.1.2 and 5.2.2): the variance of a
result y is c V c, with the derivatives c of y and the covariance V of its quantities. Quantities
whose errors are correlated form a group. The contributions of different groups are independent.

A table [sigma] states standard deviations. A table in place of one states another distribution (GUM
supplement 1, JCGM 101:2008, 6.4). x is the value of the quantity:

.. code-block:: toml

    "lid.temperature" = {uniform = 2}               # within x - 2 .. x + 2, or [lower, upper]
    "terrain.temperature" = {triangular = "1 %"}    # the same, with its mode at x
    "sky.radiance" = {lognormal = 1.2}              # median x, and 68 % within x / 1.2 .. 1.2 x
    "paint.epsilon" = {normal = 0.03, upper = 1}    # cut off at `lower` and `upper`, or one of them
"""

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from math import floor, isfinite, log10
from typing import Any

import numpy as np

from mi_lcair.declared import Bounds
from mi_lcair.errors import InputError, check_known, errors_of, shown
from mi_lcair.toml_table import LARGEST, dotted, table_of

# Units as ends of columns' names
UNIT_NAMES = {"W/sr": "_W_sr", "W m^-2": "_W_m2", "K": "_K", "m": "_m"}

KINDS = ("uniform", "triangular", "lognormal", "normal")
ENDS = ("lower", "upper")  # further entries of a normal distribution
RELATIVE = re.compile(r"\s*([0-9.eE+-]+)\s*%\s*")
Stated = float | str | Mapping  # an entry of [sigma], such as 2.0, "5 %" or {uniform = 2}
WIDTH = Bounds(is_positive=True, upper=LARGEST)  # standard deviations, half widths and factors


@dataclass(frozen=True)
class Contribution:
    """Contribution of a quantity, a group of correlated quantities or a noise to the error of a
    result.

    Attributes
    ----------
    quantity : str
        Name of the quantity, of the group, or of the noise.
    contribution : float or ndarray
        Change of the result for plus one standard uncertainty of the quantity, in the result's
        unit. For a group and for a noise it is a standard uncertainty of the result.
    share : float or None
        Share of the variance of the result. None for members of a group and for arrays.
    value, sigma, sensitivity, sensitivity_error : float or ndarray or None
        Value and standard uncertainty of the quantity; derivative of the result with respect to it,
        and its standard error. None for a group, for a noise, and if the number is not known.
    unit : str
        Unit of value and sigma.
    distribution : str
        The quantity's distribution in words, if it is not normal.
    members : tuple of Contribution
        The quantities of a group. Each contribution is that of the single quantity.
    """

    quantity: str
    contribution: float
    share: float | None = None
    value: float | None = None
    sigma: float | None = None
    sensitivity: float | None = None
    sensitivity_error: float | None = None
    unit: str = ""
    distribution: str = ""
    members: tuple["Contribution", ...] = ()

    @staticmethod
    def of(quantity: str, sigma: float, sensitivity: Any, **more: Any) -> "Contribution":
        """The contribution of a quantity. more: further attributes."""
        change = sensitivity * sigma
        return Contribution(quantity, change, sigma=sigma, sensitivity=sensitivity, **more)

    @staticmethod
    def together(
        quantity: str, members: Iterable["Contribution"], covariance: np.ndarray
    ) -> "Contribution":
        """The contribution of a group of quantities with this covariance, (n, n).

        A group of one is that quantity.
        """
        members = tuple(members)
        if len(members) == 1:
            return members[0]
        c = np.array([member.sensitivity for member in members])
        variance = float(max(c @ covariance @ c, 0.0))
        return Contribution(quantity, float(np.sqrt(variance)), members=members)

    def through(self, linear: Callable[[Any], Any]) -> "Contribution":
        """The contribution to a linear function of the result, such as a mean."""
        return replace(self, contribution=linear(self.contribution), sensitivity=None, share=None)


@dataclass(frozen=True)
class Estimate:
    """A value with its error, and the contributions to the error.

    Attributes
    ----------
    value, standard_error : float or ndarray
        The value and its standard uncertainty.
    unit : str
        Their unit; "" or "1" for a ratio.
    half_width : float or ndarray or None
        Half of the 95 % interval, if it is known.
    contributions : tuple of Contribution
        Contributions to the standard uncertainty, if they are known.
    """

    value: float
    standard_error: float = 0.0
    unit: str = ""
    half_width: float | None = None
    contributions: tuple[Contribution, ...] = ()

    @staticmethod
    def of(value: Any, unit: str, contributions: Iterable[Contribution]) -> "Estimate":
        """The value with the standard uncertainty from independent contributions.

        The contributions of a single value come in the order of their shares, the largest first.
        """
        rows = tuple(contributions)
        variance = sum((row.contribution**2 for row in rows), start=np.zeros(np.shape(value)))
        result = Estimate(value, np.sqrt(variance), unit, contributions=rows)
        return result if isinstance(value, np.ndarray) else result.reduced(float)

    def reduced(self, take: Callable[[np.ndarray], float]) -> "Estimate":
        """The estimate of arrays as one of numbers, such as their medians.

        The size of each contribution is reduced. It has the sign of the reduced derivative.
        """
        error, rows = take(self.standard_error), []
        for row in self.contributions:
            size, slope = take(abs(row.contribution)), row.sensitivity
            slope = slope if slope is None else take(slope)
            signed = size if slope is None else float(np.copysign(size, slope))
            share = (size / error) ** 2 if error else 0.0
            rows.append(replace(row, contribution=signed, sensitivity=slope, share=share))
        rows.sort(key=lambda row: -row.share)
        return replace(
            self, value=take(self.value), standard_error=error, contributions=tuple(rows)
        )

    def __getitem__(self, quantity: str) -> Contribution:
        """The contribution of a quantity, a group or a noise. Raises KeyError if there is none."""
        for row in self.contributions:
            if row.quantity == quantity:
                return row
        raise KeyError(quantity)

    def __str__(self) -> str:
        if np.ndim(self.value):
            ends = np.nanmin(self.value), np.nanmax(self.value)
            return in_unit(" to ".join(f"{end:.6g}" for end in ends), self.unit)
        if self.half_width is not None:
            return f"{in_unit(with_error(self.value, self.half_width), self.unit)} (95 %)"
        if not self.standard_error:
            return in_unit(f"{self.value:.6g}", self.unit)
        return in_unit(with_error(self.value, self.standard_error), self.unit)

    def through(self, linear: Callable[..., Any], *others: "Estimate") -> "Estimate":
        """The same linear function, without an offset, of the values and of each of their errors.

        others: further arguments, whose errors are fully correlated with those of this one.
        """
        names = ["value", "standard_error"]
        names += ["half_width"] if self.half_width is not None else []
        of_all = (self, *others)
        return Estimate(**{name: linear(*(getattr(one, name) for one in of_all)) for name in names})

    def as_dict(self) -> dict[str, Any]:
        """The value, its standard error and what else is known, for JSON."""
        more = {name: getattr(self, name) for name in ("unit", "half_width", "contributions")}
        known = {
            name: entry
            for name, entry in more.items()
            if isinstance(entry, (float, np.ndarray)) or entry
        }
        return {"value": self.value, "standard_error": self.standard_error, **known}

    @property
    def pair(self) -> tuple[Any, Any]:
        """The value and its standard error."""
        return self.value, self.standard_error

    @property
    def expanded(self) -> str:
        """The expanded uncertainty in words."""
        return f"+- {in_unit(f'{2 * self.standard_error:.3g}', self.unit)} (k = 2, about 95 %)"

    def columns(self) -> dict[str, np.ndarray]:
        """The contributions as a table: a row for each, and for each member of a group.

        A group's row is followed by its members, whose share is NaN. `unit` is that of value and
        sigma. The contribution is in the unit of the result. Of an array, columns of arrays have a
        row of its shape for each. A column of sigma is text if one is stated so, such as "5 %".
        """
        of_rows = [(row, entry) for row in self.contributions for entry in (row, *row.members)]
        table = [entry for _, entry in of_rows]

        def column(name, kind=float):
            values = [getattr(entry, name) for entry in table]
            if any(isinstance(value, str) for value in values):
                return np.array(["" if value is None else str(value) for value in values])
            # None is NaN
            return np.array(np.broadcast_arrays(*(np.array(value, kind) for value in values)), kind)

        return {
            "quantity": column("quantity", str),
            "distribution": column("distribution", str),
            "is_member": np.array([entry is not row for row, entry in of_rows], bool),
            "value": column("value"),
            "sigma": column("sigma"),
            "unit": column("unit", str),
            "sensitivity": column("sensitivity"),
            "sensitivity_error": column("sensitivity_error"),
            f"contribution{UNIT_NAMES.get(self.unit, '')}": column("contribution"),
            "share": column("share"),
        }


def with_error(value: float, error: float) -> str:
    """A value and its error as text, such as "293.1 +- 2.4".

    The error has two digits, and the value ends at the second one. It has 2 to 9 digits.
    """
    value, error = float(value), float(error)
    if not (isfinite(value) and isfinite(error) and value and error):
        return f"{value:.6g} +- {error:.2g}"
    order = floor(log10(abs(value)))
    place = min(max(floor(log10(error)) - 1, order - 8), order - 1)
    return f"{round(value, -place):.9g} +- {float(f'{error:.2g}'):g}"


def in_unit(text: str, unit: str) -> str:
    """A text with a unit behind it, which a ratio does not have."""
    return text if unit in ("", "1") else f"{text} {unit}"


def slope(
    function: Callable[[float], Any],
    value: float,
    step: float,
    bounds: tuple[float, float] = (-np.inf, np.inf),
) -> Any:
    """Derivative of a function at a value by a difference over a step to both sides.

    A side that is out of bounds ends there. Raises InputError if that leaves no room.
    """
    ends = np.clip([value - step, value + step], *bounds)
    if ends[0] == ends[1]:
        raise InputError("has no room within its bounds")
    low, high = (function(float(end)) for end in ends)
    return (high - low) / (ends[1] - ends[0])


def uncertain(given: object, name: str, bounds: Bounds = Bounds()) -> Estimate:
    """A number with its uncertainty.

    Parameters
    ----------
    given : float, pair of float, str or Estimate
        The number, with its standard uncertainty as a pair (0.92, 0.02) or in a text "0.92+-0.02"
        or "0.92+-2%".
    name : str
        Name of the number in messages.
    bounds : Bounds
        Bounds of the number.

    Raises
    ------
    InputError
        If it is no such number, if it is out of bounds, or if the uncertainty is negative.
    """
    if isinstance(given, Estimate):
        value, sigma = given.value, given.standard_error
    else:
        try:
            value, sigma = parsed(given)
        except (TypeError, ValueError):
            raise InputError(
                f"{name} {shown(str(given))} is no number; give one, such as 0.9 or 0.9+-0.02"
            ) from None
    bounds.check(value, name)
    room = bounds.upper - max(bounds.lower, 0 if bounds.is_positive else -np.inf)
    most = Bounds(lower=0, upper=min(room, LARGEST), unit=bounds.unit)
    most.check(sigma, f"standard uncertainty of {name}")
    return Estimate(value, sigma, bounds.unit)


def parsed(given) -> tuple[float, float]:
    """Value and uncertainty; raises TypeError or ValueError."""
    if not isinstance(given, str):
        value, sigma = given if isinstance(given, (tuple, list)) else (given, 0)
        return float(value), float(sigma)
    number, mark, error = given.replace("±", "+-").partition("+-")
    value = float(number)
    if error.strip().endswith("%"):
        return value, abs(value) * float(error.strip().removesuffix("%")) / 100
    return value, float(error) if mark else 0.0


@dataclass(frozen=True)
class Distribution:
    """Distribution of a quantity.

    kind: one of KINDS. centre: mode of a triangular, median of a log-normal, and mean of a normal
    distribution before it is cut off. width: factor of a log-normal, standard deviation of a normal
    distribution before it is cut off; half the width of others. lower, upper: its ends.
    """

    kind: str
    centre: float
    width: float
    lower: float
    upper: float

    @property
    def words(self) -> str:
        """The distribution in tables."""
        return "cut off" if self.kind == "normal" else self.kind

    @cached_property
    def law(self) -> Any:
        """The distribution of scipy.stats, with `mean`, `std` and `ppf`."""
        from scipy import stats

        start, span = self.lower, self.upper - self.lower
        if self.kind == "uniform":
            return stats.uniform(start, span)
        if self.kind == "triangular":
            return stats.triang((self.centre - start) / span, start, span)
        if self.kind == "lognormal":
            return stats.lognorm(np.log(self.width), scale=self.centre)
        ends = ((end - self.centre) / self.width for end in (self.lower, self.upper))
        return stats.truncnorm(*ends, self.centre, self.width)

    @staticmethod
    def of(name: str, stated: Mapping, value: float) -> "Distribution":
        """The distribution that a table states for a quantity with this value.

        Raises InputError if the value is not inside it.
        """
        (kind,) = set(stated) & set(KINDS)
        width, lower, upper = stated[kind], -np.inf, np.inf
        if isinstance(width, str):
            width = deviation(name, width, value)
        if kind == "normal":
            lower, upper = (stated.get(end, limit) for end, limit in zip(ENDS, (lower, upper)))
        elif kind == "lognormal":
            lower = np.finfo(float).tiny
        elif isinstance(width, list):
            (lower, upper), width = width, (width[1] - width[0]) / 2
        else:
            lower, upper = value - width, value + width
        if not lower <= value <= upper:
            raise InputError(
                f"'{name}' = {dict(stated)}: does not contain the value {value:g} of the quantity"
            )
        return Distribution(kind, value, float(width), float(lower), float(upper))


def relative(text: str) -> float | None:
    """The fraction that a text such as "5 %" states; None for any other text."""
    match = RELATIVE.fullmatch(text)
    try:
        return float(match[1]) / 100 if match else None
    except ValueError:
        return None


def sigmas(tree: Mapping) -> dict[str, Stated]:
    """What the table [sigma] of a file states, by the dotted name of each quantity.

    Raises InputError for what is neither a standard deviation nor a distribution.
    """
    stated = dotted(table_of(tree, "sigma"), KINDS)
    with errors_of("[sigma]"):
        for name, value in stated.items():
            check_sigma(name, value)
    return stated


def deviation(name: str, stated: Stated, value: float) -> float:
    """Standard deviation that [sigma] states, in the unit of a quantity with this value.

    Raises InputError for a relative one of the value 0.
    """
    if isinstance(stated, Mapping):
        return float(Distribution.of(name, stated, value).law.std())
    if isinstance(stated, str):
        if value == 0:
            raise InputError(f"'{name}' = \"{stated}\" is relative to a value of 0; give a number")
        return relative(stated) * abs(value)
    return float(stated)


def check_sigma(name: str, value) -> None:
    """Raise InputError for what is no positive standard deviation, also relative.

    Tables must state a distribution.
    """
    if isinstance(value, Mapping):
        check_distribution(name, value)
        return
    number = relative(value) if isinstance(value, str) else value
    if isinstance(number, bool) or not isinstance(number, (int, float)):
        raise InputError(
            f"'{name}' = {shown(str(value))}; must be a standard deviation in the quantity's unit, "
            'or a relative one such as "5 %"'
        )
    WIDTH.check(number, f"'{name}'")


def check_distribution(name: str, stated: Mapping) -> None:
    """Raise InputError for a table that states no distribution."""
    kinds = [kind for kind in KINDS if kind in stated]
    if len(kinds) != 1:
        raise InputError(f"'{name}' = {dict(stated)}: must have one of {', '.join(KINDS)}")
    (kind,) = kinds
    allowed = (kind, *ENDS) if kind == "normal" else (kind,)
    check_known(f"entry of '{name}'", allowed, *stated)
    numbers = [stated[end] for end in ENDS if end in stated]
    ends = numbers if kind == "normal" else stated[kind]
    if isinstance(ends, list):
        is_rising = all(type(end) in (int, float) and np.isfinite(end) for end in ends) and (
            sorted(set(ends)) == ends
        )
        if not is_rising or kind != "normal" and len(ends) != 2:
            raise InputError(f"'{name}' = {dict(stated)}: its ends must be two rising numbers")
    if kind == "normal" or not isinstance(stated[kind], list):
        check_sigma(f"{name}: {kind}", stated[kind])
    if kind == "lognormal" and not (type(stated[kind]) in (int, float) and stated[kind] > 1):
        raise InputError(f"'{name}' = {dict(stated)}: must be a factor above 1")

"""Distributions of uncertain quantities that are not normal (GUM supplement 1, JCGM 101:2008, 6.4).

A table in place of a standard deviation states one of them. x is the value of the quantity:

.. code-block:: toml

    "lid.temperature" = {uniform = 2}               # within x - 2 .. x + 2, or [lower, upper]
    "terrain.temperature" = {triangular = "1 %"}    # the same, with its mode at x
    "sky.radiance" = {lognormal = 1.2}              # median x, and 68 % within x / 1.2 .. 1.2 x
    "paint.epsilon" = {normal = 0.03, upper = 1}    # cut off at `lower` and `upper`, or one of them
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from mi_lcair.declared import Bounds
from mi_lcair.errors import InputError, check_known, shown

KINDS = ("uniform", "triangular", "lognormal", "normal")
ENDS = ("lower", "upper")  # further entries of a normal distribution
RELATIVE = re.compile(r"\s*([0-9.eE+-]+)\s*%\s*")
WIDTH = Bounds(is_positive=True)  # standard deviations, half widths and factors


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
            width = in_unit(name, width, value)
        if kind == "normal":
            lower, upper = (stated.get(end, limit) for end, limit in zip(ENDS, (lower, upper)))
        elif kind == "lognormal":
            lower = np.nextafter(0.0, 1.0)
        elif isinstance(width, list):
            (lower, upper), width = width, (width[1] - width[0]) / 2
        else:
            lower, upper = value - width, value + width
        if not lower <= value <= upper:
            raise InputError(
                f"'{name}' = {dict(stated)}: does not contain the value {value:g} of the quantity"
            )
        return Distribution(kind, value, float(width), float(lower), float(upper))


def in_unit(name: str, text: str, value: float) -> float:
    """A text such as "5 %" in the unit of a quantity with this value; InputError for 0."""
    if value == 0:
        raise InputError(f"'{name}' = \"{text}\" is relative to a value of 0; give a number")
    return relative(text) * abs(value)


def relative(text: str) -> float | None:
    """The fraction that a text such as "5 %" states; None for any other text."""
    match = RELATIVE.fullmatch(text)
    try:
        return float(match[1]) / 100 if match else None
    except ValueError:
        return None


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

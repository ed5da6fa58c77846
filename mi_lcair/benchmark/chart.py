"""Charts of error against cost: their points, and how these are written as CSV and tables."""

import math
from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np

from mi_lcair.formats import csv

# Relative errors for which a table names the cheapest method
TOLERANCES = 0.05, 0.01, 0.001, 0.0001


@dataclass(frozen=True)
class Point:
    """One method at one effort on one case.

    Attributes
    ----------
    case, method
        Names of the case and of the method.
    effort
        The method's own measure of its work, such as samples for each dimension or rays.
    samples
        Evaluations of the BRDF, or rays.
    seconds
        Median time of one run, without the compile.
    compile_seconds
        Time of the compile.
    error, error_low, error_high
        Median and quartiles of |value - exact| / exact over the repetitions.
    value
        Median of the values.
    rms
        Root mean square of the relative error. Rare outliers raise it but not the median.
    memory_MB
        Largest memory of a run beyond that before it; NaN if it was not measured.
    """

    case: str
    method: str
    effort: float
    samples: float
    seconds: float
    compile_seconds: float
    error: float
    error_low: float
    error_high: float
    value: float
    rms: float
    memory_MB: float = np.nan


class Cost(NamedTuple):
    """What runs of a method cost.

    samples, seconds: numbers or arrays, one for each repetition. compile_seconds: time of the
    compile.
    """

    samples: float | np.ndarray
    seconds: float | np.ndarray
    compile_seconds: float


def point(case, method, effort, cost: Cost, values, exact) -> Point:
    """The Point of repeated runs.

    Parameters
    ----------
    case, method, effort
        As in `Point`.
    cost
        Of the repetitions, of which the medians are taken.
    values
        Values of the repetitions, (n,).
    exact
        Exact value.

    Returns
    -------
    Point
        Medians and quartiles over the repetitions.
    """
    errors = np.abs(np.asarray(values) - exact) / abs(exact)
    low, middle, high = np.quantile(errors, (0.25, 0.5, 0.75))
    costs = np.median(cost.samples), np.median(cost.seconds), cost.compile_seconds
    value, rms = np.median(values), np.sqrt(np.mean(errors**2))
    return Point(case, method, effort, *map(float, (*costs, middle, low, high, value, rms)))


def curve(points, case: str, method: str) -> list[Point]:
    """The points of one method on one case, in order of rising effort."""
    return sorted(
        (p for p in points if (p.case, p.method) == (case, method)), key=lambda p: p.effort
    )


def names(points, field: str) -> list[str]:
    """The different values of "case" or "method", in order of appearance."""
    return list(dict.fromkeys(getattr(p, field) for p in points))


def reach(points, case: str, method: str, tolerance: float, by="rms") -> Point | None:
    """The least effort from which on the error stays at or below a tolerance.

    Parameters
    ----------
    points
        Points of any cases and methods.
    case, method
        Names of the case and of the method.
    tolerance
        Relative error.
    by
        Attribute of `Point` that is compared: "rms", or "error" for the median.

    Returns
    -------
    Point or None
        The point of this effort, or None if there is none.
    """
    reached = None
    for p in reversed(curve(points, case, method)):
        if not getattr(p, by) <= tolerance:
            break
        reached = p
    return reached


def cheapest(points, case: str, tolerance: float) -> Point | None:
    """The point of the fastest method whose rms error reaches a tolerance.

    Parameters
    ----------
    points
        Points of any cases and methods.
    case
        Name of the case.
    tolerance
        Relative rms error.

    Returns
    -------
    Point or None
        The point, or None if no method reaches the tolerance.
    """
    reached = filter(
        None, (reach(points, case, method, tolerance) for method in names(points, "method"))
    )
    return min(reached, key=lambda p: p.seconds, default=None)


# ---- files


def write_csv(path, points) -> None:
    """Write a CSV file with a row for each point; its columns are the fields of `Point`."""
    csv.write(path, {of.name: [getattr(p, of.name) for p in points] for of in fields(Point)})


# ---- Text


def percent(tolerance: float) -> str:
    """A tolerance in percent, such as 1% or 0.01%."""
    return f"{100 * tolerance:g}%"


def costs(p: Point | None) -> tuple[str, str]:
    """Samples and time of a point, as text."""
    return (digits(p.samples), duration(p.seconds)) if p else ("", "")


def digits(number: float) -> str:
    """A number with two significant digits and without exponent, such as 0.52, 12 or 8 900."""
    if number == 0 or not math.isfinite(number):
        return str(number)
    decimals = 1 - math.floor(math.log10(abs(number)))
    text = f"{round(number, decimals):,.{max(decimals, 0)}f}".replace(",", " ")
    return text.rstrip("0").rstrip(".") if "." in text else text


def duration(seconds: float) -> str:
    """A time with two significant digits and its unit."""
    for unit, size in (("s", 1), ("ms", 1e-3), ("µs", 1e-6)):
        if seconds >= size:
            return f"{digits(seconds / size)} {unit}"
    return f"{digits(seconds / 1e-9)} ns"

"""Charts of error against cost: their points, as CSV, tables and pictures."""

import math
from dataclasses import asdict, dataclass, fields
from itertools import cycle
from typing import NamedTuple

import numpy as np

from mi_lcair import formats
from mi_lcair.drawing import drawing, plain

# Relative errors for which a table names the cheapest method
TOLERANCES = 0.05, 0.01, 0.001, 0.0001
MARKERS = "osD^v<>PX*hp"
TIME = {"seconds": "time after the compile (s)"}


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
    formats.write_csv(
        path, {of.name: [getattr(p, of.name) for p in points] for of in fields(Point)}
    )


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


def cheapest_table(points, case: str, cost: str, limit: str = "") -> list[list[str]]:
    """Table of the cheapest method for each case and tolerance of the rms error.

    `case` and `cost` are the headings of the columns of cases and of samples. `limit` says in words
    up to which effort the methods were tried.
    """
    rows = [[case, "rms error", "cheapest", cost, "time"]]
    for name in names(points, "case"):
        for tolerance in TOLERANCES:
            best = cheapest(points, name, tolerance)
            rows.append(
                [
                    name,
                    percent(tolerance),
                    best.method if best else f"none reaches it{limit}",
                    *costs(best),
                ]
            )
    return rows


def entries(point: Point) -> dict:
    """The attributes of a point for JSON: null for a memory that was not measured (NaN)."""
    return {name: None if value != value else value for name, value in asdict(point).items()}


# ---- Pictures


def draw(path, points, title: str, costs: dict[str, str], floor=1e-7) -> None:
    """Write a PNG with a row for each case: error against each cost.

    Both axes are logarithmic. Each method has its own colour and marker. The solid line is the
    median error, the band its quartiles, and the dashed line the rms error. A method with a single
    effort is one marker.

    Parameters
    ----------
    path : path-like
        File to write.
    points : list
        Measured points of all cases and methods.
    title : str
        Title of the picture.
    costs : dict of str to str
        Label of the axis by the field of the points, such as "seconds". A field that was measured
        for no point is left out.
    floor : float
        Smaller errors are drawn at this value.
    """
    cases = names(points, "case")
    costs = {field: label for field, label in costs.items() if any_measured(points, field)}
    size = 5.5 * len(costs), 1.2 + 3.1 * len(cases)
    with drawing(path, size, dpi=120, layout="constrained") as figure:
        styles = {
            method: {"color": colour(k), "marker": marker}
            for k, (method, marker) in enumerate(zip(names(points, "method"), cycle(MARKERS)))
        }
        rows = figure.subplots(len(cases), len(costs), sharey="row", squeeze=False)
        lines = {}
        for row, case in zip(rows, cases):
            for panel, (field, label) in zip(row, costs.items()):
                lines |= draw_curves(panel, points, case, field, styles, floor)
                panel.set_xlabel(label, fontsize=9)
            row[0].set_ylabel("relative error")
            row[0].set_title(plain(case), fontsize=10, loc="left")
        figure.suptitle(title, fontsize=11)
        figure.legend(
            lines.values(),
            lines.keys(),
            loc="outside lower center",
            ncols=3,
            fontsize=8,
            frameon=False,
        )


def any_measured(points, field: str) -> bool:
    """Whether a field of any point is a number above 0."""
    return any(getattr(p, field) > 0 for p in points)


def colour(k: int) -> str | tuple:
    """Colour of line number k: Matplotlib's ten colours, then their lighter variants."""
    import matplotlib

    return f"C{k}" if k < 10 else matplotlib.colormaps["tab20"](2 * (k % 10) + 1)


def draw_curves(panel, points, case: str, field: str, styles: dict, floor: float) -> dict:
    """Draw the error of one case against a field of the points, and return the lines by method.

    Parameters
    ----------
    panel : matplotlib.axes.Axes
        Axes to draw in.
    points : list
        Measured points of all cases and methods.
    case : str
        Name of the case.
    field : str
        Field of the points, such as "seconds".
    styles : dict of str to dict
        Colour and marker of each method.
    floor : float
        Smaller errors are drawn at this value.
    """
    from matplotlib.ticker import LogLocator

    lines = {}
    for method, style in styles.items():
        of_method = curve(points, case, method)
        if not of_method:
            continue
        x = [getattr(p, field) for p in of_method]
        low, error, high, rms = (
            np.maximum([getattr(p, name) for p in of_method], floor)
            for name in ("error_low", "error", "error_high", "rms")
        )
        (lines[method],) = panel.plot(x, error, linewidth=1.2, markersize=4, label=method, **style)
        if len(of_method) > 1:
            panel.fill_between(x, low, high, color=style["color"], alpha=0.13, linewidth=0)
            panel.plot(x, rms, color=style["color"], linewidth=0.8, linestyle="--")
        else:
            panel.vlines(x, low, high, color=style["color"], alpha=0.5)
    for tolerance in TOLERANCES:
        panel.axhline(tolerance, color="0.6", linewidth=0.6, linestyle=":")
    panel.set(xscale="log", yscale="log")
    panel.minorticks_off()  # drawing them takes longer than all the rest
    panel.yaxis.set_major_locator(LogLocator(numticks=12))
    return lines

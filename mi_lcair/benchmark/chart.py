"""Error against cost: what every chart of methods shares, from points to CSV and tables."""

import csv
import math
from dataclasses import astuple, dataclass, fields

import numpy as np

from mi_lcair.files import replacing

TOLERANCES = (0.05, 0.01, 0.001)


@dataclass(frozen=True)
class Point:
    """One method at one effort on one case.

    effort: what the method is asked for, in its own words (samples per dimension, rays, ...),
    rising. samples: evaluations of the BRDF, or rays. seconds: median of one run after the compile,
    which is apart in compile_seconds. error: median over repetitions of |value - exact| / exact,
    with its quartiles error_low and error_high. value: median. rms: root mean square of the
    relative error, which rare outliers raise and the median hides.
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


def point(case, method, effort, samples, seconds, compile_seconds, values, exact) -> Point:
    """The Point of repeated `values` (array, one per repetition) of a quantity whose exact value is
    `exact`.
    """
    errors = np.abs(np.asarray(values) - exact) / abs(exact)
    low, middle, high = np.quantile(errors, (0.25, 0.5, 0.75))
    return Point(
        case,
        method,
        effort,
        float(np.median(samples)),
        float(np.median(seconds)),
        float(compile_seconds),
        float(middle),
        float(low),
        float(high),
        float(np.median(values)),
        float(np.sqrt(np.mean(errors**2))),
    )


def curve(points, case: str, method: str) -> list[Point]:
    """The points of one method on one case, the least effort first."""
    return sorted(
        (p for p in points if (p.case, p.method) == (case, method)), key=lambda p: p.effort
    )


def names(points, field: str) -> list[str]:
    """The different values of "case" or "method", in order of appearance."""
    return list(dict.fromkeys(getattr(p, field) for p in points))


def reach(points, case: str, method: str, tolerance: float, by="error") -> Point | None:
    """The least effort from which on the error stays at or below `tolerance`, by its median or by
    "rms"; None if there is none.
    """
    reached = None
    for p in reversed(curve(points, case, method)):
        if not getattr(p, by) <= tolerance:
            break
        reached = p
    return reached


def cheapest(points, case: str, tolerance: float) -> Point | None:
    """Of all methods that `reach` the tolerance, the one that takes least time; None if there is
    none.
    """
    reached = filter(
        None, (reach(points, case, method, tolerance) for method in names(points, "method"))
    )
    return min(reached, key=lambda p: p.seconds, default=None)


# ---- files


def write_csv(path, points, remark: str) -> None:
    """A row for each point, columns as in `Point`, under a comment line."""
    with replacing(path) as partial, partial.open("w", encoding="utf-8", newline="") as file:
        file.write(f"# {remark}\n")
        rows = csv.writer(file, lineterminator="\n")
        rows.writerow(field.name for field in fields(Point))
        rows.writerows(
            [cell if isinstance(cell, str) else f"{cell:.6g}" for cell in astuple(p)]
            for p in points
        )


# ---- Markdown


def table(points, case: str, choice: str | None) -> str:
    """A Markdown table for one case: the cheapest method per tolerance, its factor over `choice`
    (the thesis's method), and the methods that never get there.
    """
    lines = [
        "| to reach | cheapest | samples | time | the thesis's choice takes | factor in time | in samples | never get there |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for tolerance in TOLERANCES:
        best, usual = (
            cheapest(points, case, tolerance),
            choice and reach(points, case, choice, tolerance),
        )
        missed = [
            method
            for method in names(points, "method")
            if curve(points, case, method) and not reach(points, case, method, tolerance)
        ]
        cells = [
            f"{tolerance:.1%}".replace(".0%", "%"),
            best.method if best else "none",
            *costs(best),
            ", ".join(costs(usual)) if usual else "never reaches it" if choice else "",
            *(factors(best, usual) if best and usual else ("", "")),
            "; ".join(missed),
        ]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def costs(p: Point | None) -> tuple[str, str]:
    """Samples and time of a point, as text."""
    return (digits(p.samples), duration(p.seconds)) if p else ("", "")


def factors(best: Point, usual: Point) -> tuple[str, str]:
    """How many times the time and the samples of `best` the point `usual` takes, as text."""
    return digits(usual.seconds / best.seconds), digits(usual.samples / best.samples)


def digits(number: float) -> str:
    """Two significant digits and no exponent: 0.52, 3.1, 12, 8 900, 250 000."""
    if number == 0 or not math.isfinite(number):
        return str(number)
    decimals = 1 - math.floor(math.log10(abs(number)))
    text = f"{round(number, decimals):,.{max(decimals, 0)}f}".replace(",", " ")
    return text.rstrip("0").rstrip(".") if "." in text else text


def duration(seconds: float) -> str:
    """A time with its unit, two digits."""
    for unit, size in (("s", 1), ("ms", 1e-3), ("µs", 1e-6)):
        if seconds >= size:
            return f"{digits(seconds / size)} {unit}"
    return f"{digits(seconds / 1e-9)} ns"

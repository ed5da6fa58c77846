"""Markdown tables of the charts of methods: which method is the fastest, and by how much."""

import math

from benchmarks.chart import (
    TOLERANCES,
    Point,
    cheapest,
    costs,
    curve,
    digits,
    names,
    percent,
    reach,
)


def seconds_to(points, case: str, method: str, tolerance: float) -> float | None:
    """Time in which a method reaches an rms error.

    Time and error are interpolated between measured efforts as powers of each other. The first
    effort of the two is the last whose error is above the tolerance.

    Parameters
    ----------
    points
        Points of any cases and methods.
    case, method
        Names of the case and of the method.
    tolerance
        Relative rms error.

    Returns
    -------
    float or None
        Time [s] after the compile, at least that of the least effort, or None if the method does
        not reach the error.
    """
    last = reach(points, case, method, tolerance)
    if last is None:
        return None
    before = [p for p in curve(points, case, method) if p.effort < last.effort]
    if not before or last.rms == 0:
        return last.seconds
    share = math.log(before[-1].rms / tolerance) / math.log(before[-1].rms / last.rms)
    return math.exp((1 - share) * math.log(before[-1].seconds) + share * math.log(last.seconds))


def fastest(points, case: str, methods, tolerance: float) -> tuple[str, float] | None:
    """Name and time [s] of the fastest of some methods to an rms error; None if none reaches it."""
    times = {method: seconds_to(points, case, method, tolerance) for method in methods}
    reached = {method: seconds for method, seconds in times.items() if seconds is not None}
    return min(reached.items(), key=lambda item: item[1], default=None)


def times_faster(points, case: str, methods, rivals, tolerance: float) -> str:
    """How many times faster the fastest of `methods` is than the fastest of `rivals`, as text.

    It is "-" if none of `methods` reaches the rms error or if there are no rivals on this case. If
    no rival reaches the error, it is a lower bound from the longest run of a rival, such as
    "> 12".
    """
    ours, theirs = (fastest(points, case, group, tolerance) for group in (methods, rivals))
    tried = [p.seconds for p in points if p.case == case and p.method in rivals]
    if ours is None or not tried:
        return "-"
    if theirs is None:
        return f"> {digits(max(tried) / ours[1])}"
    return digits(theirs[1] / ours[1])


def table(points, case: str, choice: str | None, limit: str = "") -> str:
    """A Markdown table for one case, with a row for each tolerance of the rms error.

    A row names the cheapest method, its advantage over the thesis's method, and the methods that
    do not reach the tolerance.

    Parameters
    ----------
    points
        Points of any cases and methods.
    case
        Name of the case.
    choice
        Name of the thesis's method; None if there is none.
    limit
        Limit of the efforts that were tried, in words, such as " within 0.2 s".

    Returns
    -------
    str
        The table.
    """
    lines = [
        "| rms error | cheapest | samples | time | the thesis's choice takes | factor in time "
        f"| in samples | do not reach it{limit} |",
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
            percent(tolerance),
            best.method if best else "none",
            *costs(best),
            ", ".join(costs(usual)) if usual else f"does not reach it{limit}" if choice else "",
            *(factors(best, usual) if best and usual else ("", "")),
            "; ".join(missed),
        ]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def factors(best: Point, usual: Point) -> tuple[str, str]:
    """Ratios usual / best of time and of samples, as text."""
    return digits(usual.seconds / best.seconds), digits(usual.samples / best.samples)

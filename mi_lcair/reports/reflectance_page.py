"""Page of the chart of reflectance integrals: picture, CSV and Markdown."""

from pathlib import Path

import drjit as dr
import numpy as np

from mi_lcair.benchmark import chart
from mi_lcair.benchmark.chart import digits, duration
from mi_lcair.benchmark.reflectance import METHODS, half_vector, lattice, sobol
from mi_lcair.benchmark.reflectance_chart import (
    CHOICE,
    FULL,
    OURS,
    QUICK,
    THESIS_EFFORTS,
    THETA_DEG,
    angle_errors,
    seconds_alone,
)
from mi_lcair.reports import method_chart

OUR_METHODS = half_vector.method, sobol.method, lattice.method
TEMPLATE = Path(__file__).with_name("reflectance_page.template.md")


def write(folder, points, quick: bool) -> None:
    """Write reflectance.png, reflectance.csv and reflectance.md to a folder."""
    folder = Path(folder)
    title = (
        f"Reflectance DHR({THETA_DEG}°) by eight methods: median error, quartiles, and rms (dashed)"
    )
    method_chart.draw(folder / "reflectance.png", points, title, samples="evaluations of the BRDF")
    chart.write_csv(folder / "reflectance.csv", points)
    (folder / "reflectance.md").write_text(page(points, quick), encoding="utf-8")


def page(points, quick: bool) -> str:
    """The Markdown page: the template, filled from the points."""
    cases = chart.names(points, "case")
    fields = {
        "theta": THETA_DEG,
        "command": "mi-lcair chart reflectance" + (" --quick" if quick else ""),
        "threads": dr.thread_count(),
        **{name: (QUICK if quick else FULL)[name] for name in ("repetitions", "lanes")},
        "needs": "\n".join(needs_row(points, case) for case in cases),
        "factors": "\n".join(
            factor_row(points, case, method) for case in cases for method in THESIS_EFFORTS
        ),
        "faster": "\n".join(
            faster_row(points, case, tolerance)
            for case in cases
            for tolerance in chart.TOLERANCES[1:]
        ),
        "reach": reach_rows(points, cases[0]),
        "tables": "\n\n".join(
            f"**{case}**\n\n{chart.table(points, case, CHOICE.name)}" for case in cases
        ),
        "angles": angle_rows(),
        "launches": launch_rows(points),
    }
    return TEMPLATE.read_text(encoding="utf-8").format(**fields)


def needs_row(points, case: str) -> str:
    """Row: samples of our method for 1 % and 0.1 %, by the median and by the rms error."""
    reached = [
        chart.reach(points, case, OURS.name, tolerance, by)
        for tolerance in (0.01, 0.001)
        for by in ("error", "rms")
    ]
    return f"| {case} | {' | '.join(digits(p.samples) if p else 'never' for p in reached)} |"


def factor_row(points, case: str, method) -> str:
    """Row: a setting of the thesis, and its samples and time relative to those of our method.

    Our method is taken at an rms error of 1 %, of 0.1 %, and of the setting itself.
    """
    theirs = next(
        p
        for p in points
        if (p.case, p.method, p.effort) == (case, method.name, THESIS_EFFORTS[method])
    )
    cells = [
        case,
        method.name,
        digits(theirs.samples),
        percent(theirs.rms),
        duration(theirs.seconds),
    ]
    for tolerance in (0.01, 0.001, theirs.rms):
        ours = chart.reach(points, case, OURS.name, tolerance)
        time_factor, samples_factor = chart.factors(ours, theirs) if ours else ("", "")
        cells.append(f"{samples_factor}, {time_factor}" if ours else "ours never reaches it")
    return f"| {' | '.join(cells)} |"


def faster_row(points, case: str, tolerance: float) -> str:
    """Row: the thesis's fastest method to an rms error, and how many times faster ours are."""
    thesis = [method.name for method in METHODS if method.section]
    best = chart.fastest(points, case, thesis, tolerance)
    cells = [f"{best[0]} ({duration(best[1])})" if best else "none reaches it"]
    cells += [
        chart.times_faster(points, case, [method.name], thesis, tolerance) for method in OUR_METHODS
    ]
    return f"| {case} | {chart.percent(tolerance)} | {' | '.join(cells)} |"


def reach_rows(points, case: str) -> str:
    """Rows: the settings of the thesis, ours with few samples, and the others at full effort."""
    efforts = {
        method.name: {chart.curve(points, case, method.name)[-1].effort} for method in METHODS
    }
    efforts |= {method.name: {effort} for method, effort in THESIS_EFFORTS.items()}
    efforts |= {method.name: {1, 4, 64} for method in OUR_METHODS}
    return "\n".join(
        f"| {p.method} | {digits(p.samples)} | {percent(p.error)} | {percent(p.rms)} | "
        f"{duration(p.seconds)} |"
        for p in points
        if p.case == case and p.effort in efforts[p.method]
    )


def angle_rows() -> str:
    """Rows: errors at other angles, signed if all repetitions agree, otherwise rms."""
    rows = []
    for material, theta_deg, exact, errors in angle_errors():
        cells = [
            f"{100 * e[0]:+.2g} %" if np.ptp(e) < 1e-9 else percent(np.sqrt(np.mean(e**2)))
            for e in errors
        ]
        rows.append(f"| {material} | {theta_deg} | {exact:.5f} | {' | '.join(cells)} |")
    return "\n".join(rows)


def launch_rows(points) -> str:
    """Rows: the longest compilation of each method, and the time of a single integral.

    The integral is launched alone, at the least effort.
    """
    alone = seconds_alone()
    rows = []
    for method in METHODS:
        compile_seconds = max(
            point.compile_seconds for point in points if point.method == method.name
        )
        samples = digits(method.samples(method.efforts[0]))
        rows.append(
            f"| {method.name} | {duration(compile_seconds)} | {samples} | "
            f"{duration(alone[method.name])} |"
        )
    return "\n".join(rows)


def percent(fraction: float) -> str:
    """A fraction in percent."""
    return f"{digits(100 * fraction)} %" if fraction > 1e-9 else "0"

"""Write the page docs/validation/charts/reflectance.md: integrals of the BRDF.

    python -m docs.studies.reflectance [--quick] [FOLDER]

It measures as `python -m benchmarks.reflectance` does and writes the same picture and CSV beside
the page, and measures a few settings at other angles. The text is reflectance.template.md, whose
{fields} are filled in.
"""

import sys
from pathlib import Path

import drjit as dr
import numpy as np

from benchmarks import chart
from benchmarks import reflectance as benchmark
from benchmarks.chart import digits, duration
from benchmarks.methods.reflectance import (
    METHODS,
    half_vector,
    lattice,
    sobol,
    stratified_quadrature,
    uniform_quadrature,
)
from benchmarks.reflectance import FULL, MATERIALS, QUICK, THETA_DEG, named_problem, timed
from docs.studies.method_tables import factors, fastest, table, times_faster
from docs.studies.page import write_page

OUR_METHODS = half_vector.method, sobol.method, lattice.method
CHOICE = stratified_quadrature.method  # the thesis's choice, with 80^2 + 50^2 samples (3.3.3)
UNIFORM, OURS = uniform_quadrature.method, sobol.method
THESIS_EFFORTS = {UNIFORM: 500, CHOICE: 80}  # the efforts that the thesis uses
# Methods and efforts that are compared at other angles.
SETTINGS = [(CHOICE, 80), (UNIFORM, 500), (OURS, 64), (OURS, 1024)]
OTHER_ANGLES_DEG = (0, 30, 60, 75, 85)
# Materials that are also measured at other angles. Their results in the other band are similar.
OTHER_ANGLES_MATERIALS = MATERIALS[0], MATERIALS[2]


def main(folder: str = "docs/validation/charts", quick: bool = False) -> None:
    """Measure all methods, and write the page with its picture and CSV."""
    write(Path(folder), benchmark.measure(quick), quick)


def write(folder: Path, points, quick: bool) -> None:
    """Write reflectance.png, reflectance.csv and reflectance.md to a folder."""
    benchmark.write(folder, points)
    write_page(folder / "reflectance.md", "reflectance", **fields(points, quick))


def fields(points, quick: bool) -> dict[str, object]:
    """The fields of the page's template."""
    cases, work = chart.names(points, "case"), QUICK if quick else FULL
    return {
        "theta": THETA_DEG,
        "command": "python -m docs.studies.reflectance" + (" --quick" if quick else ""),
        "threads": dr.thread_count(),
        "repetitions": work.repetitions,
        "lanes": work.lanes,
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
            f"**{case}**\n\n{table(points, case, CHOICE.name)}" for case in cases
        ),
        "angles": angle_rows(),
        "launches": launch_rows(points),
    }


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
        time_factor, samples_factor = factors(ours, theirs) if ours else ("", "")
        cells.append(f"{samples_factor}, {time_factor}" if ours else "ours never reaches it")
    return f"| {' | '.join(cells)} |"


def faster_row(points, case: str, tolerance: float) -> str:
    """Row: the thesis's fastest method to an rms error, and how many times faster ours are."""
    thesis = [method.name for method in METHODS if method.section]
    best = fastest(points, case, thesis, tolerance)
    cells = [f"{best[0]} ({duration(best[1])})" if best else "none reaches it"]
    cells += [
        times_faster(points, case, [method.name], thesis, tolerance) for method in OUR_METHODS
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


def angle_errors() -> list[tuple[str, int, float, list[np.ndarray]]]:
    """Relative errors of all SETTINGS at other angles.

    Returns a row for each material and angle: material and band, angle [degrees], exact
    reflectance, and for each of SETTINGS the errors of its repetitions.
    """
    rows = []
    for name, band_name in OTHER_ANGLES_MATERIALS:
        for theta_deg in OTHER_ANGLES_DEG:
            p = named_problem(name, band_name, theta_deg)
            exact = p.exact()
            errors = [
                method.run(p, effort, max(16, 2**20 // method.samples(effort)), 0).numpy() / exact
                - 1
                for method, effort in SETTINGS
            ]
            rows.append((f"{name} {band_name}", theta_deg, exact, errors))
    return rows


def seconds_alone() -> dict[str, float]:
    """Time [s] of a single integral in a launch of its own, at the least effort of each method."""
    p = named_problem(*MATERIALS[0])
    return {
        method.name: float(
            np.median([timed(method, p, method.efforts[0], 1, seed)[1] for seed in range(8)][1:])
        )
        for method in METHODS
    }


if __name__ == "__main__":
    main(*[word for word in sys.argv[1:] if word != "--quick"], quick="--quick" in sys.argv)

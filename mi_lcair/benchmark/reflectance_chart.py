"""The chart of reflectance integrals: Figures 3.15 and 3.17-3.20 of the thesis on one page, for
each of its materials.
"""

import math
import time
from pathlib import Path

import drjit as dr
import numpy as np

import mi_lcair
from mi_lcair.benchmark import chart
from mi_lcair.benchmark.chart import Point, digits, duration
from mi_lcair.benchmark.reflectance import (
    METHODS,
    half_vector,
    problem,
    sobol,
    stratified_quadrature,
    uniform_quadrature,
)
from mi_lcair.physics.bands import band
from mi_lcair.physics.materials import material

THETA_DEG = 30
OTHER_ANGLES_DEG = (0, 30, 60, 75, 85)
MATERIALS = [
    ("bare_aluminum", "MWIR"),
    ("bare_aluminum", "LWIR"),
    ("gloss_black", "MWIR"),
    ("gloss_black", "LWIR"),
    ("ir_range_wall", "MWIR"),
]
OTHER_ANGLES_MATERIALS = MATERIALS[0], MATERIALS[2]  # the other band differs little
CHOICE = stratified_quadrature.method  # the thesis's, 80^2 + 50^2 samples (3.3.3)
UNIFORM, OURS = uniform_quadrature.method, sobol.method
THESIS_EFFORTS = {UNIFORM: 500, CHOICE: 80}
FULL = {"lanes": 2**20, "repetitions": 64, "launches": 5}
QUICK = {"lanes": 2**17, "repetitions": 16, "launches": 3}
MOST_SAMPLES_IF_QUICK = 300_000
TEMPLATE = Path(__file__).with_name("reflectance_chart.template.md")


def measure(quick: bool = False, progress=None) -> list[Point]:
    """All methods at all their efforts (quick: every second) on all materials; progress(done,
    total).
    """
    tasks = [
        (names, method, effort)
        for names in MATERIALS
        for method in METHODS
        for effort in (method.efforts[::2] if quick else method.efforts)
        if not quick or method.samples(effort) <= MOST_SAMPLES_IF_QUICK
    ]
    problems = {names: named_problem(*names) for names in MATERIALS}
    exact = {names: p.exact() for names, p in problems.items()}
    points = []
    for names, method, effort in tasks:
        points.append(
            measured(
                " ".join(names),
                method,
                effort,
                problems[names],
                exact[names],
                **(QUICK if quick else FULL),
            )
        )
        if progress:
            progress(len(points), len(tasks))
    return points


def named_problem(name, band_name, theta_deg=THETA_DEG):
    found = material(name, band(band_name))
    return problem(*found.values, theta_deg, found.form)


def measured(case, method, effort, p, exact, lanes, repetitions, launches) -> Point:
    """Repetitions run side by side, about `lanes` samples a launch, and the time is shared out
    among them: a renderer, too, asks for many integrals at once, and a launch alone costs as much
    as 10^4 samples. The first launch compiles.
    """
    samples = method.samples(effort)
    batch = max(1, lanes // samples)
    values, seconds = zip(
        *(
            timed(method, p, effort, batch, seed)
            for seed in range(1 + max(launches, math.ceil(repetitions / batch)))
        )
    )
    once = float(np.median(seconds[1:]))
    return chart.point(
        case,
        method.name,
        effort,
        samples,
        once / batch,
        max(0.0, seconds[0] - once),
        np.concatenate(values[1:]),
        exact,
    )


def timed(method, p, effort, batch, seed):
    dr.sync_thread()
    start = time.perf_counter()
    found = method.run(p, effort, batch, seed)
    dr.eval(found)
    dr.sync_thread()
    return found.numpy(), time.perf_counter() - start


# ---- the page


def write(folder, points, quick: bool) -> None:
    """reflectance.png, reflectance.csv and reflectance.md in `folder`."""
    folder = Path(folder)
    title = (
        f"Reflectance DHR({THETA_DEG}°) by seven methods: median error, quartiles, and rms (dashed)"
    )
    chart.draw(folder / "reflectance.png", points, title, samples="evaluations of the BRDF")
    chart.write_csv(
        folder / "reflectance.csv",
        points,
        f"DHR at {THETA_DEG} degrees by method and effort, relative errors, seconds; mi_lcair {mi_lcair.__version__}",
    )
    (folder / "reflectance.md").write_text(page(points, quick))


def page(points, quick: bool) -> str:
    """The Markdown page: the template with its fields filled from the points."""
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
        "reach": reach_rows(points, cases[0]),
        "tables": "\n\n".join(
            f"**{case}**\n\n{chart.table(points, case, CHOICE.name)}" for case in cases
        ),
        "angles": angle_rows(),
        "launches": launch_rows(points),
    }
    return TEMPLATE.read_text().format(**fields)


def needs_row(points, case: str) -> str:
    """Samples that ours needs for 1 % and 0.1 %, by the median and by the rms error."""
    found = [
        chart.reach(points, case, OURS.name, tolerance, by)
        for tolerance in (0.01, 0.001)
        for by in ("error", "rms")
    ]
    return f"| {case} | {' | '.join(digits(p.samples) if p else 'never' for p in found)} |"


def factor_row(points, case: str, method) -> str:
    """One of the thesis's settings, and how many times the samples and the time of ours it takes,
    by the rms error of ours: at 1 %, at 0.1 % and at the error that the setting itself has.
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
        ours = chart.reach(points, case, OURS.name, tolerance, by="rms")
        time_factor, samples_factor = chart.factors(ours, theirs) if ours else ("", "")
        cells.append(f"{samples_factor}, {time_factor}" if ours else "ours never reaches it")
    return f"| {' | '.join(cells)} |"


def reach_rows(points, case: str) -> str:
    """The thesis's settings, ours with few samples, and the largest effort of each random method."""
    shown = {method.name: {chart.curve(points, case, method.name)[-1].effort} for method in METHODS}
    shown |= {method.name: {effort} for method, effort in THESIS_EFFORTS.items()}
    shown |= {method.name: {1, 4, 64} for method in (half_vector.method, sobol.method)}
    return "\n".join(
        f"| {p.method} | {digits(p.samples)} | {percent(p.error)} | {percent(p.rms)} | {duration(p.seconds)} |"
        for p in points
        if p.case == case and p.effort in shown[p.method]
    )


def angle_rows() -> str:
    """Relative errors of the thesis's settings and of ours at other angles: signed if all
    repetitions agree, else rms.
    """
    settings = [(CHOICE, 80), (UNIFORM, 500), (OURS, 64), (OURS, 1024)]
    rows = []
    for name, band_name in OTHER_ANGLES_MATERIALS:
        for theta_deg in OTHER_ANGLES_DEG:
            p = named_problem(name, band_name, theta_deg)
            exact = p.exact()
            errors = [
                method.run(p, effort, max(16, 2**20 // method.samples(effort)), 0).numpy() / exact
                - 1
                for method, effort in settings
            ]
            cells = [
                f"{100 * e[0]:+.2g} %" if np.ptp(e) < 1e-9 else percent(np.sqrt(np.mean(e**2)))
                for e in errors
            ]
            rows.append(f"| {name} {band_name} | {theta_deg} | {exact:.5f} | {' | '.join(cells)} |")
    return "\n".join(rows)


def launch_rows(points) -> str:
    """Per method: the longest compile, and the time of a single integral at the least effort,
    launched alone.
    """
    p = named_problem(*MATERIALS[0])
    rows = []
    for method in METHODS:
        compile_seconds = max(
            point.compile_seconds for point in points if point.method == method.name
        )
        alone = np.median(
            [timed(method, p, method.efforts[0], 1, seed)[1] for seed in range(8)][1:]
        )
        rows.append(
            f"| {method.name} | {duration(compile_seconds)} | {digits(method.samples(method.efforts[0]))} | {duration(alone)} |"
        )
    return "\n".join(rows)


def percent(fraction: float) -> str:
    return f"{digits(100 * fraction)} %" if fraction > 1e-9 else "0"

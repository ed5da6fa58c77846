"""The chart of reflectance integrals: Figures 3.15 and 3.17-3.20 of the thesis on one page, for
each of its materials.
"""

import math
import time

import drjit as dr
import numpy as np

from mi_lcair.benchmark import chart
from mi_lcair.benchmark.chart import Point
from mi_lcair.benchmark.reflectance import (
    METHODS,
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
SETTINGS = [(CHOICE, 80), (UNIFORM, 500), (OURS, 64), (OURS, 1024)]  # at other angles
FULL = {"lanes": 2**20, "repetitions": 64, "launches": 5}
QUICK = {"lanes": 2**17, "repetitions": 16, "launches": 3}
MOST_SAMPLES_IF_QUICK = 300_000


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


def angle_errors() -> list[tuple[str, int, float, list[np.ndarray]]]:
    """Relative errors of the thesis's settings and of ours at other angles, of each repetition.

    A row for each material and angle: material and band, angle in degrees, exact reflectance, and
    the errors of each of SETTINGS.
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
    """The time of a single integral at the least effort of each method, launched alone."""
    p = named_problem(*MATERIALS[0])
    return {
        method.name: float(
            np.median([timed(method, p, method.efforts[0], 1, seed)[1] for seed in range(8)][1:])
        )
        for method in METHODS
    }

"""Measurements for the chart of reflectance integrals.

The chart shows Figures 3.15 and 3.17-3.20 of the thesis on one page for each of its materials.
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

THETA_DEG = 30  # angle of incidence in the main charts [degrees]
OTHER_ANGLES_DEG = (0, 30, 60, 75, 85)
MATERIALS = [
    ("bare_aluminum", "MWIR"),
    ("bare_aluminum", "LWIR"),
    ("gloss_black", "MWIR"),
    ("gloss_black", "LWIR"),
    ("ir_range_wall", "MWIR"),
]
# Materials that are also measured at other angles. Their results in the other band are similar.
OTHER_ANGLES_MATERIALS = MATERIALS[0], MATERIALS[2]
CHOICE = stratified_quadrature.method  # the thesis's choice, with 80^2 + 50^2 samples (3.3.3)
UNIFORM, OURS = uniform_quadrature.method, sobol.method
THESIS_EFFORTS = {UNIFORM: 500, CHOICE: 80}  # the efforts that the thesis uses
# Methods and efforts that are compared at other angles.
SETTINGS = [(CHOICE, 80), (UNIFORM, 500), (OURS, 64), (OURS, 1024)]
# The amount of work: samples of a launch, least number of repetitions, and least number of
# launches.
FULL = {"lanes": 2**20, "repetitions": 64, "launches": 5}
QUICK = {"lanes": 2**17, "repetitions": 16, "launches": 3}
MOST_SAMPLES_IF_QUICK = 300_000


def measure(quick: bool = False, progress=None) -> list[Point]:
    """Measure all methods at all their efforts on all materials.

    quick: whether to measure only every second effort, with less work. progress: function of (steps
    done, steps in total).
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
    """The reflectance integral of a material in a band at an angle [degrees]."""
    entry = material(name, band(band_name))
    return problem(*entry.values, theta_deg, entry.form)


def measured(case, method, effort, p, exact, lanes, repetitions, launches) -> Point:
    """The Point of one method at one effort.

    A launch computes many repetitions in parallel, about `lanes` samples in all. Its time is
    divided by the number of repetitions, because a renderer also computes many integrals at once,
    and a single launch costs as much as 10^4 samples. The first launch includes the compile and is
    left out.

    Parameters
    ----------
    case
        Name of the case.
    method, effort
        The method and its effort.
    p
        The reflectance integral.
    exact
        Its exact value.
    lanes, repetitions, launches
        As in `FULL`.

    Returns
    -------
    Point
        Error and time.
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
    """Values (batch,) and seconds of one launch."""
    dr.sync_thread()
    start = time.perf_counter()
    values = method.run(p, effort, batch, seed)
    dr.eval(values)
    dr.sync_thread()
    return values.numpy(), time.perf_counter() - start


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

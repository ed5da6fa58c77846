"""Compare eight methods that integrate a BRDF over the hemisphere.

    python -m benchmarks.reflectance [--quick] [-o FOLDER]

The chart shows Figures 3.15 and 3.17-3.20 of the thesis on one page for each of its materials.
Printed and written are relative rms errors against samples and time in s.
"""

import math
import time
from functools import lru_cache, partial
from pathlib import Path
from typing import NamedTuple

import drjit as dr
import numpy as np

from benchmarks import chart, command
from benchmarks.chart import Point
from benchmarks.methods.reflectance import METHODS, ReflectanceProblem, problem
from mi_lcair.physics.bands import band
from mi_lcair.physics.materials import material
from mi_lcair.tasks import in_order

THETA_DEG = 30  # angle of incidence in the main charts [degrees]
MATERIALS = [
    ("bare_aluminum", "MWIR"),
    ("bare_aluminum", "LWIR"),
    ("gloss_black", "MWIR"),
    ("gloss_black", "LWIR"),
    ("ir_range_wall", "MWIR"),
]


class Work(NamedTuple):
    """Samples of a launch, and the least numbers of repetitions and of launches."""

    lanes: int
    repetitions: int
    launches: int


FULL, QUICK = Work(2**20, 64, 5), Work(2**17, 16, 3)
MOST_SAMPLES_IF_QUICK = 300_000


def measure(quick: bool = False, progress=None) -> list[Point]:
    """Measure all methods at all their efforts on all materials.

    quick: whether to measure only every second effort, with less work. progress: function of (steps
    done, steps in total).
    """
    tasks = [
        partial(point_of, names, number, effort, quick)
        for names in MATERIALS
        for number, method in enumerate(METHODS)
        for effort in (method.efforts[::2] if quick else method.efforts)
        if not quick or method.samples(effort) <= MOST_SAMPLES_IF_QUICK
    ]
    points = []
    for point in in_order(tasks):
        points.append(point)
        if progress:
            progress(len(points), len(tasks))
    return points


def point_of(names: tuple[str, str], number: int, effort: int, quick: bool) -> Point:
    """The Point of one of the METHODS on a material in a band."""
    problem, exact = known(names)
    work = QUICK if quick else FULL
    return measured(" ".join(names), METHODS[number], effort, problem, exact, work)


@lru_cache
def known(names: tuple[str, str]) -> tuple[ReflectanceProblem, float]:
    """The reflectance integral of a material in a band, and its exact value."""
    problem = named_problem(*names)
    return problem, problem.exact()


def named_problem(name, band_name, theta_deg=THETA_DEG):
    """The reflectance integral of a material in a band at an angle [degrees]."""
    entry = material(name, band(band_name))
    if entry.model.name == "grey":  # as a Sandford-Robertson surface without a lobe
        (emissivity,) = entry.values
        return problem(emissivity, 1 - emissivity, 0.0, 1.0, theta_deg)
    return problem(*entry.values, theta_deg, entry.form)


def measured(case, method, effort, p, exact, work: Work) -> Point:
    """The Point of one method at one effort.

    A launch computes many repetitions in parallel, about `work.lanes` samples in all. Its time is
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
    work

    Returns
    -------
    Point
        Error and time.
    """
    samples = method.samples(effort)
    batch = max(1, work.lanes // samples)
    launches = 1 + max(work.launches, math.ceil(work.repetitions / batch))
    values, seconds = zip(*(timed(method, p, effort, batch, seed) for seed in range(launches)))
    once = float(np.median(seconds[1:]))
    cost = chart.Cost(samples, once / batch, max(0.0, seconds[0] - once))
    return chart.point(case, method.name, effort, cost, np.concatenate(values[1:]), exact)


def timed(method, p, effort, batch, seed):
    """Values (batch,) and seconds of one launch."""
    dr.sync_thread()
    start = time.perf_counter()
    values = method.run(p, effort, batch, seed)
    dr.eval(values)
    dr.sync_thread()
    return values.numpy(), time.perf_counter() - start


def write(folder: Path, points: list[Point]) -> None:
    """Write reflectance.png and reflectance.csv to a folder."""
    title = (
        f"Reflectance DHR({THETA_DEG}°) by eight methods: median error, quartiles, and rms (dashed)"
    )
    costs = chart.TIME | {"samples": "evaluations of the BRDF"}
    chart.draw(folder / "reflectance.png", points, title, costs)
    chart.write_csv(folder / "reflectance.csv", points)


def printed(points: list[Point]) -> tuple:
    """JSON and table of the points."""
    data = {"points": list(map(chart.entries, points))}
    return data, chart.cheapest_table(points, "case", "samples")


def main(arguments: list[str] | None = None) -> None:
    """Measure, write the files and print a table."""
    command.run("reflectance", __doc__, measure, write, printed, arguments)


if __name__ == "__main__":
    main()

"""The chart of propagation methods: error against time and rays, and what stands in for the bounces
that are left out.
"""

import time
from dataclasses import dataclass

import drjit as dr
import numpy as np

from mi_lcair.benchmark import chart
from mi_lcair.benchmark.propagation import METHODS, exact, path_tracing, problems
from mi_lcair.benchmark.propagation.problem import Method, Problem
from mi_lcair.progress import stepper

CHOICE = "quadrature, stratified"  # the thesis's method of choice, 3.5.5
CLOSURES = [(bounces, "none") for bounces in (0, 1, 2, 3, 4)] + [(1, "ambient"), (2, "tail")]


@dataclass(frozen=True)
class Effort:
    """How much a chart takes on. seconds: a method whose run takes longer is not asked for more;
    repetitions: of random methods, and of those that give the same answer each time; spp, seeds:
    for the closures; most: no method is asked for a larger effort.
    """

    seconds: float
    most: int
    repetitions: int
    same: int
    spp: int
    seeds: int


FULL, QUICK = Effort(0.2, 4**12, 7, 3, 64, 4), Effort(0.02, 4**10, 3, 1, 4, 2)


@dataclass(frozen=True)
class Closure:
    """Paths cut after `bounces` reflections with what stands in for the rest: signed relative error
    of the intensity, the standard error of that, and the case, whose opening is a share of the
    sphere (None where it is no cavity).
    """

    case: str
    opening: float | None
    bounces: int
    closure: str
    error: float
    standard_error: float


@dataclass(frozen=True)
class Chart:
    problems: list[Problem]
    points: list[chart.Point]
    closures: list[Closure]
    quick: bool


def measure(quick: bool = False, progress=None) -> Chart:
    """All methods on all problems. progress: called with (steps done, total)."""
    effort = QUICK if quick else FULL
    total = 6 * len(METHODS) + len(exact.CAVITY_BLOCKS) + 3
    step = stepper(progress, total)
    points, closures, cases = [], [], problems.all_problems(quick)
    for problem in cases:
        for method in METHODS:
            points += curve(problem, method, effort)
            step()
    cavities = [problems.cavity(opening) for opening in exact.CAVITY_BLOCKS]
    for opening, problem in zip(exact.CAVITY_BLOCKS, cavities):
        closures += closed(
            problem,
            f"cavity, {opening} facets removed",
            exact.cavity_opening_fraction(opening),
            effort,
        )
        step()
    for problem in cases[3:]:
        closures += closed(problem, problem.name, None, effort)
        step()
    return Chart(cases, points, closures, quick)


def curve(problem: Problem, method: Method, effort: Effort) -> list[chart.Point]:
    """A method's points on one problem, from its least effort up to the first that takes too long."""
    found = []
    for asked in (asked for asked in method.efforts(problem) if asked <= effort.most):
        first, _, _ = timed(problem, method, asked, 0)
        runs = [
            timed(problem, method, asked, seed + 1)
            for seed in range(effort.repetitions if method.is_random else effort.same)
        ]
        seconds, values, rays = (np.array(column) for column in zip(*runs))
        median = float(np.median(seconds))
        found.append(
            chart.point(
                problem.name,
                method.name,
                asked,
                rays,
                seconds,
                max(0.0, first - median),
                values,
                problem.answer,
            )
        )
        if median > effort.seconds:
            break
    return found


def timed(problem: Problem, method: Method, effort: int, seed: int) -> tuple[float, float, int]:
    """Seconds, intensity and rays of one run."""
    dr.sync_thread()
    start = time.perf_counter()
    value, rays = method.run(problem, effort, seed)
    return time.perf_counter() - start, value, rays


def closed(problem: Problem, case: str, opening: float | None, effort: Effort) -> list[Closure]:
    """Every bounce limit and closure on one problem."""
    found = []
    for bounces, closure in CLOSURES:
        values = [
            path_tracing.intensity(problem, effort.spp, seed, bounces, closure=closure)[0]
            / problem.answer
            - 1
            for seed in range(effort.seeds)
        ]
        found.append(
            Closure(
                case,
                opening,
                bounces,
                closure,
                float(np.mean(values)),
                float(np.std(values, ddof=1) / np.sqrt(len(values))),
            )
        )
    return found

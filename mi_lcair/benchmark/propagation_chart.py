"""Measurements for the chart of propagation methods.

They are the error of each method against time and rays, and the error of each closure, which
replaces the bounces that are left out.
"""

import time
from dataclasses import dataclass

import drjit as dr
import numpy as np

from mi_lcair.benchmark import chart
from mi_lcair.benchmark.propagation import METHODS, exact, path_tracing, problems
from mi_lcair.benchmark.propagation.problem import Method, Problem
from mi_lcair.progress import stepper

CHOICE = "quadrature, stratified"  # the method that the thesis chooses (3.5.5)
# Pairs of the number of bounces and the closure.
CLOSURES = [(bounces, "none") for bounces in (0, 1, 2, 3, 4)] + [(1, "ambient"), (2, "tail")]


@dataclass(frozen=True)
class Effort:
    """The amount of work for a chart.

    Attributes
    ----------
    seconds
        Time of a run after which the effort of a method is not raised further [s].
    most
        Largest effort of a method.
    repetitions
        Runs of random methods.
    same
        Runs of methods that give the same answer each time.
    spp, seeds
        Samples for each pixel and number of runs of a closure.
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
    """Error of the intensity if paths end after a number of bounces.

    Attributes
    ----------
    case
        Name of the case.
    opening
        Share of the sphere that is open; None if the case is no cavity.
    bounces
        Reflections after which paths end.
    closure
        Name of the estimate of the remaining radiance, or "none".
    error, standard_error
        Signed relative error of the intensity, and its standard error.
    """

    case: str
    opening: float | None
    bounces: int
    closure: str
    error: float
    standard_error: float


@dataclass(frozen=True)
class Chart:
    """The results: problems, points of all methods, closures, and whether the run was quick."""

    problems: list[Problem]
    points: list[chart.Point]
    closures: list[Closure]
    quick: bool


def measure(quick: bool = False, progress=None) -> Chart:
    """Measure all methods on all problems.

    quick: whether to do less work. progress: function of (steps done, steps in total).
    """
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
    """A method's points on one problem, by rising effort, up to the first slow run."""
    points = []
    for level in (level for level in method.efforts(problem) if level <= effort.most):
        first, _, _ = timed(problem, method, level, 0)  # this run includes the compile
        runs = [
            timed(problem, method, level, seed + 1)
            for seed in range(effort.repetitions if method.is_random else effort.same)
        ]
        seconds, values, rays = (np.array(column) for column in zip(*runs))
        median = float(np.median(seconds))
        points.append(
            chart.point(
                problem.name,
                method.name,
                level,
                rays,
                seconds,
                max(0.0, first - median),
                values,
                problem.answer,
            )
        )
        if median > effort.seconds:
            break
    return points


def timed(problem: Problem, method: Method, effort: int, seed: int) -> tuple[float, float, int]:
    """Seconds, intensity and rays of one run."""
    dr.sync_thread()
    start = time.perf_counter()
    value, rays = method.run(problem, effort, seed)
    return time.perf_counter() - start, value, rays


def closed(problem: Problem, case: str, opening: float | None, effort: Effort) -> list[Closure]:
    """The errors of every bounce limit and closure on one problem."""
    closures = []
    for bounces, closure in CLOSURES:
        values = [
            path_tracing.intensity(problem, effort.spp, seed, bounces, closure=closure)[0]
            / problem.answer
            - 1
            for seed in range(effort.seeds)
        ]
        closures.append(
            Closure(
                case,
                opening,
                bounces,
                closure,
                float(np.mean(values)),
                float(np.std(values, ddof=1) / np.sqrt(len(values))),
            )
        )
    return closures

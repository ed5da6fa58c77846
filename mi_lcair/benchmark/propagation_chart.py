"""Measurements for the chart of propagation methods.

They are the error of each method against time, rays and memory, and the error of each closure,
which replaces the bounces that are left out.
"""

import time
from dataclasses import dataclass, replace
from functools import partial

import drjit as dr
import numpy as np

from mi_lcair.benchmark import chart
from mi_lcair.benchmark.memory import peak_memory
from mi_lcair.benchmark.propagation import METHODS, exact, path_tracing, problems
from mi_lcair.benchmark.propagation.problem import Method, Problem
from mi_lcair.progress import stepper
from mi_lcair.startup.tasks import in_order

MOST_SECONDS, LEAST_REPETITIONS = 1.5, 5
# Pairs of the number of bounces and the closure.
CLOSURES = [(bounces, "none") for bounces in (0, 1, 2, 3, 4)] + [(1, "ambient"), (2, "tail")]


@dataclass(frozen=True)
class Effort:
    """The amount of work for a chart.

    Attributes
    ----------
    seconds
        Processor time of a run, for each thread, after which the effort of a method is not raised
        further [s]. A busy machine changes it little.
    most
        Largest effort of a method.
    repetitions
        Runs of random methods. If they take more than MOST_SECONDS together, there are fewer,
        but at least LEAST_REPETITIONS.
    same
        Runs of methods that give the same answer each time.
    paths, seeds
        Number of paths and number of runs of a closure.
    """

    seconds: float
    most: int
    repetitions: int
    same: int
    paths: int
    seeds: int


FULL, QUICK = Effort(0.1, 4**12, 9, 3, 2**17, 4), Effort(0.02, 4**10, 3, 1, 2**14, 2)


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

    @property
    def effort(self) -> Effort:
        """The amount of work."""
        return QUICK if self.quick else FULL

    @property
    def limit(self) -> str:
        """The end of the efforts that were tried, in words."""
        return f" within {self.effort.seconds:g} s"


def measure(quick: bool = False, progress=None) -> Chart:
    """Measure all methods on all problems.

    quick: whether to do less work. progress: function of (steps done, steps in total).
    """
    openings = list(exact.CAVITY_BLOCKS)
    tasks = [partial(of_case, number, quick) for number in range(len(problems.CASES))]
    tasks += [partial(of_cavity, opening, quick) for opening in openings]
    step, results = stepper(progress, len(tasks)), []
    for result in in_order(tasks):
        results.append(result)
        step()
    cases, curves_of, of_cases = zip(*results[: len(problems.CASES)])
    closures = [*results[len(problems.CASES) :], *of_cases]
    return Chart(list(cases), sum(curves_of, []), sum(closures, []), quick)


def of_case(number: int, quick: bool) -> tuple[Problem, list[chart.Point], list[Closure]]:
    """A problem without its scenes, the points of all methods, and the errors of closures."""
    problem, effort = problems.case(number, quick), QUICK if quick else FULL
    closures = closed(problem, problem.name, None, effort) if number in problems.CLOSED else []
    points = curves(problem, METHODS, effort)
    return replace(problem, scene=None, independent=None), points, closures


def of_cavity(opening: int, quick: bool) -> list[Closure]:
    """The errors of closures in the cavity with so many facets removed."""
    share, name = exact.cavity_opening_fraction(opening), f"cavity, {opening} facets removed"
    return closed(problems.cavity(opening), name, share, QUICK if quick else FULL)


def curves(problem: Problem, methods, effort: Effort) -> list[chart.Point]:
    """The points of methods on one problem, each by rising effort up to its first slow run.

    The methods run in turn, so that a change of the machine's load concerns all of them.
    """
    compiles, runs, memory = {}, {}, {}
    for method in methods:
        for level in (level for level in method.efforts(problem) if level <= effort.most):
            first, *_ = timed(problem, method, level, 0)  # this run includes the compile
            run = timed(problem, method, level, 1)
            compiles[method, level], runs[method, level] = first, [run]
            memory[method, level] = peak_memory(method.run, problem, level, 1)
            if run[-1] > effort.seconds:
                break
    for seed in range(2, effort.repetitions + 1):
        for (method, level), done in runs.items():
            if seed <= wanted(method, done, effort):
                done.append(timed(problem, method, level, seed))
    points = []
    for (method, level), done in runs.items():
        seconds, values, rays, _ = (np.array(column) for column in zip(*done))
        compiled = max(0.0, compiles[method, level] - float(np.median(seconds)))
        cost = chart.Cost(rays, seconds, compiled)
        point = chart.point(problem.name, method.name, level, cost, values, problem.answer)
        points.append(replace(point, memory_MB=memory[method, level]))
    return points


def wanted(method: Method, done, effort: Effort) -> int:
    """Number of runs of a method at one effort, given those that are done."""
    if not method.is_random:
        return effort.same
    slow = sum(seconds for seconds, *_ in done) > MOST_SECONDS
    return min(LEAST_REPETITIONS, effort.repetitions) if slow else effort.repetitions


def timed(problem: Problem, method: Method, effort: int, seed: int) -> tuple:
    """Seconds, intensity, rays and processor time for each thread [s] of one run."""
    dr.sync_thread()
    start, busy = time.perf_counter(), time.process_time()
    value, rays = method.run(problem, effort, seed)
    busy = (time.process_time() - busy) / dr.thread_count()
    return time.perf_counter() - start, value, rays, busy


def closed(problem: Problem, case: str, opening: float | None, effort: Effort) -> list[Closure]:
    """The errors of every bounce limit and closure on one problem."""
    closures = []
    for bounces, closure in CLOSURES:
        values = [
            path_tracing.intensity(problem, effort.paths, seed, bounces, closure=closure)[0]
            / problem.answer
            - 1
            for seed in range(effort.seeds)
        ]
        error = float(np.std(values, ddof=1) / np.sqrt(len(values)))
        closures.append(Closure(case, opening, bounces, closure, float(np.mean(values)), error))
    return closures

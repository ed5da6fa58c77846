"""Compare methods that follow radiation from facet to facet.

    python -m benchmarks.propagation [--quick] [-o FOLDER]

The methods are those of the thesis, path tracing and Mitsuba's own integrator, on six scenes.
Printed and written are relative rms errors against rays, memory and time in s, and the error of
each closure, which replaces the reflections that are left out.
"""

import time
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path

import drjit as dr
import numpy as np

from benchmarks import chart, command
from benchmarks.memory import peak_memory
from benchmarks.methods.propagation import AMBIENT, GROUPS, METHODS, exact, path_tracing, problems
from benchmarks.methods.propagation.problem import Method, Problem
from mi_lcair import formats
from mi_lcair.drawing import drawing
from mi_lcair.progress import stepper
from mi_lcair.tasks import in_order

MOST_SECONDS, LEAST_REPETITIONS = 1.5, 5
# Pairs of the number of bounces and the closure.
COSTS = chart.TIME | {"samples": "rays", "memory_MB": "largest memory (MB)"}
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


# ---- files


def write(folder: Path, result: Chart) -> None:
    """Write pictures and tables to a folder.

    They are propagation.png, propagation_thesis.png, propagation_radiosity.png,
    propagation_closure.png, propagation.csv and propagation_closure.csv.
    """
    for name, groups, methods in (
        ("propagation.png", ("lattice", "independent", "stock", "closure"), "Path tracing"),
        ("propagation_thesis.png", ("thesis",), "The thesis's methods"),
        ("propagation_radiosity.png", ("radiosity",), "The thesis's radiosity"),
    ):
        drawn = {method.name for group in groups for method in GROUPS[group]} - {AMBIENT.name}
        points = [p for p in result.points if p.method in drawn]
        title = f"{methods}: error of what a scene sends toward the observer, against cost"
        chart.draw(folder / name, points, title, COSTS, floor=1e-6)
    chart.write_csv(folder / "propagation.csv", result.points)
    draw_closures(folder / "propagation_closure.png", result.closures)
    write_closures(folder / "propagation_closure.csv", result.closures)


def label(bounces: int, closure: str) -> str:
    """Label of a number of reflections with a closure."""
    return f"N = {bounces}" + ("" if closure == "none" else f", {closure}")


def write_closures(path, closures) -> None:
    """Write a CSV with the error of each closure, relative to the intensity and with its sign."""
    columns = {
        "case": [c.case for c in closures],
        "opening_share_of_sphere": [np.nan if c.opening is None else c.opening for c in closures],
        "bounces": [c.bounces for c in closures],
        "closure": [c.closure for c in closures],
        "error": [c.error for c in closures],
        "standard_error": [c.standard_error for c in closures],
    }
    formats.write_csv(path, columns)


def sizes(closures) -> np.ndarray:
    """Sizes of the errors, those below the end of the axis at the end."""
    return np.maximum([abs(c.error) for c in closures], 1e-5)


def draw_closures(path, closures) -> None:
    """Write a PNG: error of each closure against the cavity's opening, and on other scenes."""
    with drawing(path, (11, 4.6), dpi=120, layout="constrained") as figure:
        left, right = figure.subplots(1, 2, sharey=True, width_ratios=(3, 2))
        others = list(dict.fromkeys(c.case for c in closures if c.opening is None))
        for k, (bounces, closure) in enumerate(CLOSURES):
            measured = [c for c in closures if (c.bounces, c.closure) == (bounces, closure)]
            style = {
                "color": f"C{k}",
                "marker": chart.MARKERS[k],
                "markersize": 5,
                "label": label(bounces, closure),
                "linestyle": ":" if closure == "none" else "-",
            }
            cavities = [c for c in measured if c.opening is not None]
            left.loglog([c.opening for c in cavities], sizes(cavities), **style)
            rest = [c for c in measured if c.opening is None]
            right.semilogy(
                [others.index(c.case) + (k - 3) * 0.08 for c in rest],
                sizes(rest),
                **style | {"linestyle": "none"},
            )
        noise = max(c.standard_error for c in closures if c.opening is not None)
        left.axhspan(1e-5, noise, color="0.9", zorder=0, label="noise")
        left.set_xlabel("opening (share of the sphere)")
        left.set_ylabel("|error| of the intensity, relative")
        left.set_title("cavity, emissivity 0.5", fontsize=10, loc="left")
        right.set_title("other scenes", fontsize=10, loc="left")
        right.set_xticks(range(len(others)), others)
        right.set_xlim(-0.5, len(others) - 0.5)
        figure.legend(
            *left.get_legend_handles_labels(),
            loc="outside lower center",
            ncols=8,
            fontsize=8,
            frameon=False,
        )
        figure.suptitle(
            "Paths cut after N reflections, and what stands in for the rest", fontsize=11
        )


# ---- Command


def printed(result: Chart) -> tuple:
    """JSON, table and note of a chart."""
    seconds = result.effort.seconds
    data = {
        "limit_processor_seconds": seconds,
        "points": list(map(chart.entries, result.points)),
        "closures": [asdict(closure) for closure in result.closures],
    }
    note = (
        f"No larger effort of a method is tried once a run takes more than {seconds:g} s of "
        "processor time on each thread, however busy the machine."
    )
    return data, chart.cheapest_table(result.points, "scene", "rays", result.limit), note


def main(arguments: list[str] | None = None) -> None:
    """Measure, write the files and print a table."""
    command.run("propagation", __doc__, measure, write, printed, arguments)


if __name__ == "__main__":
    main()

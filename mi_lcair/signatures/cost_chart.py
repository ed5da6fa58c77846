"""Error of an intensity against processor time, over the ways in which a scene can be rendered."""

import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import product
from math import hypot, inf, nan
from typing import Any

import numpy as np

from mi_lcair.declared import percent
from mi_lcair.plugins.bsdfs.reflection_bsdf import LOBES
from mi_lcair.plugins.emission.panels import Openings
from mi_lcair.plugins.integrators.bounce_path import AUTO
from mi_lcair.rendering.measure import DRAWN_RAYS
from mi_lcair.rendering.reflections import bounce_settings
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.scene import Scene, changed
from mi_lcair.results import Result
from mi_lcair.sections import Table
from mi_lcair.signatures.signature import Signature, measure_signature

# The intensity with all reflections as the materials state them, and what simpler ones change
# ----------------------------------------------------------------------------------------------

# Tolerances relative to the chart's: of the intensity that others are compared with, of other
# lobes, and again of those that change it by less than NEAR
OF_REFERENCE, COARSE, FINE, NEAR = 0.3, 3.0, 0.5, 6.0
# Part of the tolerance that what is left out may use. The rest is that of the noise of a render.
MOST_LEFT_OUT = 0.6
SAME = 0.05  # part of the tolerance below which two numbers of reflections give the same answer
MOST_COUNTS = 6  # numbers of reflections that are compared, at most
DRAWN_WORDS = {
    "": "",
    "emitter_sampling": "emitters drawn",
    "opening_sampling": "paths kept inside",
}


@dataclass(frozen=True)
class Way:
    """A way to render a scene.

    max_bounces: largest number of reflections. lobe: lobe of all reflection models; "" for that of
    the scene. drawn: setting of bounce_path that is on, a key of DRAWN_WORDS. left_out: intensity
    that it changes, as a fraction; with its standard error.
    """

    max_bounces: int
    lobe: str
    drawn: str
    left_out: float
    left_out_error: float

    def settings(self, scene: Scene) -> dict[str, Any]:
        """Arguments of `changed`."""
        drawn = {name: name == self.drawn for name in left_open(scene)}
        return {"max_bounces": self.max_bounces, "lobe": self.lobe or None, **drawn}

    def noise(self, tolerance: float) -> float:
        """Half of the 95 % interval that the noise may have beside what is left out; 0 if none."""
        left_out = abs(self.left_out) + self.left_out_error
        if left_out > MOST_LEFT_OUT * tolerance:
            return 0.0
        return float(np.sqrt(tolerance**2 - left_out**2))


def ways(scene: Scene, sampling: Sampling) -> tuple[list[Way], Signature]:
    """The ways to render a scene that differ, and its intensity with all reflections.

    sampling: its tolerance is that of the chart.
    """
    settings = bounce_settings(scene, "auto", each_pixel=False, sampling=sampling)

    def made_with(lobe: str, ratio: float) -> Signature:
        with changed(scene, lobe=lobe or None, **settings):
            part = replace(sampling, tolerance=ratio * sampling.tolerance)
            return measure_signature(scene, part, parts=("bounce",))

    reference = made_with("", OF_REFERENCE)
    found = []
    for lobe in ("", *other_lobes(scene)):
        made = made_with(lobe, COARSE) if lobe else reference
        near = NEAR * sampling.tolerance * reference.intensity
        if lobe and abs(made.intensity - reference.intensity) < near:
            made = made_with(lobe, FINE)
        found += [
            (count, lobe, *left_out(made, count, reference, settings["truncation"]))
            for count in counts(made, sampling.tolerance)
            if count or not lobe  # what is emitted does not depend on the lobe
        ]
    drawn = ["", *drawable(scene)]
    pairs = [(way, name) for way, name in product(found, drawn) if way[0] or not name]
    return [Way(*way[:2], name, *way[2:]) for way, name in pairs], reference


def other_lobes(scene: Scene) -> list[str]:
    """Lobes that are not yet those of all reflection models; none without such a model."""
    stated = {surface.lobe for surface in scene.surfaces()}
    return [lobe for lobe in LOBES if stated and stated != {lobe}]


def counts(made: Signature, tolerance: float) -> list[int]:
    """Numbers of reflections that give different intensities, the largest ones if they are many."""
    sums = np.array(made.main.up_to_bounce)
    steps = np.abs(np.diff(sums, append=sums[-1])) > SAME * tolerance * made.intensity
    different = [count for count in range(len(sums)) if steps[count] or count == len(sums) - 1]
    return different[-MOST_COUNTS:]


def left_out(made: Signature, count: int, reference: Signature, beyond: float) -> tuple:
    """What fewer reflections or another lobe change, as a fraction, and its standard error.

    beyond: standard error of what the reference leaves out, as a fraction.
    """
    whole = reference.intensity
    change = (made.main.up_to_bounce[count] - whole) / whole
    if made is reference:  # the same paths, but those of further reflections
        change = -sum(made.main.by_bounce[count + 1 :]) / whole
        errors = [error / whole for error in made.main.by_bounce_error[count + 1 :]]
    else:
        errors = [made.standard_error / whole, reference.standard_error / whole]
    return change, hypot(beyond, *errors)


def drawable(scene: Scene) -> list[str]:
    """Settings of bounce_path that the scene leaves open and that may matter."""
    has_openings = Openings.of(scene.mi) is not None
    return [name for name in left_open(scene) if name != "opening_sampling" or has_openings]


def left_open(scene: Scene) -> list[str]:
    """Settings of bounce_path, of DRAWN_RAYS, about which a pilot would decide."""
    integrator = scene.mi.integrator()
    return [name for name in DRAWN_RAYS if getattr(integrator, name) == AUTO]


# The chart
# ---------

RENDERS = 3  # of each way, after one that compiles
LONG = 0.5  # s of a render that is not repeated


@dataclass(frozen=True, repr=False)
class CostChart(Result):
    """Error of an intensity against processor time, with a row for each setting of the renderer.

    Attributes
    ----------
    scene_name, band : str
    tolerance : float
        Required error, as a fraction of the intensity: half of the 95 % interval plus the
        reflections that are left out.
    intensity_W_sr, half_width_W_sr : float
        Intensity with all reflections, and half of its 95 % interval. All settings are compared
        with it.
    table : dict of str to ndarray, shape (ways,)
        max_bounces; reflection, the lobe of all reflection models ("scene": as in the materials);
        drawn, emitters that are sampled at each reflection; left_out, the change of the intensity
        as a fraction; left_out_error, its standard error; error, as a fraction, including noise and
        left_out; cpu_s, time of all processors without compilation, median of three renders; paths;
        on_frontier, 1 if no other setting is faster and more precise.
    recommended : int or None
        Row of the fastest setting with an error within the tolerance; None if there is none.
    command : str
        The command of that row; empty without one.
    untried : int
        Number of settings that were not tried, because the time was over.
    """

    scene_name: str
    band: str
    tolerance: float
    intensity_W_sr: float
    half_width_W_sr: float
    table: dict[str, np.ndarray]
    recommended: int | None
    command: str
    untried: int

    kind = "chart"
    heading = "Error against processor time"
    drawn_by = "mi_lcair.show.pictures.cost_chart:figure"

    def summary(self) -> str:
        """One line with the way that is recommended."""
        head = f"{self.scene_name}, {self.band}: for {percent(self.tolerance)} "
        if self.recommended is None:
            return f"{head}no setting that was tried is precise enough"
        seconds = self.table["cpu_s"][self.recommended]
        return f"{head}use {self.words(self.recommended)}: {seconds:.2g} s of processor time"

    def words(self, row: int) -> str:
        """What a row leaves out, in words."""
        count, lobe, drawn = (self.table[k][row] for k in ("max_bounces", "reflection", "drawn"))
        reflections = f"{count} reflection{'' if count == 1 else 's'}"
        return ", ".join(filter(None, (reflections, lobe != "scene" and lobe, drawn)))

    def facts(self) -> Iterator[Any]:
        """What is recommended, what it leaves out, and all ways."""
        yield "intensity", f"{self.intensity_W_sr:.6g} +- {self.half_width_W_sr:.2g} W/sr (95 %)"
        yield "tolerance", percent(self.tolerance)
        if self.recommended is not None:
            yield "recommended", self.words(self.recommended)
            change, error = (
                100 * self.table[name][self.recommended] for name in ("left_out", "left_out_error")
            )
            yield "it changes", f"{change:+.2g} +- {error:.2g} % of the intensity"
            yield "command", self.command
        if self.untried:
            yield "not tried", f"{self.untried} settings, because the time was over"
        table = {
            name: values[np.argsort(self.table["cpu_s"])] for name, values in self.table.items()
        }
        shown = {
            "reflections": table["max_bounces"],
            "as": table["reflection"],
            "drawn": table["drawn"],
            "left out (%)": [f"{100 * value:+.2g}" for value in table["left_out"]],
            "error (%)": [f"{100 * value:.2g}" for value in table["error"]],
            "processor time (s)": [f"{value:.2g}" for value in table["cpu_s"]],
            "paths": table["paths"],
            "": ["frontier" if value else "" for value in table["on_frontier"]],
        }
        yield Table([*shown], list(zip(*shown.values())))


def measure_cost_chart(scene: Scene, sampling: Sampling, seconds: float) -> CostChart:
    """Render a scene in all ways that differ, each to a tolerance, and compare their times.

    Parameters
    ----------
    scene : Scene
    sampling : Sampling
        Its tolerance is that of the chart.
    seconds : float
        Time after which no further way is tried [s].
    """
    start, report = time.perf_counter(), sampling.progress
    found, reference = ways(scene, replace(sampling, progress=None))
    # First those that may be enough, and of the others those where nothing is drawn
    found.sort(key=lambda way: -1 if way.noise(sampling.tolerance) else bool(way.drawn))
    rows = []
    for number, way in enumerate(found):
        if rows and time.perf_counter() - start > seconds:
            break
        rows.append(row_of(scene, way, replace(sampling, progress=None)))
        if report is not None:
            report(number + 1, len(found))
    table = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    table["on_frontier"] = frontier(table["cpu_s"], table["error"])
    met = [
        row
        for row in np.flatnonzero(table["error"] <= sampling.tolerance)
        if found[row].noise(sampling.tolerance)  # others leave nothing for the noise of a render
    ]
    best = min(met, key=lambda row: table["cpu_s"][row], default=None)
    return CostChart(
        scene_name=scene.name,
        band=scene.band.label,
        tolerance=sampling.tolerance,
        intensity_W_sr=reference.intensity,
        half_width_W_sr=reference.half_width,
        table=table,
        recommended=None if best is None else int(best),
        command="" if best is None else command(scene, found[best], sampling.tolerance),
        untried=len(found) - len(rows),
    )


def row_of(scene: Scene, way: Way, sampling: Sampling) -> dict[str, Any]:
    """A row of the chart, of one or several renders after one that compiles.

    A way that leaves out too much has as much noise as it leaves out.
    """
    goal = way.noise(sampling.tolerance) or max(sampling.tolerance, abs(way.left_out))
    spent: list[float] = []
    with changed(scene, **way.settings(scene)):
        for seed in range(sampling.seed, sampling.seed + RENDERS + 1):
            if spent[1:] and sum(spent[1:]) > LONG:
                break
            start = time.process_time()
            sampled = replace(sampling, tolerance=goal, seed=seed)
            made = measure_signature(scene, sampled, parts=())
            spent.append(time.process_time() - start)
    noise = made.half_width / made.intensity if made.intensity > 0 else nan
    return {
        "max_bounces": way.max_bounces,
        "reflection": way.lobe or "scene",
        "drawn": DRAWN_WORDS[way.drawn],
        "left_out": way.left_out,
        "left_out_error": way.left_out_error,
        "error": hypot(noise, abs(way.left_out) + way.left_out_error),
        "cpu_s": np.median(spent[1:]),
        "paths": made.paths,
    }


def frontier(cost: np.ndarray, error: np.ndarray) -> np.ndarray:
    """1 for the points than which none is both cheaper and more precise, otherwise 0."""
    best, on_it = inf, np.zeros(len(cost), int)
    for row in np.lexsort((error, cost)):
        if error[row] < best:
            best, on_it[row] = error[row], 1
    return on_it


def command(scene: Scene, way: Way, tolerance: float) -> str:
    """The command that renders a scene in this way."""
    values = [f"-D {name}={value}" for name, value in scene.parameters.items()]
    if way.lobe:
        materials = sorted({surface.material for surface in scene.surfaces()})
        values += [f"-D lobe.{material}={way.lobe}" for material in materials]
    words = ["mi-lcair signature", scene.source, f"--tolerance {100 * way.noise(tolerance):.3g}%"]
    return " ".join([*words, f"--max-bounces {way.max_bounces}", *values])

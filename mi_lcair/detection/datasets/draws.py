"""What each image of a data set shows: its view, and what is drawn for it, as a scenario."""

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from hashlib import sha256
from typing import Any

import mitsuba as mi
import numpy as np

from mi_lcair.declared import Bounds, required
from mi_lcair.detection.camera.view import CameraView
from mi_lcair.detection.datasets.description import (
    CHOICE,
    HOUR,
    POLAR,
    SPREAD,
    DatasetDescription,
    is_choice,
)
from mi_lcair.detection.scenario import OF_SCENE, TABLES, Scenario
from mi_lcair.errors import InputError, check_known, errors_of, unknown
from mi_lcair.estimate import Distribution, Stated
from mi_lcair.heating.temperatures.description import HeatDescription
from mi_lcair.heating.temperatures.heat_result import Heat
from mi_lcair.heating.temperatures.solve import temperatures
from mi_lcair.heating.temperatures.weather import weather
from mi_lcair.plugins.derivatives import own_memory
from mi_lcair.plugins.emission.triangles import is_faceted, triangle_corners
from mi_lcair.rendering.facets import FacetTable
from mi_lcair.rendering.parameters.entries import Parameter
from mi_lcair.rendering.parameters.values import checked, load_with_values, parameters_of
from mi_lcair.rendering.scene import Scene
from mi_lcair.rendering.views import Target, corners, model_shapes

# Distributions of [draws]
# ------------------------

ROUNDING = 1e-6  # relative rounding of the bounds of a scene's parameters
MOST_OUTSIDE = 1e-3  # share of draws on a side of a distribution that may be out of bounds
OF_VIEW, OF_CAMERA = 0, 1  # second numbers of the seeds of renders and of cameras
TRIES = 1000  # draws of a case until all of its values are possible together
Choices = tuple[str | float | int | bool, ...]
Law = Distribution | Choices


@dataclass(frozen=True)
class Quantity:
    """What is known of a quantity that is drawn; a value of NaN if it has none."""

    value: float
    bounds: Bounds
    sigma: float = 0.0


def law_of(name: str, stated: Stated, known: Quantity | None) -> Law:
    """The distribution that [draws] states for a quantity.

    known: None for one that is no number. Raises InputError if more than MOST_OUTSIDE of its draws
    are out of bounds on one side.
    """
    if is_choice(stated):
        return tuple(stated[CHOICE])
    table = stated if isinstance(stated, Mapping) else {"normal": stated}
    if isinstance(ends := table.get("uniform"), list):
        low, high = map(float, ends)
        law = Distribution("uniform", (low + high) / 2, (high - low) / 2, low, high)
    elif known is None or np.isnan(known.value):
        raise InputError(
            f"{name} has no value around which it could vary; give {{uniform = [a, b]}} or "
            f"{{{CHOICE} = [...]}}"
        )
    elif stated == SPREAD:
        if not known.sigma:
            raise InputError(f"{name}: its material has no sigma; give one")
        return limited(Distribution.of(name, {"normal": known.sigma}, known.value), known.bounds)
    else:
        law = Distribution.of(name, table, known.value)
    if known is None:
        return law
    for tail in (MOST_OUTSIDE, 1 - MOST_OUTSIDE):
        hint = "; narrow its distribution, or cut it off with lower and upper of a normal one"
        known.bounds.check(float(law.law.ppf(tail)), name, ROUNDING, hint)
    return limited(law, known.bounds)


def limited(law: Distribution, bounds: Bounds) -> Distribution:
    """A normal distribution cut off at the bounds of its quantity; another one as it is."""
    if law.kind != "normal":
        return law
    return replace(law, lower=max(law.lower, bounds.lower), upper=min(law.upper, bounds.upper))


def of_scenario(scenario: Scenario, name: str) -> Quantity | None:
    """The entry TABLE.KEY of a scenario as a quantity; None for one that is no number."""
    table, _, key = name.partition(".")
    known = {entry.name: entry for entry in fields(TABLES[table])}
    check_known(f"key of [{table}]", known, key)
    if required(known[key].type) not in (float, int):
        return None
    value = getattr(getattr(scenario, table), key, None)
    bounds = known[key].metadata.get("bounds", Bounds())
    return Quantity(np.nan if value is None else value, bounds)


def is_entry(name: str) -> bool:
    """Whether a draw is an entry TABLE.KEY of a scenario, and no parameter of the scene."""
    return name.partition(".")[0] in TABLES and not name.startswith(OF_SCENE)


def key_of(name: str) -> str:
    """The key of a draw among the changes of a scenario."""
    return name if is_entry(name) else f"{OF_SCENE}{name.removeprefix(OF_SCENE)}"


# The images of a data set
# ------------------------


@dataclass(frozen=True)
class Case:
    """An image of a data set, in each of its bands.

    number: of all images. view: number of its view. split: of its view. changes: entries of the
    scenario by dotted key. hour: of the heat balance; None without one.
    """

    number: int
    view: int
    split: str
    changes: dict[str, Any]
    hour: float | None = None


def seed_of(*numbers: int) -> int:
    """A seed of 32 bits from numbers, independent of those from others."""
    return int(np.random.SeedSequence(numbers).generate_state(1)[0])


def generator(name: str, *numbers: int) -> np.random.Generator:
    """Random numbers of a draw, independent of those of other draws."""
    return np.random.default_rng([*numbers, int(sha256(name.encode()).hexdigest()[:8], 16)])


def drawn(law: Law, random: np.random.Generator) -> Any:
    """A value from a distribution."""
    if isinstance(law, tuple):
        return law[int(random.integers(len(law)))]
    return float(law.law.ppf(random.random()))


def cases_of(description: DatasetDescription, scenario: Scenario, scene: Scene) -> list[Case]:
    """All images of a data set. Raises InputError for one that is not possible.

    scenario, scene: those of [base], without views and draws.
    """
    frames, splits = description.frames, description.splits
    with errors_of("[draws]"):
        known = parameters_of(scene)
        laws = {n: law_of(n, s, quantity(n, scenario, known)) for n, s in description.draws.items()}
        if len({key_of(name) for name in laws}) < len(laws):
            raise InputError(f"{OF_SCENE}NAME and NAME are the same parameter; give one of them")
    materials = {name for name, of in known.items() if of.kind not in ("temperature", "motion")}
    together = [name for name in laws if name.removeprefix(OF_SCENE) in materials]
    views, cases = description.views.views(frames.seed), []
    of_views = splits.of_views(len(views), frames.seed)
    for number, view in enumerate(views):
        placed = {
            f"{'observer' if name in POLAR else 'camera'}.{name}": value
            for name, value in view.items()
        } | {
            "render.seed": seed_of(frames.seed, OF_VIEW, number),
        }
        for k in range(frames.cases):
            values = possible(laws, together, scene, frames.seed, number, k)
            hour = values.pop(HOUR, None)
            changes = placed | {key_of(name): value for name, value in values.items()}
            cases.append(Case(len(cases), number, of_views[number], changes, hour))
    return cases


def quantity(name: str, scenario: Scenario, known: Mapping[str, Parameter]) -> Quantity | None:
    """What is known of a quantity of [draws]; None for a text and for the hour."""
    if name == HOUR:
        return None
    if is_entry(name):
        return of_scenario(scenario, name)
    short = name.removeprefix(OF_SCENE)
    if short in known:
        of = known[short]
        return Quantity(of.value, Bounds(lower=of.lower, upper=of.upper, unit=of.unit), of.sigma)
    if name.startswith(OF_SCENE):  # a $-parameter of the scene's file
        return None
    raise unknown("quantity", name, [*known, *(f"{table}.KEY" for table in TABLES), HOUR])


def possible(laws: Mapping[str, Law], together: list[str], scene: Scene, *numbers: int) -> dict:
    """Values of all draws of a case.

    They are drawn again until those that depend on each other are possible `together`.
    """
    randoms = {name: generator(name, *numbers) for name in laws}
    for _ in range(TRIES):
        values = {name: drawn(law, randoms[name]) for name, law in laws.items()}
        try:
            checked(scene, {name.removeprefix(OF_SCENE): values[name] for name in together})
            return values
        except InputError as error:
            last = error
    raise InputError(f"[draws]: nearly all draws are not possible together: {last}")


# Temperatures of facets, and the sun, at the hours of a heat balance
# -------------------------------------------------------------------

HEAT, MODES = "heat", f"{OF_SCENE}modes"  # folder of the temperatures, and what names a file
LOWEST_DEG = 1.0  # elevation of the sun below which a scenario has none


@dataclass(frozen=True)
class HeatedHours:
    """The times of a heat balance. sun_deg: elevation and azimuth of the sun at each, (m, 2)."""

    heat: Heat
    sun_deg: np.ndarray

    @staticmethod
    def of(file: str, scene: Scene) -> "HeatedHours":
        """The temperatures of a heat.toml, over the day.

        Raises InputError for a steady state, and for a model with other facets than the scene has.
        """
        read = HeatDescription.read(file)
        same = load_with_values(read.target.scene, read.target.parameters)
        if FacetTable(same).group.tolist() != FacetTable(scene).group.tolist():
            raise InputError(f"{file}: its facets are not those of {scene.name}; name that scene")
        heat, run = temperatures(same, read), read.run
        if heat.is_steady:
            raise InputError(f"{file}: is a steady state, which has no hours; leave heat out")
        series = weather(read.weather, read.folder, run.steps, run.start_K is None)
        sun = np.stack([series.sun_elevation_deg, series.sun_azimuth_deg], axis=-1)
        return HeatedHours(heat, sun)

    def applied(self, case: Case, scenario: Scenario) -> Case:
        """A case with the temperatures, and the sun if there is one, at the time of its hour."""
        with errors_of("[draws]"):
            row = self.heat.row(case.hour)
        changes = {MODES: f"{HEAT}/{row:05}.csv"}
        if scenario.surroundings is not None and scenario.surroundings.sun is not None:
            elevation, azimuth = self.sun_deg[row]
            is_up = elevation >= LOWEST_DEG
            changes["surroundings.sun"] = f"{elevation:.6g},{azimuth:.6g}" if is_up else None
        return replace(case, changes=case.changes | changes)


# Which views see the target
# --------------------------

POINTS = 256  # points of the model to which a view looks
BESIDE = 1.01  # distance from the middle at which lines of sight begin, in radii of the target


def check_views(scene: Scene, of: Mapping[int, Scenario]) -> None:
    """Raise InputError if a camera is in the target, does not see it, or terrain hides it.

    of: scenario of the first case of each view.
    """
    target, random = Target.of(scene), np.random.default_rng(0)
    eyes = []
    for view, scenario in of.items():
        with errors_of(f"view {view}"):
            observer = scenario.observer
            camera = CameraView.of(target, observer.view, observer.range_m, scenario.camera)
        eyes.append(camera.eye)
    points = np.concatenate([middles(shape) for shape in model_shapes(scene)])
    points = points[random.integers(len(points), size=POINTS)]
    with scene.prepared() as tracer:
        for view, eye in zip(of, eyes):
            toward = points - eye
            toward /= np.linalg.norm(toward, axis=1)[:, None]
            start = points - 2 * BESIDE * target.radius * toward
            start, toward = own_memory([mi.Point3f(start.T), mi.Vector3f(toward.T)])
            hit = scene.mi.ray_intersect(mi.Ray3f(start, toward))
            sees = hit.is_valid() & tracer.emitters.is_model(hit.emitter(scene.mi))
            if not sees.numpy().any():
                raise InputError(
                    f"view {view}: the target is hidden from the camera; move the view"
                )


def middles(shape) -> np.ndarray:
    """Middles of a shape's triangles, (n, 3) [m]; of another shape that of its bounding box."""
    if is_faceted(shape):
        return np.mean(triangle_corners(shape), axis=0, dtype=float)
    return corners(shape).mean(axis=0, keepdims=True)

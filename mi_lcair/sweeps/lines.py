"""Cases of a sweep that share a line of sight, and the subjects and views that they need."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from mi_lcair.detection.irradiance import Backdrop
from mi_lcair.detection.scenario import Scenario
from mi_lcair.detection.setting import line_of, sun_over
from mi_lcair.detection.weather import AirOfLight
from mi_lcair.errors import InputError, errors_of
from mi_lcair.physics.air.atmosphere import Atmosphere, LineOfSight
from mi_lcair.physics.detector import Detector
from mi_lcair.plugins.emitters.distant_emitter import DistantEmitter
from mi_lcair.rendering.parameters.values import whole_path
from mi_lcair.rendering.scene import Scene
from mi_lcair.rendering.views import Target, View
from mi_lcair.sweeps.conditions import Conditions
from mi_lcair.sweeps.subject import Subject

AZIMUTH, ELEVATION = "azimuth_deg", "elevation_deg"
# Short names of entries of a scenario
ENTRIES = {
    AZIMUTH: "observer.azimuth_deg",
    ELEVATION: "observer.elevation_deg",
    "range_m": "observer.range_m",
    "air": "atmosphere.table",
    "band": "sensor.band",
    "nei": "sensor.nei",
}
TEMPERATURE = "temperature."  # followed by a group, a condition of its own
# Entries of a scenario that change neither geometry nor reflectances
UNTRACED = (
    "atmosphere.",
    "background.",
    "observer.",
    "target.height_m",
    "sensor.nei",
    "sensor.snr",
    "sensor.optics_transmittance",
    "sensor.field_of_view_deg",
)


@dataclass(frozen=True, eq=False)
class Line:
    """Cases that share everything but, perhaps, the azimuth of the observer.

    Attributes
    ----------
    cases : ndarray of int, shape (n,)
        Numbers of the cases.
    views : tuple of View, length n
        View of each case.
    subject : Subject
    light : AirOfLight or None
        Air of the light of the scene, if it depends on it.
    temperatures : dict of str to float
        New temperatures, K, by group.
    sight : Sightline or None
        None for a scene, which has no sensor.
    """

    cases: np.ndarray
    views: tuple[View, ...]
    subject: Subject
    light: AirOfLight | None
    temperatures: dict[str, float]
    sight: "Sightline | None" = None


@dataclass(frozen=True, eq=False)
class Sightline:
    """Air, path and background of a line, its detector, and the radius of the target, m.

    direction: text that two lines have in common if they differ by their range alone.
    """

    detector: Detector
    air: Atmosphere
    path: LineOfSight
    backdrop: Backdrop
    radius_m: float
    direction: str


def lines_of(conditions: Conditions) -> Iterator[Line]:
    """Yield the lines of a sweep, those of a subject one after the other.

    All conditions are checked: raises InputError for the first one that cannot be used.
    """
    names, places = list(conditions.values), conditions.places()
    azimuth = next((name for name in names if ENTRIES.get(name, name) == ENTRIES[AZIMUTH]), None)
    check_names(conditions)
    # The subjects in the order of the sorted rows
    shared = sorted((name for name in names if name != azimuth), key=lambda name: is_untraced(name))
    rows = np.stack([places[name] for name in shared] + [np.zeros(conditions.count, int)])
    _, firsts, of_case = np.unique(rows, axis=1, return_index=True, return_inverse=True)
    order = np.argsort(of_case.ravel(), kind="stable")
    for first, cases in zip(firsts, np.split(order, np.cumsum(np.bincount(of_case.ravel()))[:-1])):
        values = {name: conditions.values[name][places[name][first]] for name in names}
        azimuths = None
        if azimuth is not None:
            azimuths = [conditions.values[azimuth][places[azimuth][case]] for case in cases]
        stated = ", ".join(f"{name} = {value}" for name, value in values.items())
        with errors_of(f"case {stated}"):
            if conditions.base.scene is None:
                yield from of_scenario(conditions, values, cases, azimuths)
            else:
                yield of_scene(conditions, values, cases, azimuths)


def is_untraced(name: str) -> bool:
    """Whether a condition changes neither geometry nor reflectances."""
    return name.startswith(TEMPERATURE) or ENTRIES.get(name, name).startswith(UNTRACED)


def check_names(conditions: Conditions) -> None:
    """Raise InputError for conditions that are given twice, or that change nothing."""
    names = [ENTRIES.get(name, name) for name in conditions.values]
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise InputError(f"[conditions]: {twice} is given twice")
    for name in names:
        if conditions.base.scenario is not None and name.startswith("camera."):
            raise InputError(
                f"[conditions]: {name} belongs to the camera, on which no quantity of a sweep "
                "depends; leave it out"
            )


def temperatures_of(values: dict) -> dict[str, float]:
    """Temperatures, K, by group."""
    return {
        name.removeprefix(TEMPERATURE): number(name, value)
        for name, value in values.items()
        if name.startswith(TEMPERATURE)
    }


def of_scene(conditions: Conditions, values: dict, cases, azimuths) -> Line:
    """The line of a scene: views and temperatures."""
    elevation = number(ELEVATION, values.get(ELEVATION, 0.0))
    parameters = {
        name: whole_path(str(value))
        for name, value in values.items()
        if name not in (AZIMUTH, ELEVATION) and not name.startswith(TEMPERATURE)
    }
    pairs = tuple(sorted(parameters.items()))
    source = whole_path(conditions.base.scene)
    views = [View(number(AZIMUTH, a), elevation) for a in azimuths or [0.0] * len(cases)]
    subject = Subject(f"{source} {pairs}", source, pairs)
    return Line(cases, tuple(views), subject, None, temperatures_of(values))


def of_scenario(conditions: Conditions, values: dict, cases, azimuths) -> Iterator[Line]:
    """Yield the lines of a scenario: one, or with a sun one for each azimuth."""
    changes = {
        ENTRIES.get(name, name): value
        for name, value in values.items()
        if not name.startswith(TEMPERATURE)
    }
    source = whole_path(conditions.base.scenario)
    scenario = Scenario.read(source, **changes)
    traced = {
        name: value
        for name, value in changes.items()
        if not is_untraced(name) or scenario.surroundings is not None and name == "atmosphere.table"
    }
    subject = Subject(f"{source} {sorted(traced.items())}", scenario=scenario)
    scene = subject.load()
    sun = sun_over(scenario, scene)
    observer = scenario.observer
    azimuths = np.array(
        [observer.azimuth_deg] * len(cases)
        if azimuths is None
        else [number(AZIMUTH, azimuth) for azimuth in azimuths]
    )
    groups = [np.arange(len(cases))]
    if sun is not None:  # the air scatters sunlight by the angle from the sun
        groups = [np.flatnonzero(azimuths == azimuth) for azimuth in np.unique(azimuths)]
    for group in groups:
        turned = replace(observer, azimuth_deg=float(azimuths[group[0]]), position_m=None)
        yield Line(
            cases[group],
            tuple(View(azimuth, observer.elevation_deg) for azimuth in azimuths[group]),
            subject,
            *sightline(replace(scenario, observer=turned), scene, sun, values),
        )


def sightline(scenario: Scenario, scene: Scene, sun, values: dict) -> tuple:
    """Air of the light, temperatures and line of sight of a scenario with some conditions."""
    detector, target = scenario.sensor.detector(), Target.of(scene)
    target.check_outside(scenario.observer.range_m)
    sight, path, behind = line_of(scenario, detector, sun)
    has_light = any(isinstance(emitter, DistantEmitter) for emitter in scene.mi.emitters())
    light = AirOfLight.of(scenario, sight.target_m) if has_light else None
    rest = {name: v for name, v in values.items() if ENTRIES.get(name, name) != ENTRIES["range_m"]}
    lower_m = "" if sight.observer_m is None else f"{min(sight.observer_m, sight.target_m):.3f}"
    direction = f"{rest} {scenario.observer.azimuth_deg} {lower_m}"
    made = Sightline(detector, sight.air, path, behind, target.radius, direction)
    return light, temperatures_of(values), made


def number(name: str, value) -> float:
    """A condition that must be a number."""
    if type(value) not in (int, float):
        raise InputError(f"{name} = {value!r}; must be a number")
    return float(value)

"""What the contrast of a scenario is computed from, after all checks."""

from collections.abc import Iterable, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mi_lcair import scenes
from mi_lcair.detection.irradiance import AirOfLight, Backdrop
from mi_lcair.detection.line_of_sight import Sight, backdrop, background_sun
from mi_lcair.detection.scenario import RenderTable, Scenario
from mi_lcair.errors import InputError
from mi_lcair.physics.air.atmosphere import Atmosphere, LineOfSight
from mi_lcair.physics.imager import Detector
from mi_lcair.physics.spectra.bins import filter_of
from mi_lcair.physics.sun import SUN_ELEVATION_DEG
from mi_lcair.plugins.emitters.distant_emitter import check_fits
from mi_lcair.plugins.emitters.thermal_emitter import one_sun
from mi_lcair.rendering.loading.files import survey
from mi_lcair.rendering.loading.parsing import run_named_plugins
from mi_lcair.rendering.motions.pose import moved
from mi_lcair.rendering.parameters.values import apply_solution, load_with_values
from mi_lcair.rendering.reflections import bounce_settings
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.scene import Scene, changed
from mi_lcair.rendering.views import Target, seen_from


@dataclass(frozen=True)
class Setting:
    """What the contrast of a scenario is computed from, after all checks and before any render.

    Attributes
    ----------
    detector : Detector
    sight : Sight
        Line of sight with its air.
    air : Atmosphere
        Air between target and sensor.
    path : LineOfSight
        Path from the target to the sensor.
    backdrop : Backdrop
        Background of the target.
    target : Target
        Sphere that holds the target.
    view : Scene
        Scene with the sensor of the observer.
    sun : tuple of float or None
        Azimuth and elevation of the sun whose light the air scatters, degrees; None by night.
    light : AirOfLight
        Air through which sun and sky shine on the target.
    """

    detector: Detector
    sight: Sight
    air: Atmosphere
    path: LineOfSight
    backdrop: Backdrop
    target: Target
    view: Scene
    sun: tuple[float, float] | None = None
    light: AirOfLight = AirOfLight(None)

    @property
    def one_sun(self) -> Any:
        """The sun among the emitters of the scene; None without one."""
        return one_sun(self.view.mi.emitters())

    def through(self, scenario: Scenario) -> "Setting":
        """The setting for its scenario with other air or background.

        The light that shines on its scene stays as it is, see `AirOfLight`.
        """
        sight, path, behind = line_of(scenario, self.detector, self.sun)
        light = AirOfLight.of(scenario, sight.target_m)
        return replace(self, sight=sight, air=sight.air, path=path, backdrop=behind, light=light)


@dataclass(frozen=True, eq=False)
class Sightline:
    """Line of sight, path and background of some cases of a sweep, and their detector.

    radius_m: of the target [m]. one_sun: the sun among the emitters of the scene; None without one.
    direction: text that two lines have in common if they differ by their range alone.
    """

    detector: Detector
    sight: Sight
    path: LineOfSight
    backdrop: Backdrop
    radius_m: float
    one_sun: Any
    direction: str

    @property
    def air(self) -> Atmosphere:
        """Air between target and sensor."""
        return self.sight.air


def setting_of(scenario: Scenario, scene: Scene | None = None) -> Setting:
    """The setting of a scenario; raises InputError if the scenario cannot be used.

    scene: its loaded scene, if it is known.
    """
    observer, detector = scenario.observer, scenario.sensor.detector()
    direction = background_sun(scenario)
    line = line_of(scenario, detector, direction)
    scene = scene or target_scene(scenario, detector)
    if (sun := sun_over(scenario, scene)) != direction:
        direction, line = sun, line_of(scenario, detector, sun)
    sight, path, behind = line
    light = AirOfLight.of(scenario, sight.target_m)
    light.shine_on(scene)
    target = Target.of(scene)
    target.check_outside(observer.range_m)
    view = seen_by_observer(scenario, scene, target)
    if not view.band.is_total:
        air = path.wavelengths_um, path.transmittance
        view.mi.integrator().filters = (filter_of(view.band, detector.band, *air),)
    return Setting(detector, sight, sight.air, path, behind, target, view, direction, light)


def seen_by_observer(scenario: Scenario, scene: Scene, target: Target) -> Scene:
    """A scene with the sensor of a scenario's observer, whose window holds the target."""
    return seen_from(scene, scenario.observer.view, scenario.render.resolution, target)


def holding(setting: Setting, scenario: Scenario, poses: Iterable[Mapping]) -> Setting:
    """The setting of a scenario, whose window also holds its target as motions move it.

    poses: values of motions by name.
    """
    points = [Target.of(setting.view).points]
    for pose in poses:
        with moved(setting.view, pose):
            points.append(Target.of(setting.view).points)
    target = Target.around(np.concatenate(points))
    return replace(setting, view=seen_by_observer(scenario, setting.view, target))


def sun_over(scenario: Scenario, scene: Scene) -> tuple[float, float] | None:
    """Azimuth and elevation [degrees] of the sun of a scene, or of its daytime sky; None by night.

    Raises InputError if the two do not fit.
    """
    sun = one_sun(scene.mi.emitters())
    is_up, behind = sun is not None and sun.elevation_deg > 0, scenario.background
    if sun is not None and behind.by_day:
        elevation = sun.elevation_deg if is_up else SUN_ELEVATION_DEG
        sky = behind.with_sun(sun.azimuth_deg, elevation)
        check_fits(sun, sky, "the sky of [background]")
    if is_up:
        return sun.azimuth_deg, sun.elevation_deg
    return background_sun(scenario)


def line_of(
    scenario: Scenario, detector: Detector, sun: tuple[float, float] | None
) -> tuple[Sight, LineOfSight, Backdrop]:
    """Line of sight, path and background, with the azimuth and elevation of a sun [degrees].

    Raises InputError if the scenario cannot be used.
    """
    sight, range_m = Sight.of(scenario, sun), scenario.observer.range_m
    sight.air.check_covers(detector.band)
    path = sight.air.path(range_m, scenario.atmosphere.extrapolate)
    behind = backdrop(scenario, detector, sight)
    if behind.path_at is not None:
        behind.path_at(range_m)  # raises InputError if a table ends before the ground
    return sight, path, behind


def target_scene(scenario: Scenario, detector: Detector) -> Scene:
    """The scene with the parameters of the scenario, in a band that holds the detector's."""
    parameters, source = scenario.scene_parameters(), scenario.target.scene
    if "band" in survey(scenes.file_of(source), parameters):
        parameters["band"] = scenario.sensor.response or scenario.sensor.band
    run_named_plugins(scenario.plugins.files)
    words = scenario.surroundings
    band = parameters.get("band", scenario.sensor.band)
    around = [] if words is None else words.emitters(band)
    scene = load_with_values(source, parameters, around, scenario.motions)
    if scenario.target.solution is not None:
        apply_solution(scene, scenario.target.solution)
    if not scene.band.holds(detector.band):
        raise InputError(
            f"the sensor's band {detector.band.label} is not within that of {scene.name}, "
            f"{scene.band.label}"
        )
    if scenario.render.lobe is not None and not scene.surfaces():
        raise InputError(
            f"{scene.name} has no material with a fidelity ladder to set a lobe of; leave lobe out"
        )
    return scene


def rendered_as(
    view: Scene, render: RenderTable, each_pixel: bool = False
) -> AbstractContextManager:
    """Context manager in which a scene has the lobe and number of reflections of a [render].

    each_pixel: whether "auto" is for the pixels of an image, see `chosen`.
    """
    sampling = Sampling(tolerance=render.tolerance, seed=render.seed)
    with changed(view, lobe=render.lobe):
        settings = bounce_settings(view, render.most_bounces, each_pixel, sampling)
    return changed(view, lobe=render.lobe, **settings)

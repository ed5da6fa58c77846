"""Public functions that give tables of intensities and contrasts."""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from os import PathLike
from pathlib import Path

from mi_lcair.api.scenarios import scenario_of
from mi_lcair.api.scenes import sampling_of, scene_of
from mi_lcair.detection.camera.sequence import check_film, film
from mi_lcair.detection.scenario import Scenario
from mi_lcair.detection.sweeps.flight import Flight, measure_flight
from mi_lcair.detection.sweeps.subject import AreasFolder, Conditions
from mi_lcair.detection.sweeps.sweep import Sweep, measure_sweep, measure_trend
from mi_lcair.errors import InputError, errors_of
from mi_lcair.files import together
from mi_lcair.progress import Progress
from mi_lcair.rendering.reflections import bounce_settings
from mi_lcair.rendering.scene import SceneLike, changed
from mi_lcair.rendering.views import View
from mi_lcair.signatures.trend import Trend
from mi_lcair.signatures.view_areas import DEFAULT_TOLERANCE
from mi_lcair.tasks import exclusively

# `trend`, the intensity of a scene as a function of the aspect
# -------------------------------------------------------------


def trend(
    scene: SceneLike,
    azimuths_deg: Iterable[float],
    elevations_deg: Iterable[float] = (0.0,),
    resolution: int = 64,
    spp: int | None = None,
    tolerance: float | str | None = None,
    max_spp: int | None = None,
    seed: int = 0,
    areas: str | PathLike[str] | None = None,
    progress: Progress | None = None,
    *,
    parameters: Mapping[str, object] | None = None,
    max_bounces: int | str | None = None,
) -> Trend:
    """Intensity of a scene's model toward each azimuth and elevation of the observer.

    A trend is a sweep over the direction of view, with the parts of the intensity by group and by
    reflection.

    Parameters
    ----------
    scene : Scene, str, Path or mi.Scene
        A loaded scene, or what `mi_lcair.load` takes: a bundled name, a file, Mitsuba's own scene.
        It needs a model.
    azimuths_deg : sequence of float
        Azimuths of the observer, degrees: 0 sees the nose, 90 the left side.
    elevations_deg : sequence of float
        Elevations of the observer above the horizontal, degrees.
    resolution : int
        Pixels along each side of a view. They only set the number of its paths, spp x pixels. The
        paths begin anywhere in the view, not in one pixel each.
    spp : int, optional
        Paths per pixel of each view, instead of a tolerance.
    tolerance : float or str, optional
        Trace paths until half of the 95 % interval of each view's intensity is at most this
        fraction of it, such as 0.01 or "1%" (0.01 if `spp` is not given).
    max_spp : int, optional
        Largest number of paths per pixel for a tolerance (65536).
    seed : int
        Seed of the random numbers.
    areas : path-like, optional
        Folder for the traced results. A later call reuses them, and an interrupted trend resumes.
    progress : callable, optional
        Called with (views done, all views).
    parameters : mapping of str to object, optional
        Values of the scene's $-parameters, for a name or a file.
    max_bounces : int, "auto" or None
        As for `signature`. The pilot run uses some of the views.

    Returns
    -------
    Trend

    Raises
    ------
    InputError
        If the arguments cannot be combined, if a view is missing or given twice, or if the folder
        cannot be used.
    """
    scene = scene_of(scene, parameters)
    sampling = sampling_of(spp=spp, tolerance=tolerance, max_spp=max_spp, seed=seed)
    if spp is None and tolerance is None:
        sampling = replace(sampling, tolerance=DEFAULT_TOLERANCE)
    azimuths = angles("azimuths_deg", azimuths_deg)
    views = tuple(
        View(azimuth, elevation)
        for elevation in angles("elevations_deg", elevations_deg)
        for azimuth in azimuths
    )
    settings = bounce_settings(scene, max_bounces, each_pixel=False, sampling=sampling, views=views)
    folder = None if areas is None else AreasFolder(areas)
    with changed(scene, **settings):
        return measure_trend(scene, views, resolution, sampling, folder, progress)


def angles(name: str, values: Iterable[float]) -> list[float]:
    """Angles in degrees as numbers; raises InputError if they are not a sequence of numbers."""
    try:
        if isinstance(values, str):
            raise ValueError(values)
        return [float(value) for value in values]
    except (TypeError, ValueError):
        raise InputError(
            f"{name} = {values!r} is not a sequence of angles in degrees, such as range(0, 360, "
            "10) or [0, 30]"
        ) from None


# `sweep`, a table of signatures over many conditions
# ---------------------------------------------------


def sweep(
    conditions: str | PathLike[str] | Mapping,
    areas: str | PathLike[str] | None = None,
    progress: Progress | None = None,
) -> Sweep:
    """Signatures of a scene or a scenario over a table of conditions.

    Effective areas by source are traced once for each view, and again only if a condition changes
    the geometry or reflectances. Ranges, airs, backgrounds, temperatures and the noise of the
    sensor need no further tracing.

    Parameters
    ----------
    conditions : path-like or mapping
        TOML file, or a dictionary of its tables [base], [conditions] and [sampling].
    areas : path-like, optional
        Folder for the effective areas. A later call reuses them: a sweep over other ranges, airs or
        temperatures needs no render, and an interrupted sweep resumes.
    progress : callable, optional
        Called with (views done, all views).

    Returns
    -------
    Sweep

    Raises
    ------
    InputError
        If the conditions or the folder cannot be used. All conditions are checked
        before anything is traced.
    """
    folder = None if areas is None else AreasFolder(areas)
    return measure_sweep(Conditions.read(conditions), folder, progress)


# `flight`, the contrast of a moving target against time
# ------------------------------------------------------


@exclusively
def flight(
    scenario: Scenario | str | PathLike[str],
    areas: str | PathLike[str] | None = None,
    frames: str | PathLike[str] | None = None,
    video: str | PathLike[str] | None = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> Flight:
    """Contrast of a scenario's target at each time of its flight. Views are traced at some times,
    and at more times where the contrast does not change linearly between them. Air, range and
    background are calculated for each time.

    Parameters
    ----------
    scenario : Scenario, str or path-like
        Scenario with a table [flight], or what `Scenario.read` takes. `tolerance` of its [render]
        is half of the 95 % interval of each traced intensity, as a fraction of it (0.01).
    areas : path-like, optional
        Folder for the effective areas. A later call reuses them.
    frames : path-like, optional
        Write the counts of the scenario's [camera] for each time, FILE.tif (TIFF with 16-bit
        pages).
    video : path-like, optional
        Write the frames as an animation to look at, FILE.gif.
    seed : int
        Seed of the camera's noise and fixed pattern.
    progress : callable, optional
        Called with (times done, all times).

    Returns
    -------
    Flight

    Raises
    ------
    InputError
        If the scenario or its path cannot be used, or if the path leads into the ground.
    """
    scenario = scenario_of(scenario)
    outputs = (None if frames is None else Path(frames), None if video is None else Path(video))
    with errors_of(f"scenario '{scenario.name}'"), together():
        if any(outputs):
            check_film(scenario, *outputs)
        folder = None if areas is None else AreasFolder(areas)
        made = measure_flight(scenario, folder, progress=progress)
        if not any(outputs):
            return made
        return replace(made, rendered=film(scenario, *outputs, seed, progress))

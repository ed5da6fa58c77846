"""`trend`, the intensity of a scene as a function of the aspect."""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from os import PathLike

from mi_lcair.api.load import sampling_of, scene_of
from mi_lcair.errors import InputError
from mi_lcair.progress import Progress
from mi_lcair.rendering.reflections.number import bounce_settings
from mi_lcair.rendering.scene import SceneLike
from mi_lcair.rendering.settings import changed
from mi_lcair.rendering.views import View
from mi_lcair.signatures.many_views import DEFAULT_TOLERANCE
from mi_lcair.signatures.trend_result import Trend
from mi_lcair.sweeps.areas_folder import AreasFolder
from mi_lcair.sweeps.trend import measure_trend


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

    It is a sweep over the aspect alone, with the parts of the intensity by group and by reflection.

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
        `spp` and `max_spp` count the paths of a view divided by resolution x resolution. The paths
        begin anywhere in the view, not in one pixel each.
    spp : int, optional
        Samples per pixel, instead of a tolerance.
    tolerance : float or str, optional
        Half of the 95 % interval of each view's intensity, as a fraction of it, such as 0.01 or
        "1%"; 0.01 if spp is not given.
    max_spp : int, optional
        Largest number of samples per pixel for the tolerance.
    seed : int
        Seed of the random numbers.
    areas : path-like, optional
        Folder that keeps what is traced. A trend that was interrupted goes on from there, and what
        it holds is not traced again.
    progress : callable, optional
        Called with (views done, all views).
    parameters : mapping of str to object, optional
        Values of the scene's $-parameters, for a name or a file.
    max_bounces : int, "auto" or None
        As for `signature`. With "auto" pilot paths toward some of the views choose it.

    Returns
    -------
    Trend

    Raises
    ------
    InputError
        If the arguments do not fit together, if a view is missing or given twice, or if the folder
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
    """Angles in degrees as numbers; raises InputError for what is no sequence of numbers."""
    try:
        if isinstance(values, str):
            raise ValueError(values)
        return [float(value) for value in values]
    except (TypeError, ValueError):
        raise InputError(
            f"{name} = {values!r} is no sequence of angles in degrees, such as range(0, 360, 10) "
            "or [0, 30]"
        ) from None

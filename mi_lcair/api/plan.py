"""`plan`, which plans a render."""

from collections.abc import Mapping

from mi_lcair.api.scene import scene_of
from mi_lcair.errors import InputError
from mi_lcair.fraction import fraction
from mi_lcair.planning.plan import Plan, find_plan
from mi_lcair.progress import Progress
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.scene import SceneLike
from mi_lcair.startup.threads import exclusively


@exclusively
def plan(
    scene: SceneLike,
    tolerance: float | str = 0.01,
    each_pixel: bool = False,
    seed: int = 0,
    sensor: int = 0,
    progress: Progress | None = None,
    renders: float = 1,
    *,
    parameters: Mapping[str, object] | None = None,
) -> Plan:
    """Plan a render of `scene` whose error is below `tolerance`.

    Give the plan to `render` or `signature`. They render under its settings until the noise is
    below the plan's `noise_tolerance`.

    Parameters
    ----------
    scene : Scene, str, Path or mi.Scene
        A loaded scene, or what `mi_lcair.load` takes: a bundled name, a file, Mitsuba's own scene.
        Its own settings are the same afterwards.
    tolerance : float or str
        Error that is allowed, as a fraction of the mean radiance, between 0 and 1, such as 0.01 or
        "1%".
    each_pixel : bool
        True for the rms error over the pixels, as `render` reports it. False for the error of the
        target's intensity, which needs an orthographic sensor.
    seed : int
        Seed of the random numbers.
    sensor : int
        Number of the scene's sensor, from 0.
    progress : callable, optional
        Called with (probes done, probes expected).
    renders : float
        Number of renders that the plan is for. Probes that save less time in all of them than they
        take are left out. With infinity all simplifications are tried.
    parameters : mapping of str to object, optional
        Values of the scene's $-parameters, for a name or a file.

    Returns
    -------
    Plan

    Raises
    ------
    InputError
        If the tolerance is not between 0 and 1, if the scene is dark, or if no settings that can
        be probed reach the tolerance.
    """
    tolerance = fraction(tolerance)
    if not 0 < tolerance < 1:
        raise InputError(f"tolerance = {tolerance} must lie between 0 and 1")
    sampling = Sampling(tolerance=tolerance, seed=seed, sensor=sensor, progress=progress)
    return find_plan(scene_of(scene, parameters), sampling, each_pixel, renders)

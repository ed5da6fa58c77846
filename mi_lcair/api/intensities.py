"""Public functions that give intensities and contrasts."""

from collections.abc import Callable, Mapping

from mi_lcair.api.scenes import sampling_of, scene_of
from mi_lcair.declared import Bounds
from mi_lcair.plugins.recorders.channels import PARTS
from mi_lcair.progress import Progress
from mi_lcair.rendering.reflections import reflecting
from mi_lcair.rendering.scene import SceneLike
from mi_lcair.signatures.cost_chart import CostChart, measure_cost_chart
from mi_lcair.signatures.signature import Signature, measure_signature, with_left_out
from mi_lcair.tasks import exclusively

# `signature`, which integrates the radiance of a scene over the window of a sensor
# ---------------------------------------------------------------------------------


@exclusively
def signature(
    scene: SceneLike,
    spp: int | None = None,
    tolerance: float | str | None = None,
    max_spp: int | None = None,
    seed: int = 0,
    sensor: int = 0,
    by_spectrum: bool = False,
    facets: bool = False,
    progress: Progress | None = None,
    excess: Callable[[Signature], float] | None = None,
    *,
    parameters: Mapping[str, object] | None = None,
    max_bounces: int | str | None = None,
    parts: bool = True,
) -> Signature:
    """Render a scene and integrate its radiance over the sensor's window.

    The intensity is int L dA, W/sr.

    Parameters
    ----------
    scene : Scene, str, Path or mi.Scene
        A loaded scene, or what `mi_lcair.load` takes: a bundled name, a file, Mitsuba's own scene.
        Its sensor must be orthographic.
    spp : int or None
        Paths per pixel of the sensor's film: the number of paths is spp x pixels (default: the
        scene's number). The paths begin anywhere in the window, not in one pixel each.
    tolerance : float, str or None
        Trace paths until the 95 % interval of the target's intensity is within this fraction of it,
        such as 0.01 or "1%", or until `max_spp` is reached. Without a target, the tolerance applies
        to the scene's intensity.
    max_spp : int or None
        Largest number of paths per pixel for a tolerance (65536).
    seed, sensor : int
        As for `render`.
    progress : callable or None
        Called with (paths done, paths expected).
    by_spectrum : bool
        Also compute the effective area of each source in the scene.
    facets : bool
        Also compute the results of each facet of the model.
    excess : callable or None
        Instead of a tolerance: a function of the Signature (without facets) from the paths so far.
        It returns the ratio of the error to the allowed error. Paths are added until the ratio is
        at most 1.
    parameters : mapping of str to object, optional
        Values of the scene's $-parameters, for a name or a file.
    max_bounces : int, "auto" or None
        Largest number of reflections, instead of the scene's. "auto" chooses it from a pilot run,
        so that at most a tenth of the tolerance (default: 1 %) is left out. The errors include this
        part.
    parts : bool
        Split the intensities by number of reflections, by emitting group and by the group that is
        seen first.

    Returns
    -------
    Signature

    Raises
    ------
    InputError
        If the sensor is not orthographic, if `by_spectrum` is asked of the band "total", if a
        number of paths is given beside a tolerance, or if a tolerance cannot be reached.
    """
    sampling = sampling_of(
        spp=spp, tolerance=tolerance, max_spp=max_spp, seed=seed, sensor=sensor, progress=progress
    )
    scene = scene_of(scene, parameters)
    with reflecting(scene, max_bounces, each_pixel=False, sampling=sampling):
        split = PARTS if parts else ()
        found = measure_signature(scene, sampling, by_spectrum, facets, excess, parts=split)
        return with_left_out(found, scene, sampling)


# `chart`, error against processor time over the ways to render a scene
# ---------------------------------------------------------------------


@exclusively
def chart(
    scene: SceneLike,
    tolerance: float | str = 0.01,
    seconds: float = 60.0,
    seed: int = 0,
    sensor: int = 0,
    progress: Progress | None = None,
    *,
    parameters: Mapping[str, object] | None = None,
) -> CostChart:
    """Compare settings with which a scene can be rendered: error of its intensity against time. The
    settings are the number of reflections, the reflection models (full, mirror or diffuse), and
    emitter sampling (on or off). The error of a setting includes the radiation that it leaves out.

    Parameters
    ----------
    scene : Scene, str, Path or mi.Scene
        A loaded scene, or what `mi_lcair.load` takes: a bundled name, a file, Mitsuba's own scene.
        Its sensor must be orthographic.
    tolerance : float or str
        Required error, as a fraction of the intensity, such as 0.01 or "1%". The error is half of
        the 95 % interval plus the reflections that are left out.
    seconds : float
        No further setting is tried after this time, s.
    seed, sensor : int
        As for `render`.
    progress : callable or None
        Called with (settings done, all settings).
    parameters : mapping of str to object, optional
        Values of the scene's $-parameters, for a name or a file.

    Returns
    -------
    CostChart

    Raises
    ------
    InputError
        If the sensor is not orthographic, or if a tolerance cannot be reached.
    """
    Bounds(is_positive=True, unit="s").check(seconds, "seconds")
    sampling = sampling_of(tolerance=tolerance, seed=seed, sensor=sensor, progress=progress)
    return measure_cost_chart(scene_of(scene, parameters), sampling, seconds)

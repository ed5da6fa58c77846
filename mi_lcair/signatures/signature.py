"""Intensity of a scene toward an orthographic sensor, with and without the background."""

import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

from mi_lcair.errors import InputError
from mi_lcair.plugins.recorders.channels import Channels
from mi_lcair.progress import Progress
from mi_lcair.rendering.criteria import ExcessFunction, IntensityInterval
from mi_lcair.rendering.facets.table import FacetTable
from mi_lcair.rendering.measurands import Measurands
from mi_lcair.rendering.measure import measure
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.scene import Scene, SceneLike, scene_of
from mi_lcair.rendering.settings import planned
from mi_lcair.rendering.statistics import Totals
from mi_lcair.rendering.window import Windows, window, window_area
from mi_lcair.signatures.effective_areas import effective_areas
from mi_lcair.signatures.facet_results import FacetSums
from mi_lcair.signatures.signature_result import Intensity, Signature

if TYPE_CHECKING:
    from mi_lcair.planning.plan import Plan


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
    plan: "Plan | str | None" = None,
) -> Signature:
    """Render a scene and integrate its radiance over the sensor's window.

    The intensity is int L dA, W/sr.

    Parameters
    ----------
    scene : Scene, str, Path or mi.Scene
        A loaded scene, or what `mi_lcair.load` takes: a bundled name, a file, Mitsuba's own scene.
        Its sensor must be orthographic.
    spp : int or None
        Number of paths, divided by the number of pixels of the sensor's film (the number in the
        scene). The paths begin anywhere in the window, not in one pixel each.
    tolerance : float, str or None
        Trace paths until the 95 % interval of the target's intensity is within this fraction of it,
        such as 0.01 or "1%", or until max_spp is reached. Without a target it is that of the
        scene's intensity.
    max_spp : int or None
        As `spp`: the largest number of paths with a tolerance (65536).
    seed, sensor : int
        As for `render`.
    progress : callable or None
        Called with (paths done, paths expected).
    by_spectrum : bool
        Also compute the effective area of each source in the scene.
    facets : bool
        Also compute the results of each facet of the model.
    excess : callable or None
        Instead of a tolerance: ratio of the error to the allowed error for the Signature (without
        facets) that the paths so far give. Paths are added until it is at most 1.
    parameters : mapping of str to object, optional
        Values of the scene's $-parameters, for a name or a file.
    plan : Plan, "auto" or None
        Trace paths under the settings of a plan that `mi_lcair.plan` made; "auto" makes one for the
        tolerance (1 %). The tolerance is then that of plan and noise together.

    Returns
    -------
    Signature

    Raises
    ------
    InputError
        If the sensor is not orthographic, if `by_spectrum` is asked of the band "total", if a
        number of paths is given beside a tolerance, or if a tolerance cannot be reached.
    """
    sampling = Sampling(
        spp=spp, tolerance=tolerance, max_spp=max_spp, seed=seed, sensor=sensor, progress=progress
    )
    scene = scene_of(scene, parameters)
    with planned(scene, plan, False, sampling) as (made, sampling):
        result = integrated(scene, sampling, by_spectrum, facets, excess)
    return replace(result, plan=made)


def integrated(
    scene: Scene,
    sampling: Sampling,
    by_spectrum: bool = False,
    facets: bool = False,
    excess: Callable[[Signature], float] | None = None,
) -> Signature:
    """The intensity of a loaded scene under its own settings; see `signature`."""
    if by_spectrum and scene.band.is_total:
        raise InputError(
            f"{scene.name}: band total has no wavelengths, so that its intensity has no spectrum; "
            "choose a band with limits"
        )
    start = time.perf_counter()
    camera = scene.sensor(sampling.sensor)
    area = window_area(camera, scene.name)

    def result(total: Totals) -> Signature:
        return Signature(
            scene_name=scene.name,
            band=scene.band.name,
            scene=intensity(total, "", area),
            target=intensity(total, "target.", area),
            effective_areas=effective_areas(total, scene, area) if by_spectrum else None,
            facets=None,
            window_area=area,
            seconds=time.perf_counter() - start,
            paths=int(total.traced.sum()),
            invalid=total.invalid,
            degrees_of_freedom=total.randomisations - 1,
            missed=float(total.missed("target")[0] * area),
            systematic=total.systematic,
            reached=total.reached,
            tolerance=sampling.tolerance,
        )

    criterion = None
    if excess is not None:
        criterion = ExcessFunction(lambda total: excess(result(total)))
    elif sampling.tolerance is not None:
        criterion = IntensityInterval(sampling.tolerance)
    sums = FacetSums(FacetTable(scene), scene.mi.integrator().max_bounces) if facets else None
    measurands = Measurands(Channels("target"), sums, by_spectrum)
    total = measure(scene, Windows.whole(camera), sampling, measurands, criterion)
    if not facets:
        return result(total)
    *_, direction = window(camera)
    return replace(
        result(total), facets=sums.results(scene.name, scene.band.name, area, -direction)
    )


def intensity(total: Totals, prefix: str, area: float) -> Intensity:
    """The Intensity whose parts have channels with a common prefix.

    Parameters
    ----------
    total : Totals
        Sums over the paths of one window.
    prefix : str
        "" for the scene, "target." for the target.
    area : float
        Area of the sensor's window, m^2.
    """
    whole = prefix.removesuffix(".") or None
    mean = lambda name: float(total.mean(name)[0] * area)
    error = lambda name: float(total.standard_error(name)[0] * area)

    def split(kind):
        """Values and standard errors of the parts of one kind, by name."""
        names = [name for name in total.sums if name.startswith(prefix + kind)]
        label = len(prefix + kind)
        return {name[label:]: mean(name) for name in names}, {
            name[label:]: error(name) for name in names
        }

    by_bounce, by_bounce_error = split("bounce.")
    by_group, by_group_error = split("group.")
    by_seen, by_seen_error = split("seen.")
    return Intensity(
        intensity=mean(whole),
        standard_error=error(whole),
        half_width=float(total.half_width(whole)[0] * area),
        by_bounce=list(by_bounce.values()),
        by_bounce_error=list(by_bounce_error.values()),
        by_group=by_group,
        by_group_error=by_group_error,
        by_seen=by_seen,
        by_seen_error=by_seen_error,
        closure=mean(f"{prefix}closure"),
    )

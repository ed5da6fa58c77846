"""Intensity of a scene toward an orthographic sensor, with and without the background."""

import time
from collections.abc import Callable
from dataclasses import replace

from mi_lcair.plugins.paths.aim import Aim
from mi_lcair.plugins.recorders.channels import Channels
from mi_lcair.rendering.facets.table import FacetTable
from mi_lcair.rendering.measurands import ExcessFunction, IntensityInterval, Measurands
from mi_lcair.rendering.measure import measure
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.scene import Scene
from mi_lcair.rendering.statistics import Totals
from mi_lcair.rendering.window import Windows, window, window_area
from mi_lcair.signatures.effective_areas import effective_areas
from mi_lcair.signatures.facet_results import FacetSums
from mi_lcair.signatures.signature_result import Intensity, Signature


def measure_signature(
    scene: Scene,
    sampling: Sampling,
    by_spectrum: bool = False,
    facets: bool = False,
    excess: Callable[[Signature], float] | None = None,
    aim: Aim | None = None,
    up_to: tuple[int, ...] = (),
) -> Signature:
    """Integrate the radiance of a loaded scene over a sensor's window, under its own settings.

    Parameters
    ----------
    scene : Scene
    sampling : Sampling
        Its tolerance is half of the 95 % interval of the intensity, as a fraction of it.
    by_spectrum : bool
        Whether to compute the effective area of each source.
    facets : bool
        Whether to compute the results of each facet of the model.
    excess : callable or None
        Instead of a tolerance: ratio of the error to the allowed error, see `Criterion`.
    aim : Aim or None
        Where in the window the paths begin, see `measure`.
    up_to : tuple of int
        Smaller numbers of reflections for `fewer` of the signature. They need `by_spectrum`.
    """
    if by_spectrum:
        scene.band.check_limits(f"{scene.name}: spectrum")
    start = time.perf_counter()
    camera = scene.sensor(sampling.sensor)
    area = window_area(camera, scene.name)

    # A function that calls itself would keep the scene until the garbage collector runs, and Dr.Jit
    # compiles kernels for all scenes that are alive.
    def with_fewer(total: Totals, fewer: tuple[Signature, ...]) -> Signature:
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
            aim=total.aim,
            bins=total.bins,
            remarks=scene.notes,
            fewer=fewer,
        )

    def result(total: Totals) -> Signature:
        return with_fewer(total, tuple(with_fewer(total.up_to(most), ()) for most in up_to))

    criterion = None
    if excess is not None:
        criterion = ExcessFunction(lambda total: excess(result(total)))
    elif sampling.tolerance is not None:
        criterion = IntensityInterval(sampling.tolerance)
    sums = FacetSums(FacetTable(scene), scene.mi.integrator().max_bounces) if facets else None
    measurands = Measurands(Channels("target", up_to=up_to), sums, by_spectrum)
    # A caller with a criterion of its own takes the aim to other scenes
    windows = replace(Windows.whole(camera), may_follow_facets=excess is None)
    total = measure(scene, windows, sampling, measurands, criterion, aim)
    if not facets:
        return result(total)
    *_, direction = window(camera)
    return replace(result(total), facets=sums.results(scene, total, area, -direction))


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

    def mean(name):
        return float(total.mean(name)[0] * area)

    def error(name):
        return float(total.standard_error(name)[0] * area)

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

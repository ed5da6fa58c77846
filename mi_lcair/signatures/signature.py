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
from mi_lcair.rendering.statistics import WHOLES, Totals
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
            **intensities(total, area),
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


def intensities(total: Totals, area: float) -> dict[str, Intensity]:
    """The Intensity of the scene and of the target.

    Parameters
    ----------
    total : Totals
        Sums over the paths of one window.
    area : float
        Area of the sensor's window, m^2.
    """
    channels = [None, *total.sums]
    means, errors = (
        dict(zip(channels, (numbers[:, 0] * area).tolist()))
        for numbers in (total.mean(channels), total.standard_error(channels))
    )
    half_widths = (total.half_width(list(WHOLES))[:, 0] * area).tolist()

    def parts(numbers: dict, beginning: str) -> dict[str, float]:
        return {
            name.removeprefix(beginning): number
            for name, number in numbers.items()
            if name is not None and name.startswith(beginning)
        }

    return {
        prefix.removesuffix(".") or "scene": Intensity(
            intensity=means[whole],
            standard_error=errors[whole],
            half_width=half_width,
            by_bounce=list(parts(means, f"{prefix}bounce.").values()),
            by_bounce_error=list(parts(errors, f"{prefix}bounce.").values()),
            by_group=parts(means, f"{prefix}group."),
            by_group_error=parts(errors, f"{prefix}group."),
            by_seen=parts(means, f"{prefix}seen."),
            by_seen_error=parts(errors, f"{prefix}seen."),
            closure=means[f"{prefix}closure"],
        )
        for whole, prefix, half_width in zip(WHOLES, ("", "target."), half_widths)
    }

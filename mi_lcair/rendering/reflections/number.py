"""The number of reflections that a tolerance needs."""

from collections.abc import Sequence
from contextlib import AbstractContextManager, nullcontext
from numbers import Integral

from mi_lcair.declared import percent
from mi_lcair.errors import InputError, unknown
from mi_lcair.plugins.recorders.by_bounce import SIZES
from mi_lcair.rendering.reflections.bounces import fewest_bounces
from mi_lcair.rendering.reflections.probe import Probe
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.scene import Scene
from mi_lcair.rendering.settings import changed
from mi_lcair.rendering.statistics import student_factor
from mi_lcair.rendering.views import View, seen_from
from mi_lcair.startup.threads import exclusively

DEFAULT_TOLERANCE = 0.01  # error that is allowed for a fixed number of samples
SHARE = 0.1  # part of the tolerance that reflections beyond the largest number may use
# Paths of a pilot that may have missed a bright source, as multiples of their usual number
FACTORS = (1, 4, 16)
MOST_VIEWS = 4  # largest number of views that are tried
MOST = (16, SIZES[-1] - 1)  # largest numbers of reflections of the pilots, tried in this order


def reflecting(
    scene: Scene, max_bounces: int | str | None, each_pixel: bool, sampling: Sampling
) -> AbstractContextManager:
    """Context manager in which paths of a scene have so many reflections, see `bounce_settings`."""
    if max_bounces is None:
        return nullcontext()
    return changed(scene, **bounce_settings(scene, max_bounces, each_pixel, sampling))


@exclusively
def bounce_settings(
    scene: Scene,
    max_bounces: int | str | None,
    each_pixel: bool,
    sampling: Sampling,
    views: Sequence[View] = (),
) -> dict[str, object]:
    """Settings of bounce_path for a number of reflections.

    A few pilot paths give the radiance by number of reflections. "auto" is the smallest number
    beyond which at most a tenth of the tolerance lies, with 95 % confidence; a geometric series
    continues the last pilot. What may lie beyond it is part of all errors. All reflections of a
    pilot are followed if it may have missed a source that is worth more than the tolerance.

    Parameters
    ----------
    scene : Scene
    max_bounces : int, "auto" or None
        None: the scene's own number, which needs no settings.
    each_pixel : bool
        Whether the tolerance is that of the rms error over the pixels, not of the mean radiance.
    sampling : Sampling
        Its tolerance, or 1 % without one, decides.
    views : sequence of View
        Views of the model in place of the sensor; some of them are tried.

    Raises
    ------
    InputError
        If max_bounces is no number that bounce_path takes, or if the pilots' largest number is not
        enough.
    """
    if max_bounces is None:
        return {}
    if isinstance(max_bounces, str) and max_bounces.isdecimal():
        max_bounces = int(max_bounces)
    if isinstance(max_bounces, Integral):
        return {"max_bounces": int(max_bounces), "truncation": 0.0}
    if max_bounces != "auto":
        raise unknown("max_bounces", str(max_bounces), ["auto", "a whole number"])
    some = views[:: -(-len(views) // MOST_VIEWS)] if views else ()
    tried = [seen_from(scene, view, 1) for view in some] or [scene]
    limits = [needed_bounces(seen, each_pixel, sampling) for seen in tried]
    limits = [limit for limit in limits if limit is not None]
    if not limits:
        raise InputError(
            f"{scene.name}: max_bounces = auto finds no number, because no pilot path meets "
            "radiance; give a number"
        )
    numbers, errors = zip(*limits)
    return {"max_bounces": max(numbers), "truncation": max(errors)}


def needed_bounces(scene: Scene, each_pixel: bool, sampling: Sampling) -> tuple[int, float] | None:
    """The smallest number of reflections, and the relative standard error of what is beyond.

    None if no path meets radiance.
    """
    tolerance = sampling.tolerance or DEFAULT_TOLERANCE
    budget = SHARE * tolerance
    for most in MOST:
        with changed(scene, max_bounces=most, closure="none", ambient_temperature=None):
            for factor in FACTORS:
                probe = Probe.of(scene, each_pixel, sampling.seed, sampling.sensor, factor)
                if probe.may_lack <= tolerance:
                    break
        if not probe.by_bounce.any():
            return None
        number, error = fewest_bounces(probe.by_bounce, budget, each_pixel)
        if probe.may_lack > tolerance:  # what no path has met may come after any reflection
            number = most
        if error <= budget:
            return number, error / student_factor(float("inf"))
    raise InputError(
        f"{scene.name}: max_bounces = auto finds no number: {percent(error)} of the mean may lie "
        f"beyond {most} reflections, and {percent(budget)} is allowed; give a number"
    )

"""The number of reflections that a tolerance needs."""

from collections.abc import Iterator
from contextlib import contextmanager

from mi_lcair.errors import InputError, unknown
from mi_lcair.fraction import percent
from mi_lcair.planning.bounces import fewest_bounces
from mi_lcair.planning.probe import Probe
from mi_lcair.plugins.recorders.by_bounce import SIZES
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.scene import Scene
from mi_lcair.rendering.settings import changed
from mi_lcair.rendering.statistics import student_factor

DEFAULT_TOLERANCE = 0.01  # error that is allowed for a fixed number of samples
SHARE = 0.1  # part of the tolerance that reflections beyond the largest number may use
# Paths of a pilot that may have missed a bright source, as multiples of their usual number
FACTORS = (1, 4, 16)
MOST = (16, SIZES[-1] - 1)  # largest numbers of reflections of the pilots, tried in this order


@contextmanager
def reflecting(
    scene: Scene, max_bounces: int | str | None, each_pixel: bool, sampling: Sampling
) -> Iterator[None]:
    """Context manager in which paths of a scene have so many reflections.

    A few pilot paths give the radiance by number of reflections. "auto" is the smallest number
    beyond which at most a tenth of the tolerance lies, with 95 % confidence; a geometric series
    continues the last pilot. What may lie beyond it is part of all errors. All reflections of a
    pilot are followed if it may have missed a source that is worth more than the tolerance.

    Parameters
    ----------
    scene : Scene
    max_bounces : int, "auto" or None
        None: the scene's own number.
    each_pixel : bool
        Whether the tolerance is that of the rms error over the pixels, not of the mean radiance.
    sampling : Sampling
        Its tolerance, or 1 % without one, decides.

    Raises
    ------
    InputError
        If max_bounces is no number that bounce_path takes, or if the pilots' largest number is not
        enough.
    """
    if max_bounces is None:
        yield
        return
    if isinstance(max_bounces, str) and max_bounces.isdecimal():
        max_bounces = int(max_bounces)
    truncation = 0.0
    if max_bounces == "auto":
        max_bounces, truncation = enough(scene, each_pixel, sampling)
    elif not isinstance(max_bounces, int):
        raise unknown("max_bounces", str(max_bounces), ["auto", "a whole number"])
    with changed(scene, max_bounces=max_bounces, truncation=truncation):
        yield


def enough(scene: Scene, each_pixel: bool, sampling: Sampling) -> tuple[int, float]:
    """The smallest number of reflections, and the relative standard error of what is beyond."""
    tolerance = sampling.tolerance or DEFAULT_TOLERANCE
    budget = SHARE * tolerance
    for most in MOST:
        with changed(scene, max_bounces=most, closure="none", ambient_temperature=None):
            for factor in FACTORS:
                probe = Probe.of(scene, each_pixel, sampling.seed, sampling.sensor, factor)
                if probe.may_lack <= tolerance:
                    break
        number, error = fewest_bounces(probe.by_bounce, budget, each_pixel)
        if probe.may_lack > tolerance:  # what no path has met may come after any reflection
            number = most
        if error <= budget:
            return number, error / student_factor(float("inf"))
    raise InputError(
        f"{scene.name}: max_bounces = auto finds no number: {percent(error)} of the mean may lie "
        f"beyond {most} reflections, and {percent(budget)} is allowed; give a number"
    )

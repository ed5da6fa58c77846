"""How many reflections a tolerance needs."""

from collections.abc import Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from math import gcd
from numbers import Integral

import numpy as np

from mi_lcair.declared import percent
from mi_lcair.errors import InputError, unknown
from mi_lcair.plugins.paths.launch import Aim, Launch
from mi_lcair.plugins.recorders.channels import Channels
from mi_lcair.plugins.recorders.radiance import SIZES, in_all_windows
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.scene import Scene, changed
from mi_lcair.rendering.statistics import UNSEEN, student_factor
from mi_lcair.rendering.views import View, seen_from
from mi_lcair.tasks import exclusively

# How many reflections a render must follow, from the radiance of each number of reflections
# ------------------------------------------------------------------------------------------

LARGEST_RATIO = 0.999  # ratio of successive bounces; a larger one is mostly noise
FEWEST = 4  # numbers of reflections from which on pairs are compared
KNOWN = 3  # standard errors, above which an intensity is known well enough to continue it


def fewest_bounces(by_bounce: np.ndarray, budget: float, each_pixel: bool) -> tuple[int, float]:
    """The smallest number of reflections whose truncation error is within a budget.

    Beyond the last probed number, the truncation error is estimated by a geometric series.

    Parameters
    ----------
    by_bounce : ndarray, shape (R, n, pixels)
        Radiance, W m^-2 sr^-1, of paths with 0, 1, ... n - 1 reflections, by randomisation.
    budget : float
        Error that is allowed, as a fraction of the mean radiance.
    each_pixel : bool
        Whether the error is the rms over the pixels. Otherwise it is that of their mean.

    Returns
    -------
    bounces : int
        Number of reflections. It is the last probed one if no number meets the budget.
    error : float
        Upper bound (95 %) of the truncation error, as a fraction of the mean radiance.
    """
    by_pixel = by_bounce.mean(axis=0)  # (n, pixels); no radiance is negative, so noise adds little
    by_batch = by_bounce.mean(axis=2)  # (R, n)
    means = by_pixel.mean(axis=1)  # (n,)
    last = len(means) - 1
    beyond = beyond_last(means)
    total = means.sum() + beyond * ending(means)
    beyond_by_batch = beyond * ending(by_batch.T)
    total_by_batch = by_batch.sum(axis=1) + beyond_by_batch

    def bound(n: int) -> float:
        """Upper bound of the radiance of more than n reflections, relative to the mean."""
        if each_pixel:
            missing = by_pixel[n + 1 :].sum(axis=0) + beyond * ending(by_pixel)
            return float(np.sqrt(np.mean(missing**2)) / total)
        missing = by_batch[:, n + 1 :].sum(axis=1) + beyond_by_batch
        # A batch that has met no radiance knows nothing: all of it may be missing
        whole, met = np.ones(len(total_by_batch)), total_by_batch > 0
        return upper(np.divide(missing, total_by_batch, out=whole, where=met))

    best = (last, bound(last))
    for n in range(last, -1, -1):
        error = bound(n)
        if error > budget:
            break
        best = (n, error)
    return best


def beyond_last(means: np.ndarray, summed: int = 0) -> float:
    """Estimate of all reflections beyond the last recorded number, relative to `ending`.

    The reflections are continued by a geometric series, with the mean ratio of the last quarter of
    the numbers. Pairs of numbers are compared, because two surfaces may take turns.

    Parameters
    ----------
    means : ndarray, shape (n,)
        Mean radiance of paths with 0, 1, ... n - 1 reflections.
    summed : int
        Larger numbers of reflections that the last entry holds too.
    """
    ratio = min(mean_ratio(means[:-1] if summed else means), LARGEST_RATIO)
    ratio **= summed + 1 if summed or len(means) < FEWEST else 2
    return ratio / (1 - ratio)


def mean_ratio(means: np.ndarray) -> float:
    """Mean ratio of successive numbers in the last quarter of them; 0 if there was nothing."""
    count, step = len(means), 2 if len(means) >= FEWEST else 1
    span = step * max(1, count // (4 * step))
    before = means[max(count - span - step, 0) : count - span].sum()
    return (means[-step:].sum() / before) ** (1 / span) if count > 1 and before > 0 else 0.0


def ending(by_bounce: np.ndarray, summed: int = 0) -> np.ndarray:
    """The sum of the last entries along the first axis, from which `beyond_last` continues."""
    return by_bounce[-1 if summed or len(by_bounce) < FEWEST else -2 :].sum(axis=0)


def left_out(by_bounce: Sequence[float], errors: Sequence[float], most: int) -> float | None:
    """Estimate of the reflections beyond the largest number; None where it is not known.

    The series is continued only where it falls and its end is known.

    Parameters
    ----------
    by_bounce, errors : sequence of float
        Intensity of the paths with 0, 1, ... reflections, and its standard error. The last entry
        may hold larger numbers of reflections too.
    most : int
        Largest number of reflections.
    """
    values, summed = np.array(by_bounce), most + 1 - len(by_bounce)
    end = ending(values, summed)
    if len(values) < FEWEST or end <= KNOWN * np.sqrt(ending(np.square(errors), summed)):
        return None
    is_falling = mean_ratio(values[:-1] if summed else values) < LARGEST_RATIO
    return float(beyond_last(values, summed) * end) if is_falling else None


def share_left_out(
    scene: Scene, sampling: Sampling, views: Sequence[View] = (), known: float | None = None
) -> float | None:
    """Share of the radiance that a tolerance leaves out beyond the scene's largest number.

    None without a tolerance, and where a closure or the errors hold what is beyond. The largest
    share of some views, if there are views. known: the share, as the render itself tells it; a
    pilot decides where the render has few reflections, or where this share counts.
    """
    integrator, tolerance = scene.mi.integrator(), sampling.tolerance
    is_cut = integrator.closure == "none" and not integrator.truncation
    if tolerance is None or not is_cut or integrator.max_bounces >= MOST[-1]:
        return None
    if integrator.max_bounces >= MOST[0] and known is not None and known <= SHARE * tolerance:
        return known
    return max(share_beyond(seen, sampling) for seen in some_of(scene, views))


def counts(share: float, error: float, tolerance: float | None) -> bool:
    """Whether a share that is left out counts, beside an error that is known.

    It does where it takes more of a tolerance than "auto" allows, and breaks it. Without one, it
    does where it is larger than the error.
    """
    if tolerance is None:
        return share > error
    return share > SHARE * tolerance and np.hypot(share, error) > tolerance


def words_on_paths(integrator, is_open: bool = False) -> str:
    """What paths follow under the settings of bounce_path, in words.

    is_open: whether pilots decide on settings that are still `auto`. Otherwise they are off.
    """
    count, emitters = integrator.max_bounces, integrator.emitter_sampling
    words = f"{count} reflection{'s' * (count != 1)}"
    if integrator.truncation:
        bound = percent(student_factor(float("inf")) * integrator.truncation)
        words += f" (auto: at most {bound} is beyond)"
    elif integrator.closure != "none":
        words += f", the rest by closure = {integrator.closure}"
    is_left = emitters == "auto" and is_open
    is_drawn = emitters if emitters != "auto" else False
    words += f"; emitters {'drawn' if is_drawn or is_left else 'not drawn'}" * (count > 0)
    words += " where that saves paths" * (is_left and count > 0)
    return words + "; paths kept inside openings" * (integrator.opening_sampling is True)


def followed_row(followed: str, share: float | None = None) -> tuple[str, str]:
    """Row (label, text) about what paths follow, and the share that is left out, if it is known."""
    rest = f"about {percent(share)}" if share else "nothing measurable"
    return "followed", followed + f"; the rest would add {rest}" * (share is not None)


def words_on_left_out(worth: str) -> str:
    """A remark on reflections that are left out."""
    return (
        f"reflections beyond max_bounces, worth about {worth}, are left out, and the errors do "
        "not include them; raise max_bounces, or set it to auto"
    )


def share_beyond(scene: Scene, sampling: Sampling) -> float:
    """Share of all reflections that are beyond the scene's largest number, from a pilot.

    It is less than the pilot's, MOST[-1]. 0 if the share is less than twice its standard error.
    """
    most = scene.mi.integrator().max_bounces
    with changed(scene, max_bounces=MOST[-1], closure="none", ambient_temperature=None):
        probe = Probe.of(scene, False, sampling.seed, sampling.sensor, 1)
    by_batch = probe.by_bounce[:, :, 0].T  # (n, R)
    beyond = beyond_last(by_batch.mean(axis=1)) * ending(by_batch)
    missing, whole = by_batch[most + 1 :].sum(axis=0) + beyond, by_batch.sum(axis=0) + beyond
    error = missing.std(ddof=1) / np.sqrt(len(missing))
    return float(missing.mean() / whole.mean()) if missing.mean() > 2 * error else 0.0


def upper(values: np.ndarray) -> float:
    """Upper bound (95 %) of the absolute value of the mean of independent values."""
    half_width = student_factor(len(values) - 1) * values.std(ddof=1) / np.sqrt(len(values))
    return float(abs(values.mean()) + half_width)


# Probes: small launches through some pixels or a whole window, by number of reflections
# --------------------------------------------------------------------------------------

# Randomisations of a probe. In a window their number decides how well the noise is known.
WINDOW_RANDOMISATIONS, PIXEL_RANDOMISATIONS = 64, 8
WINDOW_POINTS, PIXEL_POINTS = 2**7, 2  # points of each randomisation
# A probe of pixels takes one of 16, so that it costs little compared with the
# image. They are spread over the image. Their number lies between the limits, if the image has as
# many.
PIXEL_SHARE, LEAST_PIXELS, MOST_PIXELS = 16, 2**6, 2**11


@dataclass(frozen=True)
class Probe:
    """Radiance, W m^-2 sr^-1, of a window or of some pixels of a scene.

    Attributes
    ----------
    by_bounce : ndarray, shape (R, n, P)
        Mean radiance after 0, 1, ... n - 1 reflections of each randomisation and pixel. It is that
        of the whole image for a probe of pixels. Otherwise it is that of the model's facets, and
        P = 1.
    may_lack : float
        Upper bound of what a source that no path has hit adds, as a fraction of the mean.
    """

    by_bounce: np.ndarray
    may_lack: float

    @staticmethod
    def of(scene: Scene, each_pixel: bool, seed: int, sensor: int, factor: int) -> "Probe":
        """A probe of some pixels of a scene, or of its whole window.

        factor: points of each randomisation, as a multiple of the usual number.
        """
        camera = scene.sensor(sensor)
        split, prefix = ("image", "") if each_pixel else ("target", "target.")
        if each_pixel:
            launch = pixels_launch(*camera.film().crop_size(), seed, factor)
        else:
            points = WINDOW_POINTS * factor
            launch = Launch(1, 1, seed, WINDOW_RANDOMISATIONS, points, aim=Aim.anywhere())
        with scene.prepared() as tracer:
            sums = tracer.trace(camera, launch, Channels(split, ("bounce",)))
            unmet, noted = tracer.unmet_sources(camera), in_all_windows(sums.unmet)
        valid = np.maximum(sums.valid, 1)
        names = [name for name in sums.channels if name.startswith(f"{prefix}bounce.")]
        by_bounce = np.stack([(sums.channels[name] / valid).T for name in names], axis=1)
        chance = UNSEEN * max(unmet.in_view, float(unmet.after_reflection(noted)))
        mean = by_bounce.sum(axis=1).mean()
        return Probe(by_bounce, chance / (launch.paths * mean) if mean > 0 else np.inf)


def pixels_launch(width: int, height: int, seed: int, factor: int) -> Launch:
    """The launch of a probe of some pixels of an image."""
    wanted = np.clip(width * height // PIXEL_SHARE, LEAST_PIXELS, MOST_PIXELS)
    stride = max(1, width * height // int(wanted))
    # A stride with a divisor of the width would put all pixels into a few columns.
    while gcd(stride, width) > 1:
        stride += 1
    paths = PIXEL_RANDOMISATIONS, PIXEL_POINTS * factor
    count = -(-width * height // stride)
    return Launch(width, height, seed, *paths, windows=count, stride=stride)


# The number of reflections that a tolerance needs
# ------------------------------------------------

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
    if isinstance(max_bounces, Integral) and not isinstance(max_bounces, bool):
        return {"max_bounces": int(max_bounces), "truncation": 0.0}
    if max_bounces != "auto":
        raise unknown("max_bounces", str(max_bounces), ["auto", "a whole number"])
    limits = [needed_bounces(seen, each_pixel, sampling) for seen in some_of(scene, views)]
    limits = [limit for limit in limits if limit is not None]
    if not limits:
        raise InputError(
            f"{scene.name}: max_bounces = auto finds no number, because no path of the test run "
            "finds radiance; give a number"
        )
    numbers, errors = zip(*limits)
    return {"max_bounces": max(numbers), "truncation": max(errors)}


def some_of(scene: Scene, views: Sequence[View]) -> list[Scene]:
    """The scene as seen from at most MOST_VIEWS of the views; without views, the scene itself."""
    some = views[:: -(-len(views) // MOST_VIEWS)] if views else ()
    return [seen_from(scene, view, 1) for view in some] or [scene]


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

"""How many reflections a render must follow, from the radiance of each number of reflections."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.planning.ambient import ambient_closure
from mi_lcair.planning.probe import Probe, ProbeSeries, Settings, upper

BOUNCE_SHARE = 0.15  # share of the tolerance that fewer reflections may use
LARGEST_RATIO = 0.999  # ratio of successive bounces; a larger one is mostly noise
LEAST_FALL = 1e-6  # relative fall from one bounce to the next that a geometric tail needs


def fewest_bounces(
    by_bounce: np.ndarray, budget: float, each_pixel: bool, reflections: int | None = None
) -> tuple[int, str, float]:
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
    reflections : int or None
        Number up to which the last entry sums; None for n - 1. No tail is found for such a sum.

    Returns
    -------
    bounces : int
        Number of reflections. It is the last probed one if no number meets the budget.
    closure : str
        "tail" if a geometric tail must be added to meet the budget, otherwise "none".
    error : float
        Upper bound (95 %) of the truncation error, as a fraction of the mean radiance.
    """
    by_pixel = by_bounce.mean(axis=0)  # (n, pixels); no radiance is negative, so noise adds little
    by_batch = by_bounce.mean(axis=2)  # (R, n)
    means = by_pixel.mean(axis=1)  # (n,)
    last = len(means) - 1
    summed = 0 if reflections is None else reflections - last  # entries added to the last one
    beyond = beyond_last(means, summed)
    total = means.sum() + beyond * means[last]
    total_by_batch = by_batch.sum(axis=1) + beyond * by_batch[:, last]

    def missing(n):
        """Radiance of more than n reflections, by pixel and by batch."""
        return (
            by_pixel[n + 1 :].sum(axis=0) + beyond * by_pixel[last],
            by_batch[:, n + 1 :].sum(axis=1) + beyond * by_batch[:, last],
        )

    def tail(n):
        """Estimate of missing(n) by a geometric series through bounces n - 1 and n."""
        factor = means[n] / (means[n - 1] - means[n]) if means[n] < means[n - 1] else 0.0
        before, at = by_batch[:, n - 1], by_batch[:, n]
        fall = np.maximum(before - at, LEAST_FALL * before)
        # A batch whose bounces do not fall has no tail.
        of_batches = np.divide(at**2, fall, out=np.zeros(len(at)), where=fall > 0)
        return factor * by_pixel[n], of_batches

    def bound(error_by_pixel, error_by_batch):
        """Upper bound of an error, relative to the mean radiance."""
        if each_pixel:
            return float(np.sqrt(np.mean(error_by_pixel**2)) / total)
        # A batch that has met no radiance knows nothing: all of it may be missing
        whole, met = np.ones(len(total_by_batch)), total_by_batch > 0
        relative = np.divide(error_by_batch, total_by_batch, out=whole, where=met)
        return upper(relative, signed=True)

    # Truncate as early as the budget allows.
    best = (last + summed, "none", bound(*missing(last)))
    for n in range(last - bool(summed), -1, -1):
        error = bound(*missing(n))
        if error > budget:
            break
        best = (n, "none", error)
    # Take a tail if it saves two reflections or more, or if truncation alone never suffices.
    for n in range(2, 0 if summed else last if best[2] > budget else best[0] - 1):
        error = bound(*(truth - estimate for truth, estimate in zip(missing(n), tail(n))))
        if error <= budget:
            return n, "tail", error
    return best


def beyond_last(means: np.ndarray, summed: int = 0) -> float:
    """Estimate of all reflections beyond the last recorded number, relative to the last entry.

    The reflections are continued by a geometric series.

    Parameters
    ----------
    means : ndarray, shape (n,)
        Mean radiance of paths with 0, 1, ... n - 1 reflections.
    summed : int
        Larger numbers of reflections that the last entry holds too.
    """
    if len(means) < 2:
        return 0.0
    last, before = means[-1], means[-2]
    if summed:
        whole = last + before
        return min(last / whole, LARGEST_RATIO) ** (summed + 1) if whole > 0 else 0.0
    ratio = min(last / before, LARGEST_RATIO) if before > 0 else 0.0
    return ratio / (1 - ratio)


def reflections_needed(probes: ProbeSeries, probe: Probe, budget: float) -> tuple[int, str, float]:
    """Number of reflections, closure and error for a budget, see `fewest_bounces`."""
    reflections = None if probe.is_complete else probe.reflections
    return fewest_bounces(probe.by_bounce, budget, probes.each_pixel, reflections)


def truncation_error(probes: ProbeSeries, probe: Probe) -> float:
    """Upper bound of what is missing after all reflections of a probe."""
    *_, error = reflections_needed(probes, probe, budget=0.0)
    return error


def check_bounces(
    probes: ProbeSeries, bounces: int, full: Settings, error: float, tolerance: float
) -> None:
    """Raise InputError if the error of following `bounces` reflections is not below `tolerance`."""
    if not error < tolerance:
        raise InputError(
            f"{probes.scene.name}: no plan for {tolerance:.2%}: what lies beyond {bounces} "
            f"reflections may be {error:.2%} of the mean, and no more than {full.max_bounces} were "
            "probed; allow a larger tolerance, or set max_bounces and --tolerance yourself"
        )


def fewer_bounces(
    probes: ProbeSeries, full: Settings, reference: Probe, tolerance: float, pays: Callable
) -> tuple[Probe, Settings, float, Probe | None, list[str]]:
    """The settings with the fewest reflections, and with a closure if that saves more.

    Parameters
    ----------
    probes : ProbeSeries
    full : Settings
        Settings of full fidelity.
    reference : Probe
        Probe under `full`.
    tolerance : float
        Error that is allowed, as a fraction of the mean radiance.
    pays : callable
        Whether saving this number of rays a path is worth a new kernel.

    Returns
    -------
    reference : Probe
        A probe under `full`, which counts more reflections separately if that was necessary.
    settings : Settings
    error : float
        Upper bound (95 %) of the error, as a fraction of the mean radiance.
    probe : Probe or None
        A probe under `settings`, if one was needed.
    left_out : list of str

    Raises InputError if no number that was probed suffices.
    """
    budget = BOUNCE_SHARE * tolerance
    bounces, closure, error = reflections_needed(probes, reference, budget)
    if not reference.is_complete and bounces == full.max_bounces:
        reference = probes(full)
        bounces, closure, error = reflections_needed(probes, reference, budget)
    check_bounces(probes, bounces, full, error, tolerance)
    if reference.is_complete and not pays(full.max_bounces - bounces):
        # The kernel for all reflections is compiled already
        error_of_all = truncation_error(probes, reference)
        if error_of_all <= budget:
            bounces, closure, error = full.max_bounces, "none", error_of_all
    settings = replace(full, max_bounces=bounces, closure=closure)
    probe = None
    fewer = range(bounces - 2)  # one more ray than these numbers say, and two saved at least
    if fewer and pays(bounces - 1):
        without = replace(full, closure="none")
        ambient = ambient_closure(probes, without, reference, fewer, budget)
        if ambient is not None:
            settings, error, probe = ambient
    if not error > 0:
        return reference, settings, error, probe, []
    beyond = {
        "none": "",
        "tail": " but for their geometric continuation",
        "ambient": " but for a blackbody at "
        f"{settings.ambient_temperature or 0:.1f} K that stands for them",
    }[settings.closure]
    remark = f"reflections beyond {settings.max_bounces}{beyond}: at most {error:.2g} of the mean"
    return reference, settings, error, probe, [remark]

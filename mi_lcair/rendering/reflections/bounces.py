"""How many reflections a render must follow, from the radiance of each number of reflections."""

import numpy as np

from mi_lcair.rendering.statistics import student_factor

LARGEST_RATIO = 0.999  # ratio of successive bounces; a larger one is mostly noise


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
    total = means.sum() + beyond * means[last]
    total_by_batch = by_batch.sum(axis=1) + beyond * by_batch[:, last]

    def bound(n: int) -> float:
        """Upper bound of the radiance of more than n reflections, relative to the mean."""
        if each_pixel:
            missing = by_pixel[n + 1 :].sum(axis=0) + beyond * by_pixel[last]
            return float(np.sqrt(np.mean(missing**2)) / total)
        missing = by_batch[:, n + 1 :].sum(axis=1) + beyond * by_batch[:, last]
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


def upper(values: np.ndarray) -> float:
    """Upper bound (95 %) of the absolute value of the mean of independent values."""
    half_width = student_factor(len(values) - 1) * values.std(ddof=1) / np.sqrt(len(values))
    return float(abs(values.mean()) + half_width)

"""How many reflections a render must follow, from the radiance of each number of reflections."""

import numpy as np

from mi_lcair.planning.probe import upper

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
    # Sum of the series beyond the probed numbers, relative to the last entry
    if summed:
        whole = means[last] + means[last - 1]
        beyond = min(means[last] / whole, LARGEST_RATIO) ** (summed + 1) if whole > 0 else 0.0
    else:
        ratio = min(means[last] / means[last - 1], LARGEST_RATIO) if means[last - 1] > 0 else 0.0
        beyond = ratio / (1 - ratio)
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
        return upper(error_by_batch / total_by_batch, signed=True)

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

"""Intervals of estimated values: Student's factor, correlations and profile likelihoods.

The end of a profile interval is where the cost, with all other unknowns at their best, is as much
higher as 95 % of noise makes it (Venzon and Moolgavkar 1988).
"""

from collections.abc import Callable

import numpy as np
from scipy.special import stdtrit

STEPS = 16  # largest number of places at which a profile is computed
NARROW = 0.02  # relative error with which the end of a profile is found
GROWTH = 3.0  # largest factor from one place of a profile to the next


def student_factor(freedom: float) -> float:
    """Half of Student's 95 % interval, in standard errors; infinite without a degree of freedom."""
    return float(stdtrit(freedom, 0.975)) if freedom > 0 else np.inf


def correlation(covariance: np.ndarray) -> np.ndarray:
    """Correlation matrix (n, n) of a covariance matrix (n, n)."""
    size = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    ratio = np.clip(covariance / np.outer(size, size), -1, 1)
    return np.where(np.eye(len(covariance), dtype=bool), 1.0, ratio)


def inner_deviation(rows: np.ndarray, least: float = 0.0) -> float:
    """Standard deviation of rows from their median absolute value, which outliers do not affect."""
    return max(1.4826 * float(np.median(np.abs(rows))), least)


def profile_ends(
    refit: Callable, best: np.ndarray, minimum: np.ndarray, first, bound, level: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Search the ends of profile intervals, all of them at once.

    Parameters
    ----------
    refit
        Function of numbers of profiles (k,), values (k,) that these profiles' unknowns are held
        at, and minima (k, n) from which the other unknowns start. It returns distances from the
        estimate (k,), in standard errors, and the minima (k, n) that it found.
    best, first, bound
        Estimate of each profile's unknown, the first value that is tried, and the bound on that
        side, (m,).
    minimum
        Coordinates of the estimate, (n,).
    level
        Distance at which an interval ends.

    Returns
    -------
    tuple
        Of the outermost place inside each interval: minima (m, n) and distances (m,). Then values
        (m,) that are outside, or the bound.
    """
    best, value, bound = (np.array(of, dtype=float) for of in (best, first, bound))
    inside, last, distance = np.tile(minimum, (len(best), 1)), best.copy(), np.zeros(len(best))
    outside = np.full(len(best), np.nan)
    active = np.flatnonzero(best != bound)
    for _ in range(STEPS):
        if not len(active):
            break
        value = np.clip(value, np.minimum(best, bound), np.maximum(best, bound))
        reached, minima = refit(active, value[active], inside[active])
        is_beyond = reached > level
        beyond, within = active[is_beyond], active[~is_beyond]
        outside[beyond] = value[beyond]
        inside[within], last[within] = minima[~is_beyond], value[within]
        distance[within] = reached[~is_beyond]
        wanted = further(best[active], value[active], reached, level)
        # Between a place inside and one outside the next one halves the gap, or goes where the
        # place inside points to
        gap = outside[active] - last[active]
        share = np.where(is_beyond, 0.5, np.clip((wanted - last[active]) / gap, 0.1, 0.9))
        value[active] = np.where(np.isnan(gap), wanted, last[active] + share * gap)
        is_narrow = np.abs(gap) < NARROW * np.abs(outside - best)[active]
        is_done = is_narrow | (distance[active] > (1 - NARROW) * level)
        active = active[~(is_done | (last[active] == bound[active]))]
    return inside, distance, np.where(np.isnan(outside), bound, outside)


def further(best, value, distance, level: float):
    """The value at which the distance is `level` if it grows as it did from `best` to `value`."""
    factor = np.clip(level / np.maximum(distance, 1e-9), 1 / GROWTH, GROWTH)
    return best + factor * (value - best)

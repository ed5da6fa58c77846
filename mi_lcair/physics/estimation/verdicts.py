"""What is said about estimated values and about the residuals that they leave."""

from collections.abc import Callable
from enum import StrEnum
from functools import cache
from math import cos, pi, sin, sqrt, tan
from statistics import NormalDist

import numpy as np
import scipy

SIGNIFICANCE = 0.001  # probability of a false alarm of a test of chi-square
# Width of a 95 % interval, relative to the range that was possible before the measurement, from
# which the data say nothing about a value
UNDETERMINED = 0.5
OVERSTATED = "the data scatter less than their sigma says"


class Verdict(StrEnum):
    """The verdicts on an estimated value, as users read them.

    The names in braces are filled in by `sentence`.
    """

    DETERMINED = "determined"
    CONDITIONAL = "determined if {what}: interval {span}"
    WEAK = "weakly determined: interval {span}"
    AT_BOUND = "at its bound {bound}: interval {span}"
    WIDE = "not determined by these data: any value in {span} fits"
    ONE_SIDED = "not determined by these data: {what}"
    ASSUMED = "not determined by these data: only the ranges of amplitudes limit it; give a prior"
    MISSED = "not determined by these data: the model misses {what}"
    HIDDEN = "not determined: the noise of the render exceeds its effect; raise spp of [render]"
    UNFINISHED = "not converged: the value still moves, and its error may be too small"
    # Values that were chosen to reach a goal
    CHOSEN = "chosen"
    CHOSEN_AMONG = "chosen, but {span} does nearly as well"
    FREE = "free: any value in {span} does as well"

    @staticmethod
    def of(width: float, possible: float, is_at_bound: bool, is_precise: bool) -> "Verdict":
        """The verdict that follows from the interval of a value.

        Parameters
        ----------
        width
            Width of the 95 % interval.
        possible
            Width of the range that was possible before the measurement.
        is_at_bound
            Whether the value lies at a bound.
        is_precise
            Whether the interval is as narrow as it should be.
        """
        if width >= UNDETERMINED * possible:
            return Verdict.WIDE
        if is_at_bound:
            return Verdict.AT_BOUND
        return Verdict.DETERMINED if is_precise else Verdict.WEAK

    def sentence(self, span: str = "", bound: str | None = "", what: str = "") -> str:
        """The verdict as a sentence.

        Parameters
        ----------
        span
            The 95 % interval.
        bound
            The bound at which the value lies.
        what
            What the model misses, or what the data say instead.
        """
        return self.value.format(span=span, bound=bound, what=what)

    @property
    def of_goal(self) -> "Verdict":
        """The verdict on a value that was chosen to reach a goal."""
        return OF_GOALS.get(self, self)

    @staticmethod
    def has_interval(sentence: str) -> bool:
        """Whether a sentence says that the data determine a value, well or weakly."""
        return sentence.startswith((Verdict.DETERMINED, Verdict.WEAK.partition(":")[0]))


OF_GOALS = {
    Verdict.DETERMINED: Verdict.CHOSEN,
    Verdict.WEAK: Verdict.CHOSEN_AMONG,
    Verdict.WIDE: Verdict.FREE,
    Verdict.ASSUMED: Verdict.FREE,
}


def chi_square_text(chi_square: float, freedom: float, p_value: float, scatter: float = 0.0) -> str:
    """A reduced chi-square in words, with the scatter that a render's noise gives to it, if any."""
    value = f"{chi_square:.3g} +- {scatter:.2g}" if scatter else f"{chi_square:.3g}"
    return f"{value} for each of {freedom:.4g} degrees of freedom, p = {p_value:.2g}"


# Intervals of estimated values: Student's factor, correlations and profile likelihoods
# -------------------------------------------------------------------------------------
# The end of a profile interval is where the cost, with all other unknowns at their best, is as much
# higher as 95 % of noise makes it (Venzon and Moolgavkar 1988).

STEPS = 16  # largest number of places at which a profile is computed
NARROW = 0.02  # relative error with which the end of a profile is found
MOST_BISECTED = 64  # degrees of freedom
GROWTH = 3.0  # largest factor from one place of a profile to the next


@cache
def student_factor(freedom: float) -> float:
    """Half of Student's 95 % interval, in standard errors; infinite without a degree of freedom.

    For few whole degrees of freedom it is found by bisection, because scipy.special takes longer to
    import than a small render takes. Source: Abramowitz and Stegun (26.7.3) and (26.7.4).
    """
    if freedom <= 0:
        return np.inf
    if freedom == np.inf:
        return NormalDist().inv_cdf(0.975)
    if freedom > MOST_BISECTED or freedom != int(freedom):
        return float(scipy.special.stdtrit(freedom, 0.975))
    low, high = 0.0, pi / 2
    while (angle := (low + high) / 2) not in (low, high):
        low, high = (angle, high) if within(angle, int(freedom)) < 0.95 else (low, angle)
    return sqrt(freedom) * tan(angle)


def within(angle: float, freedom: int) -> float:
    """Probability that Student's t is within +- sqrt(freedom) tan(angle)."""
    odd = freedom % 2
    total, term = 0.0, cos(angle) if odd else 1.0
    for k in range(1, freedom // 2 + 1):
        total += term
        term *= (2 * k - 1 + odd) / (2 * k + odd) * cos(angle) ** 2
    total *= sin(angle)
    return 2 / pi * (angle + total) if odd else total


def correlation(covariance: np.ndarray) -> np.ndarray:
    """Correlation matrix (n, n) of a covariance matrix (n, n)."""
    size = np.sqrt(np.maximum(np.diag(covariance), np.finfo(float).tiny))
    ratio = np.clip(covariance / np.outer(size, size), -1, 1)
    return np.where(np.eye(len(covariance), dtype=bool), 1.0, ratio)


def inner_deviation(rows: np.ndarray, least: float) -> float:
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
    factor = level / np.clip(distance, level / GROWTH, level * GROWTH)
    return best + factor * (value - best)

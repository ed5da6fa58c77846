"""Propagation of distributions by random draws (GUM supplement 1, JCGM 101:2008)."""

from dataclasses import dataclass

import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.uncertainty.inputs import Inputs
from mi_lcair.uncertainty.number import Number

MOST_OUTSIDE = 0.9  # share of infeasible draws from which no distribution can be drawn
LEAST_DRAWS = 10


@dataclass(frozen=True)
class MonteCarlo:
    """Distribution of a result for random values of its quantities.

    Attributes
    ----------
    draws : int
        Number of draws.
    outside : int
        Number of draws that were outside the bounds of a quantity and were replaced by new draws.
    mean : float
        Mean of the results.
    sigma, sigma_error : float
        Their standard deviation, and its standard error.
    interval : tuple of float
        Interval that holds 95 % of the results.
    results : ndarray, shape (draws,)
        The results.
    """

    draws: int
    outside: int
    mean: float
    sigma: float
    sigma_error: float
    interval: tuple[float, float]
    results: np.ndarray

    def as_dict(self) -> dict:
        """The summary for JSON, without the single results."""
        return {name: value for name, value in vars(self).items() if name != "results"}

    def sentence(self) -> str | None:
        """What was done about draws outside the bounds, in one line; None if there were none."""
        if not self.outside:
            return None
        return (
            f"{self.outside} of {self.draws + self.outside} draws were outside the bounds of a "
            "quantity and were drawn again: the distributions are cut off there"
        )


def monte_carlo(number: Number, inputs: Inputs, draws: int, seed: int, progress=None) -> MonteCarlo:
    """Draw the quantities from a normal distribution and compute the result for each draw.

    All renders have the same random numbers, so that their noise does not add to the scatter.

    Parameters
    ----------
    number : Number
    inputs : Inputs
    draws : int
        Number of draws.
    seed : int
        Seed of the draws.
    progress : callable or None
        Called with (draws done, draws expected).

    Raises
    ------
    InputError
        For fewer than LEAST_DRAWS draws, or if nearly all draws are outside the bounds.
    """
    check_draws(draws)
    random = np.random.default_rng(seed)
    # The eigenvectors also serve a covariance that is singular
    variances, axes = np.linalg.eigh(inputs.covariance)
    root = axes * np.sqrt(np.maximum(variances, 0))
    results, outside = [], 0
    while len(results) < draws:
        values = inputs.values + root @ random.standard_normal(len(inputs.quantities))
        named = dict(zip(inputs.names, values))
        if not number.is_feasible(named):
            outside += 1
            if outside > max(draws, LEAST_DRAWS) * MOST_OUTSIDE / (1 - MOST_OUTSIDE):
                raise InputError(
                    "nearly all draws are outside the bounds of a quantity; the standard "
                    "deviations are too large for a normal distribution"
                )
            continue
        results.append(number.at(named))
        if progress:
            progress(len(results), draws)
    results = np.array(results)
    sigma = float(results.std(ddof=1))
    return MonteCarlo(
        draws=draws,
        outside=outside,
        mean=float(results.mean()),
        sigma=sigma,
        sigma_error=error_of_deviation(results),
        interval=tuple(np.quantile(results, (0.025, 0.975)).tolist()),
        results=results,
    )


def check_draws(draws: int) -> None:
    """Raise InputError for fewer than LEAST_DRAWS draws."""
    if draws < LEAST_DRAWS:
        raise InputError(f"{draws} draws for a Monte Carlo; must be {LEAST_DRAWS} or more")


def error_of_deviation(results: np.ndarray) -> float:
    """Standard error of the standard deviation of independent results.

    It follows from their fourth moment, so that it also holds for a distribution that is not
    normal.
    """
    n, variance = len(results), results.var(ddof=1)
    if not variance > 0:
        return 0.0
    fourth = np.mean((results - results.mean()) ** 4)
    of_variance = max(fourth - variance**2 * (n - 3) / (n - 1), 0.0) / n
    return float(np.sqrt(of_variance) / (2 * np.sqrt(variance)))

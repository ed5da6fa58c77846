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
    is_controlled : bool
        Whether the linear answer for the same draws served as a control variate for `sigma`.
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
    is_controlled: bool
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


def monte_carlo(
    number: Number,
    inputs: Inputs,
    derivative: np.ndarray,
    independent: float,
    draws: int,
    seed: int,
    progress=None,
) -> MonteCarlo:
    """Draw the quantities from a normal distribution and compute the result for each draw.

    All renders have the same random numbers, so that their noise does not add to the scatter. The
    standard deviation of the linear answer is known, also without draws. Its difference from that
    of the draws says how much the few draws scatter too little or too much. This removes most of
    the error of the result's standard deviation, also if the derivatives are wrong.

    Parameters
    ----------
    number : Number
    inputs : Inputs
    derivative : ndarray, shape (K,)
        Derivatives of the result.
    independent : float
        Standard uncertainty of the result from many small independent errors, such as those of
        facets. They are drawn together, and not rendered.
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
    results, changes, outside = [], [], 0
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
        together = independent * random.standard_normal()
        results.append(number.at(named) + together)
        changes.append(derivative @ (values - inputs.values) + together)
        if progress:
            progress(len(results), draws)
    results = np.array(results)
    plain = squares(results)
    known = derivative @ inputs.covariance @ derivative + independent**2
    linear = squares(np.array(changes))
    slope = np.cov(plain, linear)[0, 1] / linear.var(ddof=1) if linear.var() > 0 else 0.0
    controlled = plain - slope * (linear - known)
    # Where draws are cut off at a bound, the spread of the linear answer is not known
    is_controlled = bool(not outside and controlled.mean() > 0 and controlled.std() < plain.std())
    chosen = controlled if is_controlled else plain
    sigma = float(np.sqrt(chosen.mean()))
    return MonteCarlo(
        draws=draws,
        outside=outside,
        mean=float(results.mean()),
        sigma=sigma,
        sigma_error=error_of_deviation(chosen),
        is_controlled=is_controlled,
        interval=tuple(np.quantile(results, (0.025, 0.975)).tolist()),
        results=results,
    )


def squares(results: np.ndarray) -> np.ndarray:
    """Squared deviations from the mean, whose mean is an unbiased variance."""
    return (results - results.mean()) ** 2 * (len(results) / (len(results) - 1))


def check_draws(draws: int) -> None:
    """Raise InputError for fewer than LEAST_DRAWS draws."""
    if draws < LEAST_DRAWS:
        raise InputError(f"{draws} draws for a Monte Carlo; must be {LEAST_DRAWS} or more")


def error_of_deviation(variances: np.ndarray) -> float:
    """Standard error of the root of the mean of independent estimates of a variance.

    It also holds for results that are not normal.
    """
    variance = variances.mean()
    if not variance > 0:
        return 0.0
    return float(variances.std(ddof=1) / np.sqrt(len(variances)) / (2 * np.sqrt(variance)))

"""Propagation of distributions by random draws (GUM supplement 1, JCGM 101:2008)."""

from dataclasses import dataclass
from functools import partial

import numpy as np

from mi_lcair.declared import Bounds
from mi_lcair.errors import InputError
from mi_lcair.estimate import Estimate
from mi_lcair.knowing.budgets.inputs import Inputs
from mi_lcair.knowing.budgets.number import Number
from mi_lcair.tasks import computed

MOST_OUTSIDE = 0.9  # share of infeasible draws from which no distribution can be drawn
LEAST_DRAWS = 10
DRAWS = Bounds(lower=LEAST_DRAWS)
AT_ONCE = 8  # draws of a task
LINEAR_DRAWS = 4000  # draws for the spread of the linear answer inside the bounds


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

    def words(self, unit: str) -> str:
        """The distribution in one line."""
        low, high = self.interval
        return (
            f"{Estimate(self.mean, self.sigma, unit)} (itself +- {self.sigma_error:.2g}) from "
            f"{self.draws} draws, 95 % in {low:.5g}..{high:.5g}"
        )

    def sentence(self) -> str | None:
        """What was done about draws outside the bounds, in one line; None if there were none."""
        if not self.outside:
            return None
        return (
            f"{self.outside} of {self.draws + self.outside} draws were outside the bounds of a "
            "quantity and were repeated: the distributions are cut off there"
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
    """Draw the quantities from their distributions and compute the result for each draw.

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
    DRAWS.check(draws, "draws")
    feasible = FeasibleDraws(number, inputs, np.random.default_rng(seed))
    pairs = [(feasible.draw(), feasible.random.standard_normal()) for _ in range(draws)]
    values, together = (np.array(parts) for parts in zip(*pairs))
    together *= independent
    results, outside = np.empty(draws), feasible.outside
    parts = [slice(first, first + AT_ONCE) for first in range(0, draws, AT_ONCE)]
    tasks = [partial(results_at, number, inputs.names, values[part]) for part in parts]
    for done, (k, some) in enumerate(computed(tasks)):
        results[parts[k]] = some + together[parts[k]]
        if progress:
            progress(min((done + 1) * AT_ONCE, draws), draws)
    plain, linear = squares(results), squares((values - inputs.values) @ derivative + together)
    known, error_of_known = linear_variance(feasible, inputs, derivative)
    slope = np.cov(plain, linear)[0, 1] / linear.var(ddof=1) if linear.var() > 0 else 0.0
    controlled = plain - slope * (linear - known - independent**2)
    # The errors of the two variances: of the draws alone, and with the control variate
    error = controlled.std(ddof=1) / np.sqrt(draws)
    errors = plain.std(ddof=1) / np.sqrt(draws), float(np.hypot(error, slope * error_of_known))
    is_controlled = bool(controlled.mean() > 0 and errors[1] < errors[0])
    sigma = float(np.sqrt((controlled if is_controlled else plain).mean()))
    return MonteCarlo(
        draws=draws,
        outside=outside,
        mean=float(results.mean()),
        sigma=sigma,
        sigma_error=float(errors[is_controlled] / (2 * sigma)) if sigma > 0 else 0.0,
        is_controlled=is_controlled,
        interval=tuple(np.quantile(results, (0.025, 0.975)).tolist()),
        results=results,
    )


def results_at(number: Number, names: list[str], values: np.ndarray) -> np.ndarray:
    """The result for each row of values, (n,)."""
    return np.array([number.at(dict(zip(names, row))) for row in values])


class FeasibleDraws:
    """Draws of quantities from their distributions, cut off at the bounds of the quantities.

    outside: number of draws so far that were outside the bounds.
    """

    def __init__(self, number: Number, inputs: Inputs, random: np.random.Generator):
        self.number, self.inputs, self.random = number, inputs, random
        # The eigenvectors also serve a covariance that is singular
        variances, axes = np.linalg.eigh(inputs.covariance)
        self.root = axes * np.sqrt(np.maximum(variances, 0))
        self.laws = {
            inputs.names.index(name): of_name.law for name, of_name in inputs.distributions.items()
        }
        self.outside = self.count = 0

    def draw(self) -> np.ndarray:
        """Values of all quantities, (K,)."""
        while True:
            normal = self.random.standard_normal(len(self.inputs.quantities))
            values = self.inputs.values + self.root @ normal
            for k, law in self.laws.items():
                values[k] = law.ppf(self.random.random())
            if self.number.is_feasible(dict(zip(self.inputs.names, values))):
                self.count += 1
                return values
            self.outside += 1
            if self.outside > LEAST_DRAWS + MOST_OUTSIDE / (1 - MOST_OUTSIDE) * self.count:
                raise InputError(
                    "nearly all draws are outside the bounds of a quantity; the standard "
                    "deviations are too large"
                )


def linear_variance(feasible: FeasibleDraws, inputs: Inputs, derivative) -> tuple[float, float]:
    """Variance of the linear answer, and its standard error.

    The variance is known if no draw was outside the bounds. Otherwise it comes from many draws,
    which need no render.
    """
    if not feasible.outside:
        return float(derivative @ inputs.covariance @ derivative), 0.0
    many = np.array([feasible.draw() for _ in range(LINEAR_DRAWS)])
    drawn = squares((many - inputs.values) @ derivative)
    return float(drawn.mean()), float(drawn.std(ddof=1) / np.sqrt(LINEAR_DRAWS))


def squares(results: np.ndarray) -> np.ndarray:
    """Squared deviations from the mean, whose mean is an unbiased variance."""
    return (results - results.mean()) ** 2 * (len(results) / (len(results) - 1))

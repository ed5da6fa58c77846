"""Random draws of formulas against distributions in closed form."""

import numpy as np
import pytest
from scipy.stats import truncnorm

from mi_lcair.errors import InputError
from mi_lcair.knowing.budgets.monte_carlo import FeasibleDraws, monte_carlo, squares
from tests.knowing.budgets.formula import Formula, inputs

COVARIANCE = np.array([[4.0, 1.8], [1.8, 1.0]])
PAIR = inputs({"a": 1.0, "b": 2.0}, COVARIANCE, [[0, 1]])
LINEAR = Formula(lambda a, b: 3 * a - 2 * b, {"a": 1.0, "b": 2.0})
SLOPE = np.array([3.0, -2.0])


def test_a_linear_number_needs_few_draws():
    """Its standard deviation is known, so that the control variate leaves no error."""
    done = []
    found = monte_carlo(LINEAR, PAIR, SLOPE, 0.0, 20, 1, lambda *counts: done.append(counts))
    assert found.sigma == pytest.approx(np.sqrt(18.4)) and found.is_controlled
    assert found.sigma_error < 1e-6 and found.outside == 0
    assert done == [(8, 20), (16, 20), (20, 20)] and len(found.results) == 20
    assert found.mean == pytest.approx(found.results.mean())
    assert found.interval == pytest.approx(np.quantile(found.results, [0.025, 0.975]))
    assert found.sentence() is None and "4.3 W (itself +- " in found.words("W")


def test_small_numbers():
    """In units in which the result is a million times smaller."""
    tiny = Formula(lambda a, b: 1e-6 * (3 * a - 2 * b), {"a": 1.0, "b": 2.0})
    found = monte_carlo(tiny, PAIR, 1e-6 * SLOPE, 0.0, 20, 1)
    assert found.sigma == pytest.approx(1e-6 * np.sqrt(18.4)) and found.is_controlled


def test_independent_errors_are_added():
    """Those of facets, drawn together: 18.4 + 9."""
    found = monte_carlo(LINEAR, PAIR, SLOPE, 3.0, 20, 1)
    assert found.sigma == pytest.approx(np.sqrt(27.4)) and found.sigma_error < 1e-6


def test_a_wrong_derivative_helps_all_the_same():
    """The slope of the control variate is fitted to the draws."""
    found = monte_carlo(LINEAR, PAIR, 2 * SLOPE, 0.0, 20, 1)
    assert found.sigma == pytest.approx(np.sqrt(18.4)) and found.is_controlled


def test_error_without_a_control_variate():
    """With a derivative of 0: the standard deviation of the draws, and that of its error."""
    found = monte_carlo(LINEAR, PAIR, 0 * SLOPE, 0.0, 500, 3)
    results = found.results
    deviations = (results - results.mean()) ** 2 * 500 / 499
    assert not found.is_controlled
    assert found.sigma == pytest.approx(results.std(ddof=1))
    error = deviations.std(ddof=1) / np.sqrt(500) / (2 * found.sigma)
    assert found.sigma_error == pytest.approx(error)
    assert found.sigma == pytest.approx(np.sqrt(18.4), abs=4 * found.sigma_error)


def test_draws_have_the_covariance():
    draws = FeasibleDraws(LINEAR, PAIR, np.random.default_rng(0))
    values = np.array([draws.draw() for _ in range(4000)])
    np.testing.assert_allclose(values.mean(axis=0), [1, 2], atol=0.12)
    np.testing.assert_allclose(np.cov(values.T), COVARIANCE, rtol=0.1)
    singular = inputs({"a": 0.0, "b": 0.0}, [[1, 1], [1, 1]], [[0, 1]])
    draws = FeasibleDraws(LINEAR, singular, np.random.default_rng(0))
    assert all(np.isclose(*draws.draw(), atol=1e-7) for _ in range(20))


def test_draws_outside_the_bounds_are_replaced():
    """a = 0 +- 1 above -1: a normal distribution that is cut off there."""
    one, number = inputs({"a": 0.0}, [[1.0]]), Formula(lambda a: 5 * a, {"a": 0.0}, lower=-1.0)
    found = monte_carlo(number, one, np.array([5.0]), 0.0, 400, 0)
    cut = truncnorm(-1, np.inf)
    assert found.results.min() >= -5 and found.outside == pytest.approx(75, abs=25)
    assert found.mean == pytest.approx(5 * cut.mean(), abs=4 * 5 * cut.std() / 20)
    assert found.sigma == pytest.approx(5 * cut.std(), rel=0.03)
    assert 0 < found.sigma_error < 0.03 * found.sigma  # of the variance from 4000 draws
    total = 400 + found.outside
    assert found.sentence().startswith(f"{found.outside} of {total} draws were outside the bounds")


def test_too_few_and_impossible_draws():
    with pytest.raises(InputError, match="draws = 9; must be 10 or more"):
        monte_carlo(LINEAR, PAIR, SLOPE, 0.0, 9, 0)
    monte_carlo(LINEAR, PAIR, SLOPE, 0.0, 10, 0)
    one = inputs({"a": 0.0}, [[1.0]])
    far = Formula(lambda a: a, {"a": 0.0}, lower=1.7)  # 1 of 22 draws is inside
    with pytest.raises(InputError, match="nearly all draws are outside the bounds"):
        monte_carlo(far, one, np.ones(1), 0.0, 200, 0)
    near = Formula(lambda a: a, {"a": 0.0}, lower=1.0)  # 1 of 6
    monte_carlo(near, one, np.ones(1), 0.0, 50, 0)


def test_squares_have_the_mean_of_the_variance():
    values = np.array([1.0, 2.0, 4.0])
    assert squares(values).mean() == pytest.approx(values.var(ddof=1))

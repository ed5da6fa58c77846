"""The distribution of a curved result, against moments and quantiles in closed form."""

import numpy as np
import pytest
from scipy.stats import lognorm, ncx2, norm

from mi_lcair.knowing.budgets.budget import Check, check, second_order
from tests.knowing.budgets.formula import Formula, inputs


def distribution(f, slopes, sigmas):
    """The distribution of f at (0, ..., 0), with independent quantities of these sigmas."""
    values = dict.fromkeys(sigmas, 0.0)
    stated = inputs(values, np.diag(np.square(list(sigmas.values()))))
    number, slopes = Formula(f, values), np.array(slopes, dtype=float)
    sigma = float(np.sqrt(slopes @ stated.covariance @ slopes))
    return second_order(number, check(number, stated, slopes, sigma), sigma)


def test_a_linear_result():
    found = distribution(lambda a, b: 2 + 3 * a - 4 * b, [3, -4], {"a": 1.0, "b": 1.0})
    assert found.shift == pytest.approx(0, abs=1e-3)
    assert found.sigma == pytest.approx(5, rel=1e-3)
    assert found.interval == pytest.approx(2 + 5 * np.array(norm.interval(0.95)), abs=0.01)


@pytest.mark.parametrize("k", [-0.4, -0.2, 0.1, 0.3])
def test_an_exponential(k):
    """exp(k z) has a log-normal distribution; a linear answer misses its sigma by 5 % for 0.25."""
    found = distribution(lambda a: np.exp(k * a), [k], {"a": 1.0})
    truth = lognorm(abs(k))
    assert found.shift == pytest.approx(truth.mean() - 1, rel=2 * k**2 + 1e-3)
    assert found.sigma == pytest.approx(truth.std(), rel=0.6 * k**2)
    linear = norm.interval(0.95, 1, abs(k))
    # Each end is at least five times as near as that of the linear answer
    for end, of_linear, expected in zip(found.interval, linear, truth.interval(0.95)):
        assert abs(end - expected) < 0.2 * abs(of_linear - expected)


def test_moments_of_a_cubic():
    """a + 0.3 a^2 + 0.1 a^3 beside a linear term: mean and variance by Gauss-Hermite quadrature."""
    f = lambda a, b: a + 0.3 * a**2 + 0.1 * a**3 + 2 * b
    found = distribution(f, [1, 2], {"a": 1.0, "b": 0.5})
    nodes, weights = np.polynomial.hermite_e.hermegauss(20)
    y, weights = f(nodes, 0), weights / weights.sum()
    mean = weights @ y
    variance = weights @ (y - mean) ** 2
    assert found.shift == pytest.approx(mean, rel=5e-3)
    assert found.sigma == pytest.approx(np.sqrt(variance + 1), rel=3e-3)


def test_many_squares():
    """The sum of (z + 0.1 z^2) over nine quantities is a shifted non-central chi-square."""
    names = "abcdefghi"
    found = distribution(
        lambda **z: sum(v + 0.1 * v**2 for v in z.values()), [1] * 9, dict.fromkeys(names, 1.0)
    )
    truth = ncx2(9, 9 * 25, loc=-0.1 * 9 * 25, scale=0.1)  # z + 0.1 z^2 = 0.1 (z + 5)^2 - 2.5
    assert found.shift == pytest.approx(truth.mean(), rel=5e-3)
    assert found.sigma == pytest.approx(truth.std(), rel=3e-3)
    assert found.interval == pytest.approx(truth.interval(0.95), rel=3e-3)


def test_nothing_without_both_sides():
    values = {"a": 0.0}
    stated = inputs(values, [[1.0]])
    number = Formula(lambda a: a, values, lower=-0.5)
    checks = check(number, stated, np.ones(1), 1.0)
    assert second_order(number, checks, 1.0) is None and second_order(number, [], 1.0) is None
    assert second_order(number, [Check("a", 0.0, 0.1, 0.1, False)], 0.0) is None

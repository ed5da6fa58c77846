"""Checks of the linear answer against formulas."""

import numpy as np
import pytest

from mi_lcair.uncertainty.check import Check, check
from tests.uncertainty.formula import Formula, inputs


def checked(f, derivative, values, covariance, groups=None, total=None, **bounds):
    stated = inputs(values, covariance, groups)
    derivative = np.array(derivative, dtype=float)
    total = np.sqrt(derivative @ stated.covariance @ derivative) if total is None else total
    return check(Formula(f, values, **bounds), stated, derivative, total)


def test_a_linear_number():
    """The step goes in the direction of a larger value of the quantity."""
    (found,) = checked(lambda a: 5 - 3 * a, [-3], {"a": 2.0}, [[0.25]])
    assert found.quantity == "a" and found.holds
    assert (found.linear, found.plus, found.minus) == pytest.approx((-1.5, -1.5, 1.5))


@pytest.mark.parametrize("curvature, holds", [(0.099, True), (0.101, False), (-0.101, False)])
def test_a_tenth_of_the_change_is_allowed(curvature, holds):
    """a + k a^2 at 0 with a step of 1: changes of 1 + k and -1 + k."""
    k = curvature
    (found,) = checked(lambda a: a + k * a**2, [1], {"a": 0.0}, [[1.0]])
    assert found.holds == holds
    assert (found.plus, found.minus) == pytest.approx((1 + k, -1 + k))


def test_correlated_quantities_move_together():
    """Along covariance x derivative, one standard deviation of the result far."""
    covariance, c = np.array([[4.0, 1.8], [1.8, 1.0]]), np.array([3.0, -2.0])
    (found,) = checked(
        lambda a, b: 3 * a - 2 * b + 0.5 * a * b, c, {"a": 0.0, "b": 0.0}, covariance, [[0, 1]]
    )
    a, b = covariance @ c / np.sqrt(c @ covariance @ c)
    assert found.linear == pytest.approx(np.sqrt(18.4))
    assert found.plus == pytest.approx(3 * a - 2 * b + 0.5 * a * b)
    assert found.minus == pytest.approx(-3 * a + 2 * b + 0.5 * a * b)


def test_only_what_matters_is_checked():
    """From a share of 1 % of the variance on."""
    f, values = (lambda a, b: a + b), {"a": 1.0, "b": 1.0}
    for sigma, names in ((0.2999, ["a"]), (0.3001, ["a", "b"])):
        found = checked(f, [1, 1], values, np.diag([1, sigma**2]), total=3.0)
        assert [one.quantity for one in found] == names


def test_bounds():
    (found,) = checked(lambda a: a, [1], {"a": 2.0}, [[9.0]], lower=0.0)
    assert (found.plus, found.minus, found.holds) == (3.0, None, False)
    assert "minus one sigma is outside its bounds, so that the linear answer holds on one side" in (
        found.sentence("W/sr")
    )


def test_sentences():
    """A side whose change is known but wrong is stated beside the one without a change."""
    assert Check("a", 2.0, 3.0, -2.0, False).sentence("W/sr") == (
        "a: the linear answer fails: plus one sigma changes the result by +3 W/sr and minus one "
        "sigma changes the result by -2 W/sr, where the derivative says +-2; use Monte Carlo"
    )
    wrong = Check("a", -2.0, None, 2.3, False).sentence("K")
    assert "minus one sigma changes the result by +2.3 K and plus one sigma is outside" in wrong
    assert "on one side only" in Check("a", -2.0, None, 2.19, False).sentence("K")
    assert "on one side only" in Check("a", -2.0, None, 1.81, False).sentence("K")
    neither = Check("a", 2.0, None, None, False).sentence("K")
    assert "plus one sigma is outside its bounds and minus one sigma is outside" in neither

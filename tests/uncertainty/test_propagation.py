"""Rows of budgets from invented derivatives."""

import numpy as np
import pytest

from mi_lcair.uncertainty.propagation import combined, group_variance, rows
from tests.uncertainty.formula import inputs

VALUES = {"a": 10.0, "b": 20.0, "c": 30.0}
COVARIANCE = [[4.0, 1.8, 0], [1.8, 1.0, 0], [0, 0, 0.25]]
STATED = inputs(VALUES, COVARIANCE, [[0, 1], [2]])
DERIVATIVE, ERRORS = np.array([3.0, -2.0, 8.0]), np.array([0.1, 0.2, np.nan])


def test_shares_of_groups_and_of_other_errors():
    """Of a and b: 9 x 4 + 4 x 1 - 2 x 3 x 2 x 1.8 = 18.4; of c: 16; of the noise: 1.5^2."""
    found = rows(STATED, DERIVATIVE, ERRORS, {"noise": 1.5, "none": 0.0})
    assert [row.quantity for row in found] == ["a & b", "c", "noise", "none"]
    assert [row.contribution for row in found] == pytest.approx([18.4**0.5, 4.0, 1.5, 0.0])
    assert [row.share for row in found] == pytest.approx(
        [18.4 / 36.65, 16 / 36.65, 2.25 / 36.65, 0]
    )
    assert combined(found) == pytest.approx(36.65**0.5)
    group, single = found[:2]
    assert [member.quantity for member in group.members] == ["a", "b"]
    assert [member.contribution for member in group.members] == pytest.approx([6.0, -2.0])
    assert [member.share for member in group.members] == [None, None]
    assert (single.value, single.sigma, single.sensitivity, single.unit) == (30, 0.5, 8, "K")
    assert group.members[1].sensitivity_error == 0.2 and group.value is None
    assert np.isnan(single.sensitivity_error) and single.members == ()
    assert group.members[0].sensitivity_error == 0.1


def test_errors_that_cancel():
    """A correlation of 1 with opposite contributions, and nothing at all."""
    small = inputs({"a": 1.0}, [[1e-6]])
    assert rows(small, np.ones(1), np.zeros(1), {})[0].share == 1
    opposite = inputs({"a": 1.0, "b": 1.0}, [[1, 1], [1, 1]], [[0, 1]])
    (row,) = rows(opposite, np.array([2.0, -2.0]), np.zeros(2), {})
    assert (row.contribution, row.share) == (0, 0)
    assert group_variance(opposite, np.array([2.0, 3.0]), opposite.groups[0]) == pytest.approx(25)

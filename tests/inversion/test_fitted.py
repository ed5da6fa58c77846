"""Errors of a material in the form of a fit's report."""

import numpy as np

from mi_lcair.inversion.fitted import spread


def test_spread_of_a_material():
    """Of four parameters two were estimated; the others have no error and no correlation."""
    covariance = np.array([[4.0, 9, 0.6], [9, 99, 9], [0.6, 9, 0.25]])
    found = spread("paint", ("a", "b", "c"), {"paint.c": 0, "paint.a": 2, "other.b": 1}, covariance)
    assert found["standard_error"] == {"a": 0.5, "b": 0.0, "c": 2.0}
    np.testing.assert_allclose(found["correlation"], [[1, 0, 0.6], [0, 1, 0], [0.6, 0, 1]])

"""Derivatives at points of the cube, of functions that are awkward to differentiate."""

import numpy as np

from mi_lcair.fitting.cube import with_tangents


def test_a_coordinate_that_is_a_result_and_enters_another_keeps_its_derivative():
    u = np.array([[0.3, 0.4]])
    values, slopes = with_tangents(lambda a, b: (a, (1 - a) * b), u)
    np.testing.assert_allclose(values, [[0.3, 0.28]])
    np.testing.assert_allclose(slopes, [[[1, 0], [-0.4, 0.7]]])

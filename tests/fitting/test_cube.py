"""Derivatives at points of the cube, of functions that are awkward to differentiate."""

import drjit as dr
import numpy as np
from drjit.llvm.ad import Float64, UInt32

from mi_lcair.fitting.cube import parameters_at, with_tangents
from tests.fitting.synthetic import MODEL


def test_a_coordinate_that_is_a_result_and_enters_another_keeps_its_derivative():
    u = np.array([[0.3, 0.4]])
    values, slopes = with_tangents(lambda a, b: (a, (1 - a) * b), u)
    np.testing.assert_allclose(values, [[0.3, 0.28]])
    np.testing.assert_allclose(slopes, [[[1, 0], [-0.4, 0.7]]])


def test_one_result_in_more_lanes():
    """Coordinates that are spread over lanes: a^2 b for each of two sets, twice."""
    u = np.array([[0.3, 0.4], [0.5, 0.6]])
    spread = lambda coordinate: dr.gather(Float64, coordinate, UInt32([0, 0, 1, 1]))
    values, slopes = with_tangents(lambda a, b: a * a * b, u, spread)
    np.testing.assert_allclose(values, [0.036, 0.036, 0.15, 0.15])
    np.testing.assert_allclose(slopes, [[0.24, 0.09]] * 2 + [[0.6, 0.25]] * 2)


def test_parameters_and_their_derivatives():
    """Against differences of the model's own values."""
    u, step = np.array([[0.3, 0.4, 0.6, 0.5], [0.7, 0.2, 0.1, 0.9]]), 1e-6
    values, slopes = parameters_at(MODEL, u)
    for k in (0, 1):
        np.testing.assert_allclose(values[k], MODEL.values_at(u[k]), rtol=1e-12)
        ends = [
            np.array([MODEL.values_at(u[k] + sign * step * axis) for axis in np.eye(4)])
            for sign in (1, -1)
        ]
        np.testing.assert_allclose(slopes[k], (ends[0] - ends[1]).T / (2 * step), atol=1e-6)
    np.testing.assert_allclose(parameters_at(MODEL, u[0])[0], values[:1])

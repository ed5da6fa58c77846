"""Every point of the cube is feasible, and every feasible surface is a point of the cube."""

from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mi_lcair.fitting.model import parameters_at as values_and_derivatives
from mi_lcair.physics.reflection.models import MODELS
from mi_lcair.physics.reflection.sandford_robertson_cube import E_MIN
from tests.fitting.numpy_model import G

MODEL = MODELS["sandford_robertson"]

unit = st.floats(0, 1)


def parameters_at(u):
    return values_and_derivatives(MODEL, u)


def check_feasible(*values):
    MODEL.check_feasible(*values, form="thesis")


@pytest.mark.slow
@given(st.lists(st.tuples(unit, unit, unit, unit), min_size=1, max_size=4))
@settings(max_examples=60, deadline=None)
def test_every_point_is_feasible(u):
    for epsilon, rho_d, b, e in parameters_at(np.array(u))[0]:
        check_feasible(float(epsilon), float(rho_d), float(b), float(e))


def test_the_corners_are_the_bounds():
    for corner in product((0.0, 1.0), repeat=4):
        epsilon, rho_d, b, e = parameters_at(np.array([corner]))[0][0]
        check_feasible(epsilon, rho_d, b, e)
        assert b == corner[2] and np.isclose(e, 1 if corner[3] else E_MIN, rtol=1e-12)
        bound = 0.5 if b else 1.0  # G(1), G(0)
        assert np.isclose(epsilon, bound * corner[0]) and np.isclose(
            rho_d, bound * (1 - corner[0]) * corner[1]
        )


def test_there_and_back():
    u = np.random.default_rng(0).uniform(0.01, 0.99, (50, 4))
    parameters, _ = parameters_at(u)
    np.testing.assert_allclose(MODEL.to_cube(parameters), u, rtol=1e-12)
    epsilon, rho_d, b, e = parameters.T
    np.testing.assert_allclose(epsilon / G(b), u[:, 0], rtol=1e-12)
    np.testing.assert_allclose(np.log10(e), -5 * (1 - u[:, 3]), rtol=1e-12)


def test_derivatives():
    u, step = np.array([[0.3, 0.4, 0.2, 0.7], [0.9, 0.05, 0.01, 0.5]]), 1e-6
    expected = np.stack(
        [
            (parameters_at(u + step * axis)[0] - parameters_at(u - step * axis)[0]) / (2 * step)
            for axis in np.eye(4)
        ],
        axis=-1,
    )
    np.testing.assert_allclose(parameters_at(u)[1], expected, rtol=1e-7, atol=1e-9)


def test_bounds_follow_from_b():
    low, high = MODEL.feasible_range((0.1, 0.2, 0.4, 0.5))
    np.testing.assert_allclose(low, [0, 0, 0, E_MIN])
    np.testing.assert_allclose(high, [G(0.4), G(0.4), 1, 1])


def test_starts_are_spread_and_belong_to_their_seed():
    first, again, other = (
        MODEL.starting_points(64, 3),
        MODEL.starting_points(64, 3),
        MODEL.starting_points(64, 4),
    )
    assert np.array_equal(first, again) and not np.array_equal(first, other)
    assert np.all((first > 0) & (first < 1))
    e = parameters_at(first)[0][:, 3]
    # Each of the three decades holds about a third of the points.
    assert np.all(np.histogram(np.log10(e), bins=3, range=(-3, 0))[0] >= 20)


def test_starts_cover_what_real_surfaces_have():
    """Absorbed share 0.02..0.98, diffuse share 1e-4..0.98 and e 1e-3..1 in logarithms, b^2 = u^4"""
    u = MODEL.starting_points(4000, 1)
    e = parameters_at(u)[0][:, 3]
    for column, low, high, middle in (
        (u[:, 0], 0.02, 0.98, 0.5),
        (u[:, 1], 0.98e-4, 0.98, 0.98e-2),
        (u[:, 2], 0, 1, 0.25),
        (e, 1e-3, 1, np.sqrt(1e-3)),
    ):
        assert column.min() == pytest.approx(low, rel=0.02, abs=1e-5)
        assert column.max() == pytest.approx(high, rel=0.01)
        assert np.median(column) == pytest.approx(middle, rel=0.01)


@pytest.mark.parametrize(
    "values, held, expected",
    [
        ((0.2, 0.3, 0.5, 0.1), 0, (0.2, 0.3, 0.5, 0.1)),  # feasible
        ((0.2, 0.9, 1.0, 0.1), 0, (0.2, 0.3, 1.0, 0.1)),  # epsilon + rho_d <= G(1) = 1/2
        ((0.2, 0.9, 1.0, 0.1), 1, (0.0, 0.5, 1.0, 0.1)),  # 0.9 is not feasible
        ((0.2, 0.4, 1.0, 0.1), 1, (0.1, 0.4, 1.0, 0.1)),
        ((0.2, 0.6, 1.0, 0.1), 2, (0.125, 0.375, 1.0, 0.1)),
        ((0.2, 0.6, 1.0, 0.1), 3, (0.125, 0.375, 1.0, 0.1)),
        ((-1, 0.3, 2.0, 0), 2, (0.0, 0.3, 1.0, E_MIN)),
        ((2, -0.3, 0.0, 2), 2, (1.0, 0.0, 0.0, 1.0)),
    ],
)
def test_the_nearest_feasible_surface(values, held, expected):
    assert MODEL.nearest_feasible(np.array(values, dtype=float), held) == pytest.approx(expected)


def test_names_of_bounds():
    names = MODEL.bound_names
    assert names((0, 0, 0, 0)) == ["0", "0", "0", "1e-05"]
    assert names((0.5, 0.5, 0.5, 0.5)) == [None] * 4
    full = "epsilon + rho_d = G(b)"
    assert names((1, 0.5, 1, 1)) == [full, full, "1", "1"]
    assert names((0.5, 1, 0.5, 1)) == [full, full, None, "1"]
    assert names((0, 1, 0.5, 1))[:2] == ["0", full]


def test_an_edge_of_the_cube_has_no_division_by_zero():
    """epsilon = G(b) leaves nothing for rho_d, and e below E_MIN is E_MIN."""
    u = MODEL.to_cube(np.array([[1.0, 0.0, 0.0, 1e-9], [0.5, 0.0, 1.0, 1.0]]))
    np.testing.assert_allclose(u, [[1, 0, 0, 0], [1, 0, 1, 1]], rtol=1e-12, atol=1e-12)

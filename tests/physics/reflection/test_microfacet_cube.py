"""Bounds and cube of the microfacet model."""

import drjit as dr
import numpy as np
import pytest
from drjit.llvm.ad import Float64

from mi_lcair.errors import InputError
from mi_lcair.physics.reflection.microfacet import MODEL
from tests.physics.reflection.surfaces import direction


@pytest.mark.parametrize(
    "change, words",
    [
        ({0: 0.0}, ("alpha = 0; ", "0.0001..1")),
        ({0: 1.5}, ("alpha = 1.5; ", "0.0001..1")),
        ({1: 0.4}, ("gamma = 0.4; ", "0.5..4")),
        ({2: 0.9}, ("n = 0.9; ", "1..50")),
        ({3: -0.1}, ("k = -0.1; ", "0..100")),
        ({4: 1.1}, ("rho_d = 1.1; ", "0..1")),
        ({4: float("nan")}, ("rho_d = nan; ", "0..1")),
    ],
)
def test_infeasible_parameters_are_named_with_value_and_bound(change, words):
    values = [change.get(number, value) for number, value in enumerate((0.1, 2, 1.5, 0, 0.5))]
    with pytest.raises(InputError) as error:
        MODEL.check_feasible(*values)
    assert all(word in str(error.value) for word in words) and "\n" not in str(error.value)


def test_the_bounds_themselves_are_feasible_also_in_float32():
    for values in zip(*((p.lower, p.upper) for p in MODEL.parameters)):
        MODEL.check_feasible(*values)
        MODEL.check_feasible(*(float(np.float32(value)) for value in values))


def test_cube():
    """`from_cube` inverts `to_cube`, faces are bounds, and restrictions match their names."""
    u = np.random.default_rng(0).random((50, 5))
    values = np.array([MODEL.values_at(row) for row in u])
    np.testing.assert_allclose(MODEL.to_cube(values), u, atol=1e-12)
    lower, upper = MODEL.feasible_range(values[0])
    np.testing.assert_allclose(MODEL.values_at(np.zeros(5)), lower, rtol=1e-12, atol=1e-11)
    np.testing.assert_allclose(MODEL.values_at(np.ones(5)), upper, rtol=1e-12)
    assert MODEL.bound_names(np.array([0, 1, 0.5, 0, 1])) == ["0.0001", "4", None, "0", "1"]
    for restriction in MODEL.restrictions:
        held = u[0].copy()
        held[restriction.coordinate] = restriction.value
        name, value = restriction.name.split(" = ")
        assert MODEL.values_at(held)[MODEL.names.index(name)] == pytest.approx(
            float(value), abs=1e-11
        )


def test_k_0_is_no_stationary_face():
    """F depends on k^2. Its derivative along the cube's coordinate is not 0 at k = 0."""
    u = [dr.opaque(Float64, x) for x in (0.5, 0.5, 0.1, 0.0, 0.5)]
    dr.enable_grad(u[3])
    dr.backward(MODEL.f(MODEL.surface(*MODEL.from_cube(u)), direction(0.5, np.pi), direction(0.5)))
    assert abs(dr.grad(u[3])[0]) > 1e-3


def test_coordinates():
    """Logarithms of alpha, gamma and n; u of k by k^2 = 0.01 (exp(L u) - 1); rho_d itself."""
    L = np.log(100**2 / 0.01 + 1)
    u = np.array([0.25, 0.5, 0.75, 0.4, 0.3])
    expected = (
        1e-4**0.75,
        np.sqrt(0.5 * 4),
        50**0.75,
        np.sqrt(0.01 * (np.exp(0.4 * L) - 1)),
        0.3,
    )
    assert MODEL.values_at(u) == pytest.approx(expected, rel=1e-9)
    outside = MODEL.to_cube([[0, 9, 0.5, -1, 2], [2, 0.1, 99, 200, -1]])
    assert outside.tolist() == [[0, 1, 0, pytest.approx(0, abs=0.2), 1], [1, 0, 1, 1, 0]]


def test_starting_points():
    """Log-uniform over the ranges of real surfaces; half of k over 0.001..1, half over 1..50."""
    points = MODEL.starting_points(4000, seed=1)
    assert points.shape == (4000, 5) and np.all((points >= 0) & (points <= 1))
    np.testing.assert_array_equal(points, MODEL.starting_points(4000, seed=1))
    values = np.array([MODEL.values_at(row) for row in points])
    for row in values[:20]:
        MODEL.check_feasible(*row)
    alpha, gamma, n, k, rho_d = values.T
    for column, low, high in (
        (alpha, 1e-3, 1),
        (gamma, 0.7, 3),
        (n, 1.2, 12),
        (k[k < 1], 1e-3, 1),
        (k[k > 1], 1, 50),
        (rho_d, 1e-4, 1),
    ):
        # Of a Latin hypercube, each of n equal cells of the logarithm holds one value
        assert column.min() == pytest.approx(low, rel=0.01)
        assert column.max() == pytest.approx(high, rel=0.01)
        assert np.median(column) == pytest.approx(np.sqrt(low * high), rel=0.01)
    assert np.mean(k < 1) == 0.5
    assert abs(np.corrcoef(points.T) - np.eye(5)).max() < 0.08

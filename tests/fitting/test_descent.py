"""Descents on problems with an independently known minimum."""

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from mi_lcair.fitting.descent import box_step, easing, explore, levenberg_marquardt

STARTS = np.random.default_rng(1).uniform(0.05, 0.95, (16, 4))


class Linear:
    """Linear residuals, rows = A u - y."""

    unit = 1.0

    def __init__(self, A, y):
        self.A, self.y = A, y

    def __call__(self, u, lanes=None):
        return u @ self.A.T - self.y, np.broadcast_to(self.A, (len(u), *self.A.shape))


class Banana(Linear):
    """Two copies of Rosenbrock's function, with the minimum at (0.7, 0.49, 0.2, 0.04)."""

    def __init__(self):
        pass

    def __call__(self, u, lanes=None):
        rows, slopes = np.zeros((len(u), 4)), np.zeros((len(u), 4, 4))
        for k, centre in ((0, 0.7), (2, 0.2)):
            rows[:, k], rows[:, k + 1] = u[:, k] - centre, 10 * (u[:, k + 1] - u[:, k] ** 2)
            slopes[:, k, k], slopes[:, k + 1, k], slopes[:, k + 1, k + 1] = 1, -20 * u[:, k], 10
        return rows, slopes


@pytest.mark.parametrize("seed", range(6))
def test_minimum_in_the_cube_is_that_of_an_exact_solver(seed):
    """Descents from every start find the faces of the cube on which the minimum lies.

    The problems are random least squares whose free solution lies outside the cube.
    """
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((12, 4))
    y = A @ rng.uniform(-1, 2, 4) + 0.3 * rng.standard_normal(12)
    expected = lsq_linear(A, y, (0, 1), method="bvls", tol=1e-14)
    minima = levenberg_marquardt(Linear(A, y), STARTS)
    np.testing.assert_allclose(minima.u, np.tile(expected.x, (16, 1)), atol=1e-9)
    np.testing.assert_allclose(minima.cost, expected.cost, rtol=1e-9)
    on_bound = np.isclose(expected.x, 0, atol=1e-12) | np.isclose(expected.x, 1, atol=1e-12)
    assert np.all(np.isin(minima.u[:, on_bound], (0, 1)))  # a bound is reached exactly


def test_a_start_on_a_bound_leaves_it():
    A, y = np.eye(4), np.array([0.3, 0.6, 0.5, 0.2])
    minima = levenberg_marquardt(Linear(A, y), np.array([[0.0, 1.0, 0.0, 1.0]]))
    np.testing.assert_allclose(minima.u[0], y, atol=1e-9)


def test_a_curved_valley_is_followed_to_round_off():
    minima = levenberg_marquardt(Banana(), STARTS)
    np.testing.assert_allclose(minima.u, np.tile([0.7, 0.49, 0.2, 0.04], (16, 1)), atol=1e-12)
    assert np.all(minima.gradient < 1e-9)


def test_what_is_not_free_stays():
    A, y = np.random.default_rng(0).standard_normal((9, 4)), np.arange(9.0)
    free = np.array([True, False, True, True])
    minima = levenberg_marquardt(Linear(A, y), STARTS, free)
    assert np.array_equal(minima.u[:, 1], STARTS[:, 1])
    assert np.array_equal(explore(Linear(A, y), STARTS, free)[:, 1], STARTS[:, 1])


def test_relative_gradient():
    """Gradient / (|column| |rows|) of the coordinates that can move; |rows| is at least 1e-4 each.

    The first coordinate cannot move, the second one is at a bound beyond which the cost falls, and
    the last one at a bound that it leaves.
    """
    rng = np.random.default_rng(7)
    A, rest = rng.standard_normal((12, 4)), rng.standard_normal(12)
    A[:, 1], A[:, 3] = rest + 0.3 * A[:, 1], rest + A[:, 3]  # the costs rise with both
    u, free = np.array([[0.3, 0.0, 0.6, 1.0]]), np.array([False, True, True, True])
    for size in (1.0, 1e-4):
        rows = size * rest
        relative = np.abs(A.T @ rows) / np.linalg.norm(A, axis=0)
        relative /= np.sqrt(rows @ rows + 12 * 1e-8)
        minimum = levenberg_marquardt(Linear(A, A @ u[0] - rows), u, free, iterations=0)
        assert relative[1] > relative[3] > relative[2]
        assert minimum.gradient == pytest.approx(relative[3])


def test_a_step_within_the_cube():
    """Newton's step where there is room, else nine tenths of the way to a bound."""
    matrix = np.diag([2.0, 4.0, 1e-3, 1e-3])[None]
    u, free = np.array([[0.8, 0.2, 0.6, 0.3]]), np.ones((1, 4), dtype=bool)
    ends = box_step(matrix, np.array([[1.0, -2.0, 1.0, -1.0]]), u, free)
    np.testing.assert_allclose(ends, [[0.3, 0.7, 0.06, 0.93]])
    # Within 1e-6 of a bound it is reached
    ends = box_step(
        matrix, np.array([[0.2, -0.4, 1.0, -1.0]]), np.array([[0.5, 0.4, 9e-7, 1]]), free
    )
    np.testing.assert_allclose(ends, [[0.4, 0.5, 0.0, 1.0]])


def test_damping_after_a_step():
    """A tenth at least, 1 where half of the predicted gain came, 2 without any."""
    np.testing.assert_allclose(
        easing(np.array([1.0, 0.75, 0.5, 0.25, 0.0])), [0.1, 0.875, 1, 1.125, 2]
    )


def test_the_first_step_of_exploring():
    """Adam's first step has the length of the learning rate in each logit, against the slope."""
    A, y = np.random.default_rng(2).standard_normal((9, 4)), np.linspace(-1, 1, 9)
    problem, logit = Linear(A, y), lambda u: np.log(u / (1 - u))
    rows, slopes = problem(STARTS)
    slope = np.einsum("nr,nrk->nk", rows, slopes)
    ends = explore(problem, STARTS, steps=1)
    np.testing.assert_allclose(logit(ends) - logit(STARTS), -0.3 * np.sign(slope), rtol=1e-4)


def test_exploring_goes_down_and_stays_inside():
    problem = Banana()
    cost = lambda u: 0.5 * np.sum(np.square(problem(u)[0]), axis=1)
    ends = explore(problem, STARTS, steps=30)
    assert np.all((ends > 0) & (ends < 1))
    assert np.mean(cost(ends) < 0.3 * cost(STARTS)) > 0.9

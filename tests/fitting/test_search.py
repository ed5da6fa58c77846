"""The noise that a candidate leaves, and minima from given starts."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import lsq_linear, minimize_scalar

from mi_lcair.fitting.data import Variant
from mi_lcair.fitting.search import (
    assess,
    box_step,
    compare,
    descend,
    easing,
    effective_count,
    explore,
    levenberg_marquardt,
    neighbour_correlation,
    search,
)
from tests.fitting.synthetic import MODEL


class Leftover:
    """Data of which the residuals are given."""

    def __init__(self, rows, has_sigma=False, tables=0):
        self.rows_, self.points = np.asarray(rows, float), len(rows) - tables
        self.rows, self.has_sigma = len(rows), has_sigma
        self.directional = ["table"] if tables else []
        self.theta_i = np.zeros(self.points)
        self.theta_r = np.linspace(0, 1, self.points)

    def residuals(self, variant):
        def rows(u):
            return self.rows_[None], None

        rows.instrument = lambda u: (np.ones((1, self.points)), None)
        return rows

    def per_decade(self, f):
        return np.append(np.full(self.points, 5.0), np.zeros(self.rows - self.points))


CANDIDATE = SimpleNamespace(variant=None, u=np.zeros(4), size=3)
WHITE = np.random.default_rng(0).normal(0, 2, 400)


def test_variance_of_white_residuals():
    noise = assess(Leftover(WHITE), CANDIDATE)
    assert noise.variance == pytest.approx(np.sum(WHITE**2) / 397)
    assert (noise.correlation, noise.effective, noise.brdf_effective) == (0, 400, 400)
    assert noise.curvature == 1 and noise.level_dex == 0
    small = Leftover(WHITE / 100, has_sigma=True)
    assert assess(small, CANDIDATE).variance == 1  # sigma was stated
    assert assess(Leftover(WHITE, has_sigma=True), CANDIDATE).variance == noise.variance


def test_variance_of_correlated_residuals():
    """Waves of 40 points: the few independent ones make the variance of each larger."""
    waves = np.repeat(WHITE[:40], 10)
    noise = assess(Leftover(waves), CANDIDATE)
    pairs = waves[1:] * waves[:-1]
    r = 2 * pairs.sum() / (np.sum(waves[1:] ** 2) + np.sum(waves[:-1] ** 2))
    assert noise.correlation == pytest.approx(r)
    assert noise.effective == pytest.approx(400 * (1 - r) / (1 + r))
    share = noise.effective / 400
    assert noise.variance == pytest.approx(np.sum(waves**2) / 397 / share)
    assert noise.level_dex == pytest.approx(np.sqrt(r) * np.sqrt(np.mean((waves / 5) ** 2)))


def test_directional_tables_count_in_full():
    """In a joint fit the rows have unit variance at least."""
    rows = np.append(WHITE, [10.0, -10.0])
    noise = assess(Leftover(rows, tables=2), CANDIDATE)
    assert noise.effective == 402 and noise.brdf_effective == 400
    assert noise.variance == pytest.approx(np.sum(rows**2) / 399)
    assert assess(Leftover(rows / 100, tables=2), CANDIDATE).variance == 1


def test_outliers_of_a_robust_fit():
    """Influence r / (1 + (r/c)^2) and its mean slope, of the Cauchy loss."""
    rows = np.append(WHITE[:-4], [50.0, -60, 70, 80])
    noise = assess(Leftover(rows), CANDIDATE, c=4.0)
    ratio2 = (rows / 4) ** 2
    curvature = np.mean((1 - ratio2) / (1 + ratio2) ** 2)
    assert noise.curvature == pytest.approx(curvature)
    influence = np.sum((rows / (1 + ratio2)) ** 2)
    assert noise.variance == pytest.approx(influence / curvature**2 / 397)
    assert noise.outliers == 4


class Valleys:
    """Residuals with minima at u0 = 0.2, of cost 0, and near 0.8; the others are at 0.5."""

    unit, half_angle, rows = 1.0, 0.0, 5

    def residuals(self, variant, aperture=True):
        return self

    def __call__(self, u, lanes=None):
        x, zero = u[:, 0], np.zeros(len(u))
        rows = [5 * (x - 0.2) * (x - 0.8), 0.1 * (x - 0.2), *(u[:, 1:] - 0.5).T]
        slopes = np.zeros((len(u), 5, 4))
        slopes[:, 0, 0], slopes[:, 1, 0] = 5 * (2 * x - 1.0), 0.1 + zero
        slopes[:, [2, 3, 4], [1, 2, 3]] = 1.0
        return np.stack(rows, axis=1), slopes


def test_share_of_the_starts_in_the_lowest_valley():
    starts = np.full((5, 4), 0.4)
    starts[:, 0] = [0.02, 0.15, 0.25, 0.85, 0.98]
    best = search(Valleys(), Variant(MODEL, "thesis"), starts)
    np.testing.assert_allclose(best.u, [0.2, 0.5, 0.5, 0.5], atol=1e-4)
    assert best.cost < 1e-8 and best.share == pytest.approx(0.6)
    finer = descend(best, best.residuals, 1e-12)
    np.testing.assert_allclose(finer.u, [0.2, 0.5, 0.5, 0.5], atol=1e-9)


def test_a_variance_of_rounding_alone():
    """Residuals of nothing have the variance of 1e-9 decades."""
    noise = assess(Leftover(np.zeros(50)), CANDIDATE)
    assert noise.variance == pytest.approx((1e-9 * 5) ** 2, rel=1e-9, abs=0)


def test_noise_of_few_and_of_strange_residuals():
    """As many points as parameters leave one degree of freedom, and nearly all far ones a slope."""
    rows = np.array([1.0, -2.0, 1.5])
    assert assess(Leftover(rows), CANDIDATE).variance == pytest.approx(np.sum(rows**2))
    noise = assess(Leftover(np.full(40, 10.0) * (-1) ** np.arange(40)), CANDIDATE, c=4.0)
    assert noise.curvature == 0.1


@pytest.mark.parametrize("distance, outliers", [(3.9, 0), (4.1, 2)])
def test_far_residuals(distance, outliers):
    """Beyond 4 standard deviations of the inner half, which is 1 here."""
    rows = np.append(np.tile([1, -1], 20) / 1.4826, [distance, -distance])
    assert assess(Leftover(rows), CANDIDATE).outliers == outliers


class Line(Leftover):
    """Points that measure u0 alone; the other three coordinates are 0.5."""

    unit, half_angle = 1.0, 0.0

    def __init__(self, points):
        self.measured = np.append(points, np.full(3, 0.5))
        super().__init__(np.zeros(len(self.measured)))

    def residuals(self, variant, aperture=True):
        def rows(u, lanes=None):
            x = np.concatenate([np.repeat(u[:, :1], self.rows - 3, axis=1), u[:, 1:]], axis=1)
            slopes = np.zeros((len(u), self.rows, 4))
            slopes[:, :-3, 0] = 1
            slopes[:, [-3, -2, -1], [1, 2, 3]] = 1
            return 100 * (x - self.measured), 100 * slopes

        rows.instrument, rows.unit = lambda u: (np.ones((1, self.points)), None), 1.0
        return rows


@pytest.mark.parametrize("robust", [False, True])
def test_the_minimum_of_points_with_an_outlier(robust):
    """Their mean, or the minimum of the Cauchy loss at 2.385 inner deviations of its residuals."""
    points = np.append(0.4 + 0.02 * np.random.default_rng(5).standard_normal(40), [0.9, 0.95])
    steps, settings = [], SimpleNamespace(starts=4, seed=1, robust=robust)
    variants = [Variant(MODEL, "thesis"), Variant(MODEL, "normalized")]
    best, candidates, noise = compare(Line(points), variants, settings, lambda: steps.append(1))
    assert len(steps) == len(candidates) == 2 and noise.outliers == 2
    assert min(candidate.criterion for candidate in candidates) == 0
    expected = points.mean()
    for _ in range(50 if robust else 0):
        rows = 100 * np.append(expected - points, np.zeros(3))
        c = 2.385 * 1.4826 * np.median(np.abs(rows))
        loss = lambda x, c=c: np.sum(np.log1p((100 * (x - points) / c) ** 2))
        expected = minimize_scalar(loss, bounds=(0.3, 0.5), options={"xatol": 1e-9}).x
    assert best.u[0] == pytest.approx(expected, abs=1e-5)
    np.testing.assert_allclose(best.u[1:], 0.5, atol=1e-6)


def autocorrelated(correlation, scans=9, length=80, seed=0):
    rng = np.random.default_rng(seed)
    rows = rng.standard_normal((scans, length))
    for k in range(1, length):
        rows[:, k] = correlation * rows[:, k - 1] + np.sqrt(1 - correlation**2) * rows[:, k]
    fixed, scanned = np.meshgrid(np.arange(scans), np.arange(length), indexing="ij")
    return rows.ravel(), fixed.ravel(), scanned.ravel()


@pytest.mark.parametrize("scanned_is_theta_i", [True, False])
def test_residuals_that_follow_each_other_count_less(scanned_is_theta_i):
    rows, fixed, scanned = autocorrelated(0.8)
    shuffled = np.random.default_rng(1).permutation(len(rows))
    angles = (scanned, fixed) if scanned_is_theta_i else (fixed, scanned)
    count, correlation = effective_count(rows[shuffled], *(angle[shuffled] for angle in angles))
    assert correlation == pytest.approx(0.8, abs=0.07)
    assert count == pytest.approx(720 * 0.2 / 1.8, rel=0.4)


def test_white_residuals_count_in_full():
    assert effective_count(*autocorrelated(0.0)) == (720, 0)


def test_neighbours_along_a_scan():
    """2 sum of products over the sum of squares of all pairs; scans do not touch."""
    theta_i, theta_r = np.repeat([0.1, 0.2], 4), np.tile([0.0, 0.3, 0.1, 0.2], 2)
    rows = np.array([1.0, 4, 2, 3, -1, 2, 0, 1])
    value, pairs = neighbour_correlation(rows, theta_i, theta_r)
    products = 1 * 2 + 2 * 3 + 3 * 4 + -1 * 0 + 0 * 1 + 1 * 2
    squares = 1 + 4 + 4 + 9 + 9 + 16 + 1 + 0 + 0 + 1 + 1 + 4
    assert value == pytest.approx(2 * products / squares) and pairs == 6
    assert neighbour_correlation(0 * rows, theta_i, theta_r) == (0, 6)


def test_limit_of_a_correlation_by_chance():
    """3 / sqrt(pairs); fewer independent residuals than parameters are none."""
    angles = np.zeros(100), np.linspace(0, 1, 100)
    for r, is_seen in ((0.33, True), (0.27, False)):
        rows = np.cos(np.arccos(r) * np.arange(100))  # neighbours correlate by about r
        value, pairs = neighbour_correlation(rows, *angles)
        count, correlated = effective_count(rows, *angles)
        assert (correlated > 0) == (value >= 3 / np.sqrt(pairs)) == is_seen
        assert count == pytest.approx(100 * (1 - value) / (1 + value) if is_seen else 100)
    assert effective_count(np.ones(100), *angles, fewest=5) == (5, 1)


# Descents on problems with an independently known minimum
# --------------------------------------------------------

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

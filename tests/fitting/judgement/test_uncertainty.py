"""Error bars against scipy and against repeated fits, also for correlated residuals."""

import numpy as np
import pytest
from drjit.llvm.ad import Array3f64, Float64
from scipy import optimize, stats
from scipy.optimize import curve_fit

from mi_lcair import fitting
from mi_lcair.fitting.cube import parameters_at
from mi_lcair.fitting.judgement.uncertainty import (
    Linearized,
    effective_count,
    neighbour,
    neighbour_correlation,
    profile_intervals,
    standard_errors,
)
from mi_lcair.physics.reflection.models import MODELS
from tests.fitting.numpy_model import brdf
from tests.fitting.synthetic import MODEL, NAMES, ROUGH, fit, scan, scan_of


def test_standard_errors_and_correlation_are_those_of_scipy():
    data = scan(ROUGH, step=1, noise=0.05, seed=5)
    log_model = lambda angles, *parameters: np.log10(brdf(*angles, *parameters))
    expected, covariance = curve_fit(
        log_model, (data.theta_i, data.theta_r), np.log10(data.brdf), p0=ROUGH
    )
    errors = np.sqrt(np.diag(covariance))
    result = fit(data, form="thesis", starts=4)
    np.testing.assert_allclose([result.parameters[name] for name in NAMES], expected, rtol=1e-5)
    np.testing.assert_allclose([result.standard_error[name] for name in NAMES], errors, rtol=0.02)
    np.testing.assert_allclose(result.correlation, covariance / np.outer(errors, errors), atol=0.02)


@pytest.mark.slow
def test_intervals_of_a_nearly_linear_problem_are_two_standard_errors_wide():
    result = fit(scan(ROUGH, step=1, noise=0.05, seed=5), form="thesis", starts=4)
    for name in NAMES:
        low, high = result.interval[name]
        # The factor is Student's t.
        assert (high - low) / 2 == pytest.approx(1.97 * result.standard_error[name], rel=0.05)


@pytest.mark.slow
def test_true_values_lie_inside_two_standard_errors():
    """About 95 % of 80 true values (20 repetitions, 4 parameters) lie inside two standard errors.

    A binomial distribution gives 69 or more with a probability of 99.9 %.
    """
    inside = 0
    for seed in range(20):
        result = fit(scan(ROUGH, step=4, noise=0.05, seed=seed), form="thesis", starts=2, seed=seed)
        assert set(result.verdict.values()) == {"determined"}
        inside += sum(
            abs(result.parameters[name] - true) <= 2 * result.standard_error[name]
            for name, true in zip(NAMES, ROUGH)
        )
    assert 69 <= inside <= 79


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


U = np.array([0.3, 0.4, 0.6, 0.5])
FREE = np.array([True, True, False, True])
SLOPES = np.random.default_rng(0).normal(size=(30, 4))
LEVEL = np.random.default_rng(1).normal(size=30)
NEAR = Linearized(MODEL, U, FREE, SLOPES, 0.25, LEVEL)


def jacobian(step=1e-6):
    """Derivatives of the parameters with respect to the coordinates."""
    ends = [parameters_at(MODEL, U + sign * step * np.eye(4))[0] for sign in (1, -1)]
    return ((ends[0] - ends[1]) / (2 * step)).T


def test_covariance_of_a_linearized_fit():
    """(J^T J / variance + 12)^-1 of the free coordinates, carried to the parameters."""
    J = SLOPES[:, FREE]
    inverse = np.linalg.inv(J.T @ J / 0.25 + 12 * np.eye(3))
    np.testing.assert_allclose(NEAR.cube_covariance[np.ix_(FREE, FREE)], inverse)
    assert not NEAR.cube_covariance[2].any()
    D = jacobian()[:, FREE]
    np.testing.assert_allclose(NEAR.covariance(with_level=False), D @ inverse @ D.T, rtol=1e-5)
    shift = inverse @ (J.T @ LEVEL) / 0.25
    np.testing.assert_allclose(NEAR.shift[FREE], shift)
    both = inverse + np.outer(shift, shift)
    np.testing.assert_allclose(NEAR.covariance(), D @ both @ D.T, rtol=1e-5)
    np.testing.assert_allclose(NEAR.parameters, MODEL.values_at(U))


def test_shift_of_the_common_scale():
    """The larger change of either sign, within the cube."""
    expected = [
        np.abs(MODEL.values_at(np.clip(U + sign * NEAR.shift, 0, 1)) - MODEL.values_at(U))
        for sign in (1, -1)
    ]
    np.testing.assert_allclose(NEAR.level_shift(), np.max(expected, axis=0), rtol=1e-9)


def test_standard_errors_are_at_most_the_range():
    ranges = [parameter.upper - parameter.lower for parameter in MODEL.parameters]
    found = standard_errors(MODEL, np.diag([1e-4, 1e9, -1e-20, 0.04]))
    np.testing.assert_allclose(found, [0.01, ranges[1], 0, 0.2])


def test_start_of_a_profile():
    """The others follow as their covariance says, if that changes them by half at most."""
    best = np.array([0.3, 0.2, 0.4, 0.25])
    matrix = np.diag([1e-4] * 4)
    matrix[0, 1] = matrix[1, 0] = 5e-5
    matrix[0, 2] = matrix[2, 0] = -1.9e-4
    near = neighbour(MODEL, best, matrix, 0, 0.4)
    np.testing.assert_allclose(near, [0.4, 0.25, 0.21, 0.25])
    far = neighbour(MODEL, best, matrix, 0, 0.41)
    np.testing.assert_allclose(far, [0.41, 0.255, 0.4, 0.25])  # 0.209 is more than half of 0.4
    held = neighbour(MODEL, best, 0 * matrix, 0, 0.35)
    np.testing.assert_allclose(held, [0.35, 0.2, 0.4, 0.25])


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


class LinearInParameters:
    """Rows A (p - best), whose profiles are known; `unit` is the change for one decade."""

    unit = 50.0

    def __init__(self, A, best):
        self.A, self.best = A, best

    def __call__(self, u, lanes=None):
        values, slopes = parameters_at(MODEL, u)
        return (values - self.best) @ self.A.T, self.A @ slopes


@pytest.mark.parametrize("level, curvature", [(0.0, 0.8), (0.003, 0.8), (0.0, 0.02)])
def test_profiles_of_linear_rows(level, curvature):
    """t standard errors with the others refitted; the common scale is added in squares.

    The rise of the cost by variance t^2 / 2 is that of a parabola. With the smallest curvature the
    end lies between the minimum and the first point of the profile.
    """
    A = 200 * np.random.default_rng(3).normal(size=(40, 4))
    best = MODEL.values_at(U)
    rows = LinearInParameters(A, best)
    slopes = rows(U[None])[1][0]
    variance, dof = 0.5, 30
    free = np.ones(4, dtype=bool)
    near = Linearized(MODEL, U, free, slopes, variance, level * slopes.sum(axis=1))
    found = profile_intervals(near, rows, 0.0, curvature, dof)
    errors = np.sqrt(np.diag(np.linalg.inv(A.T @ A / (variance * curvature))))
    t = stats.t.ppf(0.975, dof)
    expected = np.hypot(t * errors, t * near.level_shift())
    np.testing.assert_allclose(best - found[:, 0], expected, rtol=5e-3)
    np.testing.assert_allclose(found[:, 1] - best, expected, rtol=5e-3)


@pytest.mark.parametrize("form", ["standard", "auto"])
def test_interval_of_an_absorption_at_its_bound(form):
    """The chi-square at its end, with the others refitted by SciPy, is t^2 larger.

    The BRDF depends on k^2, so that k has no standard error at 0. "auto" holds k there.
    """
    microfacet = MODELS["microfacet"]
    data = scan_of(microfacet, (0.2, 2.3, 1.6, 0.0, 0.1), step=4, noise=0.01, seed=1)
    fit = fitting.fit(data, model="microfacet", form=form, starts=4)
    assert fit.parameters["k"] == 0 and (fit.restriction is None) == (form == "standard")
    source, observer = (
        Array3f64(Float64(sign * np.sin(angle)), 0, Float64(np.cos(angle)))
        for sign, angle in ((1, data.theta_i), (-1, data.theta_r))
    )
    best, free = np.array([fit.parameters[name] for name in microfacet.names]), [0, 1, 2, 4]

    def rows(others):
        surface = microfacet.surface_of(np.insert(others, 3, fit.interval["k"][1]), "standard")
        return np.log10(np.array(microfacet.f(surface, source, observer)) / data.brdf)

    refitted = optimize.least_squares(rows, best[free], x_scale=0.01)
    rise = 2 * refitted.cost / (data.brdf.size * fit.rms_dex**2) - 1
    dof = data.brdf.size - 5
    assert np.sqrt(rise * dof) == pytest.approx(stats.t.ppf(0.975, dof), rel=0.15)


class CubicInParameters(LinearInParameters):
    """Rows A (x + c x^3) with x = p - best, and one row that does not change."""

    def __call__(self, u, lanes=None):
        values, slopes = parameters_at(MODEL, u)
        x = values - self.best
        inner = (1 + 3 * CUBIC * x**2)[..., None] * slopes
        rows = (x + CUBIC * x**3) @ self.A.T
        rows = np.concatenate([rows, np.full((len(u), 1), 5.0)], axis=1)
        return rows, np.concatenate([self.A @ inner, np.zeros((len(u), 1, 4))], axis=1)


CUBIC = 3e3


def test_profiles_of_curved_rows():
    """The end is where a (x + c x^3) = t, between the points of a profile."""
    A, best = np.diag([200.0, 300, 150, 250]), MODEL.values_at(U)
    rows = CubicInParameters(A, best)
    near = Linearized(MODEL, U, np.ones(4, dtype=bool), rows(U[None])[1][0], 1.0, np.zeros(5))
    found = profile_intervals(near, rows, 0.5 * 5.0**2, 1.0, 30)
    lower, upper = MODEL.feasible_range(best)
    for k, slope in enumerate(np.diag(A)):
        roots = np.roots([CUBIC, 0, 1, -stats.t.ppf(0.975, 30) / slope])
        expected = roots[np.isreal(roots)].real[0]
        ends = np.clip(best[k] + [-expected, expected], lower[k], upper[k])
        np.testing.assert_allclose(found[k] - best[k], ends - best[k], rtol=0.02)
        assert expected < 0.95 * stats.t.ppf(0.975, 30) / slope


def test_intervals_end_at_the_feasible_range():
    """Data that say nothing about the parameters."""
    best = MODEL.values_at(U)
    rows = LinearInParameters(1e-6 * np.eye(4), best)
    near = Linearized(MODEL, U, np.ones(4, dtype=bool), rows(U[None])[1][0], 1.0, np.zeros(4))
    found = profile_intervals(near, rows, 0.0, 1.0, 30)
    np.testing.assert_allclose(found.T, MODEL.feasible_range(best))

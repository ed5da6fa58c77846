"""Error bars against scipy and against repeated fits, also for correlated residuals."""

import numpy as np
import pytest
from scipy.optimize import curve_fit

from mi_lcair.fitting.judgement.uncertainty import effective_count
from tests.fitting.numpy_model import brdf
from tests.fitting.synthetic import NAMES, ROUGH, fit, scan


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

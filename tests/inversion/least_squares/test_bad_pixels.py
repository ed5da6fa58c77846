"""Bad pixels among noisy residuals."""

import numpy as np
from scipy import stats

from mi_lcair.inversion.least_squares.bad_pixels import bad_pixels
from tests.inversion.blocks import block

N, SIGMA = 2000, 0.3
NOISE = SIGMA * np.random.default_rng(3).normal(size=N)
WEIGHT = np.full(N, SIGMA**-2.0)


def found(measured, is_image=True):
    image = block(np.zeros((2, N)), np.zeros((2, N, 1)), measured, SIGMA, is_image=is_image)
    return bad_pixels(image, np.zeros(1), WEIGHT)


def test_noise_alone_has_no_bad_pixels():
    """In 200 draws about 5 % have one, as stated."""
    random = np.random.default_rng(0)
    alarms = sum(found(SIGMA * random.normal(size=N))[0].any() for _ in range(200))
    assert stats.binomtest(alarms, 200, 0.05).pvalue > 1e-3


def test_pixels_far_from_the_prediction_are_listed():
    limit = SIGMA * stats.norm.isf(0.025 / N)
    measured = np.clip(NOISE, -0.9 * limit, 0.9 * limit)
    measured[[5, 700, 1999]] = 1.05 * limit, -1.05 * limit, 1e6
    is_bad, are_many = found(measured)
    assert np.flatnonzero(is_bad).tolist() == [5, 700, 1999] and not are_many
    assert not found(measured, is_image=False)[0].any()


def test_the_limit_follows_the_median_of_the_residuals():
    """Residuals four times as large: the same pixels count as noise, and an outlier does not."""
    limit = SIGMA * stats.norm.isf(0.025 / N)
    measured = 4 * np.clip(NOISE, -0.9 * limit, 0.9 * limit)
    measured[9] = 4.6 * limit
    is_bad, are_many = found(measured)
    assert np.flatnonzero(is_bad).tolist() == [9] and are_many


def test_of_many_pixels_the_worst_are_listed():
    measured = NOISE.copy()
    measured[:400] = np.linspace(10, 50, 400)
    is_bad, are_many = found(measured)
    assert are_many and np.flatnonzero(is_bad).tolist() == list(range(300, 400))

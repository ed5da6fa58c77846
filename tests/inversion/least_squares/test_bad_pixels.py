"""Bad pixels among noisy residuals."""

import numpy as np
from scipy import stats

from mi_lcair.inversion.least_squares.bad_pixels import ROUNDS, Search, bad_pixels
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


def test_a_search_ends_when_it_finds_the_same_pixels():
    """Their weights are 0, those of others stay."""
    measured = 0 * NOISE
    measured[7] = 100.0
    image = block(np.zeros((2, N)), np.zeros((2, N, 1)), measured, SIGMA, is_image=True)
    search, x = Search([image]), np.zeros(1)
    assert search.continues([image], x, [WEIGHT]) and not search.continues([image], x, [WEIGHT])
    (weighed,) = search.weighed([image], [WEIGHT])
    assert np.flatnonzero(weighed.weight != WEIGHT).tolist() == [7] and weighed.weight[7] == 0


def test_a_search_gives_up_where_residuals_are_large_everywhere():
    """Other pixels are bad in each round; after the last one none is."""
    search, x, count = Search([block([NOISE], np.zeros((1, N, 1)), NOISE)]), np.zeros(1), 0
    random = np.random.default_rng(1)
    while True:
        measured = 100 * SIGMA * random.normal(size=N)
        measured[random.integers(N)] = 1e9
        image = block(np.zeros((2, N)), np.zeros((2, N, 1)), measured, SIGMA, is_image=True)
        count += 1
        if not search.continues([image], x, [WEIGHT]):
            break
    assert count == ROUNDS + 1 and not search.bad[0].any()

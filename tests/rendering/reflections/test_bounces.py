"""How many reflections are needed, from invented radiances of each number of reflections."""

import numpy as np
import pytest

from mi_lcair.rendering.reflections.bounces import beyond_last, fewest_bounces


@pytest.mark.parametrize("each_pixel", [False, True])
@pytest.mark.parametrize("ratio", [0.1, 0.5, 0.8])
def test_geometric_series(ratio, each_pixel):
    """Beyond n lies ratio^(n + 1) of all, also where the last recorded number is smaller than n."""
    by_bounce = np.broadcast_to(ratio ** np.arange(17)[None, :, None], (8, 17, 4))
    for n in (1, 3, 16):
        number, error = fewest_bounces(by_bounce, 1.01 * ratio ** (n + 1), each_pixel)
        assert number == n and error == pytest.approx(ratio ** (n + 1), rel=1e-6)
    number, error = fewest_bounces(by_bounce, 0.5 * ratio**17, each_pixel)
    assert number == 16 and error == pytest.approx(ratio**17, rel=1e-6)


def test_radiance_that_grows_cannot_be_truncated():
    growing = np.ones((8, 33, 4)) * np.linspace(1.0, 1.2, 33)[:, None]
    assert fewest_bounces(growing, 1e-3, False)[1] > 0.9


def test_pixels_differ():
    """The rms over the pixels, as a fraction of the mean over all of them."""
    by_bounce = np.zeros((8, 3, 2))
    by_bounce[:, 0], by_bounce[:, 1, 0] = 1.0, 0.2
    number, error = fewest_bounces(by_bounce, 0.5, True)
    assert number == 0 and error == pytest.approx(0.2 / np.sqrt(2) / 1.1)
    assert fewest_bounces(by_bounce, 0.1, True) == (1, 0)


def test_the_bound_of_a_noisy_truncation():
    """Of the mean: Student's 95 % bound of the missing part; of pixels: its rms."""
    random = np.random.default_rng(0)
    by_bounce = np.zeros((8, 4, 3))
    by_bounce[:, 0] = 10.0
    by_bounce[:, 1] = 2 + random.normal(size=(8, 3))
    missing = by_bounce[:, 1].mean(axis=1) / by_bounce.sum(axis=1).mean(axis=1)
    expected = missing.mean() + 2.364624 * missing.std(ddof=1) / np.sqrt(8)
    assert fewest_bounces(by_bounce, 0.5, False) == (0, pytest.approx(expected))
    by_pixel = by_bounce[:, 1].mean(axis=0)
    expected = np.sqrt(np.mean(by_pixel**2)) / by_bounce.sum(axis=1).mean()
    assert fewest_bounces(by_bounce, 0.5, True) == (0, pytest.approx(expected))


def test_a_batch_that_met_nothing_knows_nothing():
    by_bounce = np.ones((2, 2, 1)) * [[[1.0], [0.0]]]
    by_bounce[1] = 0
    assert fewest_bounces(by_bounce, 0.01, False)[1] > 1


def test_what_lies_beyond_the_last():
    """A geometric series of the last two; of a sum of several, the same ratio by their number."""
    assert beyond_last(np.array([8.0, 4.0, 3.0])) == pytest.approx(0.75 / 0.25)
    assert beyond_last(np.array([4.0, 5.0])) == pytest.approx(0.999 / 0.001)
    assert beyond_last(np.array([4.0])) == beyond_last(np.array([4.0, 0.0])) == 0
    assert beyond_last(np.array([0.0, 4.0])) == beyond_last(np.zeros(3), 2) == 0
    # 1, r, and r^2 + r^3 + r^4 together: beyond are r^5 + ... = r^3 of r^2 + r^3 + ...
    r = 0.5
    whole = r**2 / (1 - r)
    part = whole * (1 - r**3)
    ratio = part / (part + r)
    assert beyond_last(np.array([1.0, r, part]), 2) == pytest.approx(ratio**3)

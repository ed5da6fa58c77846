"""Probes: what they record, and comparisons between them."""

import numpy as np
import pytest
from scipy import stats

import mi_lcair
from mi_lcair.planning.probe import (
    FEW_COUNTS,
    ProbeSeries,
    Settings,
    cost,
    differ,
    difference,
    half_width,
    pixels_launch,
    upper,
)
from tests.planning.probes import SCATTER
from tests.planning.probes import probe as invented


def test_probes_count_few_or_all_reflections():
    """Both record the same radiance; the last of few entries is the sum of the others."""
    scene = mi_lcair.load("furnace", resolution=16)
    for each_pixel in (False, True):
        done = []
        probes = ProbeSeries(scene, each_pixel, progress=lambda *counts: done.append(counts))
        whole = probes(Settings.of(scene))
        few = probes(Settings.of(scene), counted=FEW_COUNTS)
        assert done == [(1, 3), (2, 4)]
        assert whole.is_complete and not few.is_complete
        assert few.by_bounce.shape[1] == FEW_COUNTS + 1
        assert few.value == pytest.approx(whole.value, rel=1e-5)
        assert few.by_bounce[:, -1] == pytest.approx(
            whole.by_bounce[:, FEW_COUNTS:].sum(axis=1), rel=1e-4, abs=1e-7
        )


def test_the_difference_of_images_is_that_of_the_pixels():
    """Without noise it is the rms over the pixels; noise makes it larger, but not by its size."""
    random = np.random.default_rng(1)
    gap = random.normal(size=2000) * 0.01
    still = np.broadcast_to(gap, (8, 2000))
    assert difference(still, True) == pytest.approx(0.01, rel=0.1)
    noisy = still + 0.05 * random.normal(size=(8, 2000))
    assert 0.005 < difference(noisy, True) < 0.015


def test_the_difference_of_means():
    """Student's bound over the randomisations, whatever the sign."""
    gap = np.array([0.3, -0.1, 0.2, 0.4])[:, None] - [[0.1, -0.1]]
    width = stats.t.ppf(0.975, 3) * np.std([0.3, -0.1, 0.2, 0.4], ddof=1) / 2
    assert half_width(gap.mean(axis=1)) == pytest.approx(width)
    assert difference(gap, False) == difference(-gap, False) == pytest.approx(0.2 + width)
    assert upper(np.array([-0.3, 0.1, -0.2, -0.4])) == pytest.approx(-0.2 + width)


def test_pixels_in_pairs_of_randomisations():
    """Products of neighbours, their mean over the pixels, and its bound."""
    gap = np.array([[1.0, 2, 3], [2, 1, 2], [0, 1, 1], [3, 3, 2]])
    products = np.array([(2 + 0) / 2, (2 + 3) / 2, (6 + 2) / 2])
    bound = products.mean() + stats.t.ppf(0.975, 2) * products.std(ddof=1) / np.sqrt(3)
    assert difference(gap, True) == pytest.approx(np.sqrt(bound))
    assert difference(np.array([[1.0, 1.0], [-1.0, -1.0]]), True) == 0


def test_cost_of_a_path():
    assert cost(3.0, False) == 3 and cost(3.0, True) == 7 and cost(0.5, True) == 0.5


def test_means_that_differ():
    """By more than the share and the 95 % interval together."""
    noise = 0.08  # a half width of 0.02
    width = stats.t.ppf(0.975, 63) * 0.08 / 8
    for gap, share, expected in ((width + 0.011, 0.01, True), (width + 0.009, 0.01, False)):
        assert differ(invented(1.0), invented(1 + gap, noise), share) is np.bool_(expected)
        assert differ(invented(1.0), invented(1 - gap, noise), share) is np.bool_(expected)
    assert differ(invented(10.0), invented(10.2), 0.019) == np.True_
    assert differ(invented(10.0), invented(10.2), 0.021) == np.False_


def test_figures_of_a_probe():
    one = invented(2.0, 0.3, paths=100, chance=5.0)
    assert one.mean == pytest.approx(2) and one.variance == pytest.approx(0.09)
    assert one.may_lack == pytest.approx(5 / 200) and one.is_complete
    assert not invented(reflections=3).is_complete
    two = invented(value=np.hstack([SCATTER, 3 * SCATTER]))
    assert two.variance == pytest.approx(5)


@pytest.mark.parametrize(
    ("size", "windows"), [((8, 8), 64), ((32, 32), 64), ((128, 128), 1024), ((1000, 500), 2048)]
)
def test_number_of_pixels(size, windows):
    """One of 16, between 64 and 2048; a stride without a divisor of the width."""
    launch = pixels_launch(*size, seed=3, factor=5)
    assert 0.85 * windows <= launch.windows <= windows + 10
    assert np.gcd(launch.stride, size[0]) == 1
    assert (launch.points, launch.randomisations, launch.seed) == (10, 8, 3)
    assert (launch.columns, launch.rows) == size

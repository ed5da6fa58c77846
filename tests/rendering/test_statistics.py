"""Errors of totals by hand: scatter, edges, sources that no path has met."""

from types import SimpleNamespace

import numpy as np
import pytest

from mi_lcair.plugins.emission.draw_table import UnmetSources
from mi_lcair.rendering.statistics import edge_share, student_factor
from tests.rendering.made_totals import totals

NORMAL = 1.959964  # half of a normal 95 % interval
T7 = 2.364624  # half of Student's, for 7 degrees of freedom


def test_scatter_of_randomisations():
    """Means 1, 2, 3, 4: standard deviation 1.29099, standard error half of it."""
    total = totals([1, 2, 3, 4])
    assert total.mean() == pytest.approx(2.5)
    assert total.standard_error() == pytest.approx(1.2909944 / 2)
    assert total.half_width() == pytest.approx(3.182446 * 1.2909944 / 2)  # Student, 3 degrees


def test_all_randomisations_agree_on_an_edge():
    """Eight times the same mean: a part q of a point may be missed, with (1 - q)^8 = 5 %."""
    q = 1 - 0.05 ** (1 / 8)
    assert (1 - q) ** 8 == pytest.approx(0.05, rel=1e-4)
    assert edge_share(8) == pytest.approx(q / NORMAL, rel=1e-4)
    total = totals(np.full(8, 3.0), points=64, lowest=1.0, highest=5.0)
    assert total.half_width() == pytest.approx(4.0 * q / 64, rel=1e-4)
    assert total.standard_error() == pytest.approx(4.0 * q / 64 / NORMAL, rel=1e-4)
    # Fewer than 8 points do not divide the window evenly
    assert totals(np.full(8, 3.0), points=7, lowest=1.0, highest=5.0).half_width() == 0


def test_the_larger_of_scatter_and_edge_counts():
    scatter = np.array([2.9, 3.1] * 4)
    of_scatter = scatter.std(ddof=1) / np.sqrt(8)
    total = totals(scatter, points=64, lowest=1.0, highest=5.0)
    assert total.half_width() == pytest.approx(T7 * of_scatter, rel=1e-5)


def test_a_source_that_no_path_met():
    """2.5 paths of the brightest source: e^-2.5 = 8 % of such sources are missed."""
    unmet = UnmetSources(100.0)
    total = totals(np.full(8, 3.0), points=64, unmet=unmet)
    assert total.half_width() == pytest.approx(2.5 * 100 / 512)
    assert total.missed_by_all() == pytest.approx(2.5 * 100 / 512 / NORMAL, rel=1e-5)
    assert total.mean_error() == pytest.approx(2.5 * 100 / 512 / NORMAL, rel=1e-5)
    # What drawn sources may add counts if it is more
    total = totals(np.full(8, 3.0), points=64, unmet=unmet, chance=300.0)
    assert total.half_width() == pytest.approx(2.5 * 300 / 512)


def test_a_shadow_that_no_path_met():
    """It takes away what 2.5 paths bring, where no source brings more."""
    unmet = UnmetSources(1.0)
    part = {"bounce.0": np.full((1, 8), 64 * 0.75)}
    total = totals(np.full(8, 3.0), points=64, unmet=unmet, channels=part)
    assert total.half_width() == pytest.approx(2.5 * 3 / 512)
    assert total.missed("bounce.0") == pytest.approx(2.5 * 1 / 512)
    assert total.mean_error() == pytest.approx(2.5 * 3 / 512 / NORMAL, rel=1e-5)


def test_a_channel_that_no_path_met_has_an_error():
    unmet = UnmetSources(100.0)
    dark = {"group.lamp": np.zeros((1, 8)), "group.wall": np.full((1, 8), 64 * 3.0)}
    total = totals(np.full(8, 3.0), points=64, unmet=unmet, channels=dark)
    assert total.standard_error("group.lamp") == pytest.approx(2.5 * 100 / 512 / NORMAL, rel=1e-5)
    # A part that paths have met may still lack what they have missed
    assert total.standard_error("group.wall") == pytest.approx(2.5 * 100 / 512 / NORMAL, rel=1e-5)


def test_a_group_misses_no_more_than_its_own_brightest_source():
    unmet = UnmetSources(100.0)
    wall = {"target.group.wall": np.full((1, 8), 64 * 3.0)}
    total = totals(np.full(8, 3.0), points=64, unmet=unmet, channels=wall)
    total.emitters = SimpleNamespace(brightest_of={"wall": 7.0})
    assert total.missed("target.group.wall") == pytest.approx(2.5 * 7 / 512, rel=1e-5)


def test_a_part_has_the_edge_of_the_whole_in_proportion():
    part = {"bounce.0": np.full((1, 8), 64 * 0.75)}
    total = totals(np.full(8, 3.0), points=64, lowest=1.0, highest=5.0, channels=part)
    assert total.standard_error("bounce.0") == pytest.approx(total.standard_error() / 4, rel=1e-6)


def test_edges_and_missed_sources_beside_the_scatter():
    """Squares of 0.0118, the edge's, less that of a scatter of 0.005; and of the missed source."""
    unmet = UnmetSources(7.0)
    scatter = np.array([3 - 0.005 * np.sqrt(7), 3 + 0.005 * np.sqrt(7)] * 4)
    total = totals(scatter, points=64, lowest=1.0, highest=5.0, unmet=unmet)
    assert total.scatter_error() == pytest.approx(0.005, rel=1e-6)
    edge, missed = 4.0 * (1 - 0.05 ** (1 / 8)) / 64 / NORMAL, 2.5 * 7 / 512 / NORMAL
    expected = np.sqrt(edge**2 - 0.005**2 + missed**2)
    assert total.unscattered_error() == pytest.approx(expected, rel=1e-5)


def test_rms_over_the_pixels_of_an_image():
    """Four pixels; the missed source is in one of them."""
    unmet = UnmetSources(10.0)
    radiance = [[1, 3], [2, 2], [3, 5], [4, 4]]
    total = totals(radiance, points=4, unmet=unmet)
    missed = 2.5 * 10 / 32 / NORMAL  # of the mean over all pixels
    variance = np.mean([1.0, 0, 1.0, 0]) + 4 * missed**2
    assert total.rms_error() == pytest.approx(np.sqrt(variance) / 3, rel=1e-5)


def test_a_dark_image_is_not_known():
    unmet = UnmetSources(10.0)
    assert totals(np.zeros(8), unmet=unmet).rms_error() is None
    assert totals(np.zeros(8)).rms_error() == 0
    assert totals([5.0], unmet=unmet).rms_error() is None  # one randomisation


def test_student_factors():
    assert student_factor(7) == pytest.approx(T7, rel=1e-6)
    assert student_factor(np.inf) == pytest.approx(NORMAL, rel=1e-6)
    assert student_factor(0) == np.inf


def test_all_channels_at_once():
    """Numbers of a list of channels are those of each channel, bit for bit."""
    rng = np.random.default_rng(0)
    names = ["target", "bounce.0", "group.wall", "target.group.lamp"]
    channels = {name: 64 * rng.random((3, 8)) for name in names}
    channels["target.group.lamp"][1] = 0
    radiance = 1 + rng.random((3, 8))
    total = totals(radiance, unmet=UnmetSources(9.0), highest=4.0, channels=channels)
    total.lowest["target"], total.highest["target"] = np.zeros(3), np.full(3, 3.5)
    total.emitters = SimpleNamespace(brightest_of={"wall": 7.0, "lamp": 0.1})
    total.systematic = 1e-3
    total.aim = SimpleNamespace(largest_on_model=np.ones(1), largest_weight=np.full(3, 2.0))
    total.aim.direct = None
    of = (total.mean, total.deviations, total.standard_error, total.half_width, total.missed)
    for numbers in (*of, total.edge_error, total.unscattered_error):
        np.testing.assert_array_equal(numbers([None, *names]), [*map(numbers, [None, *names])])

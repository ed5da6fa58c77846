"""Errors of totals by hand: scatter, edges, sources that no path has met."""

from types import SimpleNamespace

import numpy as np
import pytest

from mi_lcair.errors import InputError
from mi_lcair.plugins.emission.draw_table import UnmetSources
from mi_lcair.rendering.statistics import (
    Totals,
    check_valid,
    edge_share,
    invalid_remark,
    student_factor,
)
from tests.rendering.made_totals import launch_of, sums_of, totals

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


def test_an_error_that_samples_do_not_reduce():
    """1 % of the mean 3, beside the scatter: of each window, and of the mean over them."""
    total = totals([[2, 4], [3, 3]])
    total.systematic = 0.01
    assert total.standard_error() == pytest.approx([np.hypot(1, 0.03), 0.03])
    wide = np.hypot(12.7062047, NORMAL * 0.03)  # Student's factor for one degree of freedom
    assert total.half_width() == pytest.approx([wide, NORMAL * 0.03], rel=1e-6)
    assert total.mean_error() == pytest.approx(np.hypot(1 / 2, 0.03))
    assert totals([3.0]).mean_error() is None


def test_the_target_and_its_parts_have_the_edges_of_the_target():
    """The target's paths lie between 2 and 5, all paths between 1 and 5."""
    parts = {"target": 2.0, "target.bounce.0": 0.5, "bounce.0": 0.75}
    channels = {name: np.full((1, 8), 64 * mean) for name, mean in parts.items()}
    total = totals(np.full(8, 3.0), lowest=1.0, highest=5.0, channels=channels)
    total.lowest["target"], total.highest["target"] = np.full(1, 2.0), np.full(1, 5.0)
    edge = edge_share(8) / 64
    errors = {"target": 3 * edge, "target.bounce.0": 3 * edge / 4, "bounce.0": 4 * edge / 4}
    for name, error in errors.items():
        assert total.edge_error(name) == pytest.approx(error, rel=1e-9), name
    assert totals(np.full(8, 3.0), points=8, highest=2.0).edge_error() > 0


def test_sources_that_aimed_paths_have_not_met():
    """Paths with weights of up to 4, and 2 on the model; every third one begins on a facet."""
    total = totals(np.full(8, 3.0), unmet=UnmetSources(100.0), channels={
        name: np.full((1, 8), 64.0) for name in ("target", "group.wall")
    })  # fmt: skip
    total.emitters = SimpleNamespace(brightest_of={"wall": 7.0})
    total.aim = SimpleNamespace(largest_weight=4.0, largest_on_model=2.0, direct=None)
    names = {None: 4 * 100, "target": 2 * 100, "group.wall": 4 * 7}
    for name, most in names.items():
        assert total.largest_unmet(name) == most, name
        assert total.missed(name) == pytest.approx(2.5 * most / 512), name
    total.aim.direct = SimpleNamespace(largest_direct=50.0, largest_weight=9.0, every=3)
    for name, most in {None: 400, "group.wall": 3 * 50}.items():
        assert total.largest_unmet(name) == most, name
    total.aim.direct.largest_direct = 1e3
    assert total.largest_unmet("group.wall") == 3 * 9 * 7
    # Weights of 0, where nothing of the model is in view
    total.aim = SimpleNamespace(largest_weight=0.0, largest_on_model=0.0, direct=None)
    assert total.largest_unmet() == 3  # the mean, which a shadow may remove


def test_sources_that_are_rarely_drawn():
    """One with a probability of 2 %: 100 draws find it less than 3 times, 200 draws more often."""
    unmet = UnmetSources(1.0, 5.0, np.array([0.02]), np.array([30.0]))
    total = totals(np.full(8, 3.0), unmet=unmet)
    for draws, most in ((100.0, 30.0), (200.0, 5.0)):
        assert total.largest_unmet(draws=np.array([draws])) == most
    total.unmet_sums["largest"][:] = 12.0
    assert total.largest_unmet(draws=np.array([200.0])) == 12


def test_a_source_that_no_path_of_any_window_met():
    """It is in the window with the fewest paths, whose share of the mean is a half."""
    total = totals([[2.0, 2.0], [4.0, 4.0]], points=32, unmet=UnmetSources(50.0))
    total.traced[1] = 16
    assert total.missed_by_all() == pytest.approx(2.5 * 50 / 16 / 2 / NORMAL, rel=1e-6)
    total.unmet = UnmetSources(1.0)
    assert total.missed_by_all() == pytest.approx(2.5 * 3 / 16 / 2 / NORMAL, rel=1e-6)
    assert totals([2.0, 2.0]).missed_by_all() == 0


def test_launches_add_up():
    """Two of 4 points for each of 2 randomisations; 3 samples of the second one were invalid."""
    total = Totals(2, 2, unmet=UnmetSources(1.0))
    for mean, lacking in ((1.0, 0), (3.0, 3)):
        sums = sums_of(np.full((2, 2), mean), 4, mean - 1, mean + 1, chance=mean)
        sums.channels = {"target": np.array([[1.0, 2.0], [3.0, 4.0]])}
        sums.unmet["draws"], sums.tail = np.array([5.0, 6.0]), 10 * mean
        sums.valid[0, 1] -= lacking
        total.add(launch_of(2, 2, 4), sums)
    assert total.traced.tolist() == [16, 16] and total.paths.tolist() == [13, 16]
    assert (total.invalid, total.tail) == (3, 40)
    assert total.sums["target"].tolist() == [[6], [14]]  # without randomisations
    assert total.mean() == pytest.approx([32 / 13, 2]) and total.mean("target")[1] == 14 / 16
    assert (total.lowest["radiance"].max(), total.highest["radiance"].min()) == (0, 4)
    assert total.unmet_sums["draws"].tolist() == [10, 12]
    assert total.unmet_sums["darker"].tolist() == [3, 3]


def test_totals_of_fewer_reflections():
    """Of at most one: the parts of that channel take the names of all, and others are left out."""
    whole = totals([1.0, 3.0], points=1)
    means = {"bounce.0": 1.0, "bounce.1": 0.5, "bounce.2": 0.25, "target.bounce.0": 0.5}
    means |= {"target.bounce.1": 0.125, "target.bounce.2": 0.0625, "target": 0.7, "target.hit": 1.0}
    of_one = {"group.wall": 1.25, "target.group.wall": 0.4}
    means |= {"upto.1.group.wall": 1.25, "target.upto.1.group.wall": 0.4, "upto.0.group.wall": 9.0}
    means |= {"seen.roof": 9.0, "target.seen.roof": 9.0, "group.wall": 9.0}
    whole.sums = {name: np.full((1, 2), mean) for name, mean in means.items()}
    found = whole.up_to(1)
    left = {"bounce.0", "bounce.1", "target.bounce.0", "target.bounce.1", "target.hit", "target"}
    assert set(found.sums) == left | set(of_one)
    expected = {None: 1.5, "target": 0.625, "bounce.1": 0.5, **of_one}
    assert {name: found.mean(name)[0] for name in expected} == expected
    assert whole.mean()[0] == 2 and whole.mean("group.wall")[0] == 9


def test_whether_the_criterion_was_met():
    total = totals([[1.0, 2.0], [1.0, 2.0]])
    assert total.reached is None and total.reached_by_window.tolist() == [True, True]
    total.excess = np.array([1.0, 1.01])
    assert total.reached is False and total.reached_by_window.tolist() == [True, False]
    total.excess = np.array([1.0, 0.2])
    assert total.reached is True


def test_samples_that_are_left_out():
    """Up to 0.1 % of them."""
    check_valid(1000, 1_000_000, "scene")
    with pytest.raises(InputError, match="scene: 1001 of 1000000 samples are NaN or infinite"):
        check_valid(1001, 1_000_000, "scene")
    assert invalid_remark(0, 9) == []
    assert invalid_remark(2, 9) == ["2 of 9 samples were NaN or infinite and are ignored"]

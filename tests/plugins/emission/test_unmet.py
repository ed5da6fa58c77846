"""Which sources are drawn too rarely to be known, by hand."""

import numpy as np
import pytest

from mi_lcair.plugins.emission.draw_table import UnmetSources, parts_of_emitters


def test_rare_parts_are_in_the_bound_and_frequent_ones_are_not():
    """Three emitters: one hot facet among many, a lamp, and cold surroundings."""
    many = np.array([5.0, 100.0, 5.0, 5.0]), np.array([0.2, 0.001, 0.2, 0.2])
    lamp = np.array([40.0]), np.array([0.02])
    cold = np.array([1.0]), np.array([0.379])
    radiances, probabilities = zip(many, lamp, cold)
    unmet = UnmetSources(7.0, 2.0, *parts_of_emitters(list(radiances), list(probabilities)))
    # A part is rare below 3 draws: the hot facet up to 3000 draws of anything, the lamp up to 150
    draws = np.array([0.0, 100, 149, 151, 2900, 3100, 1e9])
    np.testing.assert_array_equal(unmet.rare(draws), [100, 100, 100, 100, 100, 2, 2])
    without = UnmetSources(
        7.0, 2.0, *parts_of_emitters(list(radiances[1:]), list(probabilities[1:]))
    )
    np.testing.assert_array_equal(without.rare(np.array([149.0, 151, 1e9])), [40, 2, 2])


@pytest.mark.parametrize("draws", [0.0, 1.0, 1e12])
def test_nothing_is_drawn(draws):
    unmet = UnmetSources(0.0, 7.0)
    assert unmet.rare(np.array([draws])) == [7.0]


def test_facets_of_equal_radiance_are_one_part():
    """A mesh of 1000 equal facets is drawn often, although each facet is drawn rarely."""
    probability, radiance = parts_of_emitters([np.full(1000, 9.0)], [np.full(1000, 1e-3)])
    unmet = UnmetSources(0.0, 0.0, probability, radiance)
    np.testing.assert_array_equal(unmet.rare(np.array([2.0, 4.0])), [9.0, 0.0])


def test_a_path_that_meets_a_source_by_chance_brings_a_typical_throughput():
    """By hand: 30 reflections of weight times throughput 0.1, 10 of 1; largest weight 2."""
    sums = dict.fromkeys(("potential", "potential_squares", "largest", "darker"), 0.0)
    sums |= {"draws": 30 * 0.1 + 10, "squares": 30 * 0.01 + 10}
    expected = 50 * (10.3 + 3 * 4) / (13 + 3 * 2)
    assert UnmetSources(7.0, 50.0).after_reflection(sums, 2.0) == pytest.approx(expected)


def test_hot_parts_are_met_where_their_chance_says():
    """By hand: chances add up to 4, with hits worth 0.5 each; others as without hot parts."""
    sums = dict.fromkeys(("potential", "potential_squares", "largest"), 0.0) | {"darker": 0.0}
    sums |= {"draws": 13.0, "squares": 10.3, "chances": 4.0, "chance_squares": 4 * 0.5}
    unmet = UnmetSources(7.0, 50.0, darker=2.0)
    assert unmet.after_reflection(sums, 2.0) == pytest.approx(50 * (2 + 3 * 4) / (4 + 3 * 2))
    bright = UnmetSources(7.0, 50.0, darker=45.0)
    expected = 45 * (10.3 + 3 * 4) / (13 + 3 * 2)
    assert bright.after_reflection(sums | {"chance_squares": 0.1}, 2.0) == pytest.approx(
        max(expected, 50 * 12.1 / 10)
    )


def test_drawn_sources_bring_a_typical_bound_or_the_largest_of_darker_ones():
    """By hand: 100 bounds of 20 and 2 of 80, where the brightest source has 100."""
    nothing = {"draws": 0.0, "squares": 0.0}
    sums = nothing | {"potential": 20 + 1.6, "potential_squares": 4 + 1.28, "largest": 80.0}
    unmet = UnmetSources(7.0, 0.0, brightest=100.0)
    expected = 100 * (5.28 + 3 * 0.64) / (21.6 + 3 * 0.8)
    assert unmet.after_reflection(sums | {"darker": 5.0}) == pytest.approx(expected)
    assert unmet.after_reflection(sums | {"darker": 60.0}) == pytest.approx(60)
    few = nothing | {"potential": 0.8, "potential_squares": 0.64, "largest": 80.0, "darker": 0.0}
    assert unmet.after_reflection(few) == pytest.approx(80)

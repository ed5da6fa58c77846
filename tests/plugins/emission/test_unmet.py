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
    unmet = UnmetSources(2.0, *parts_of_emitters(list(radiances), list(probabilities)))
    # A part is rare below 3 draws: the hot facet up to 3000 draws of anything, the lamp up to 150
    draws = np.array([0.0, 100, 149, 151, 2900, 3100, 1e9])
    np.testing.assert_array_equal(unmet.bound(draws), [100, 100, 100, 100, 100, 2, 2])
    without = UnmetSources(2.0, *parts_of_emitters(list(radiances[1:]), list(probabilities[1:])))
    np.testing.assert_array_equal(without.bound(np.array([149.0, 151, 1e9])), [40, 2, 2])


@pytest.mark.parametrize("draws", [0.0, 1.0, 1e12])
def test_nothing_is_drawn(draws):
    unmet = UnmetSources(7.0, np.empty(0), np.empty(0))
    assert unmet.bound(np.array([draws])) == [7.0]


def test_facets_of_equal_radiance_are_one_part():
    """A mesh of 1000 equal facets is drawn often, although each facet is drawn rarely."""
    probability, radiance = parts_of_emitters([np.full(1000, 9.0)], [np.full(1000, 1e-3)])
    unmet = UnmetSources(0.0, probability, radiance)
    np.testing.assert_array_equal(unmet.bound(np.array([2.0, 4.0])), [9.0, 0.0])

"""Emitter sampling is switched where it clearly pays."""

from dataclasses import replace

import pytest
from scipy.stats import f

from mi_lcair.planning.emitter_sampling import cheaper_emitter_sampling
from tests.planning.probes import FULL, Probes, probe


def switched(is_sampling, variance_ratio, other_mean=1.0, **changes):
    """Whether the other choice is taken; its variance is a fraction of the present one.

    Paths have 3 rays, and 2 x 2 more with emitter sampling.
    """
    settings = replace(FULL, emitter_sampling=is_sampling)
    other = probe(other_mean, 0.01 * variance_ratio**0.5, segments=3.0, **changes)
    probes = Probes(lambda asked: other)
    found = cheaper_emitter_sampling(probes, settings, probe(1.0, 0.01), 0.01)
    assert probes.asked == [replace(settings, emitter_sampling=not is_sampling)]
    assert probes.counts == [{"count_segments": True}]
    return found.emitter_sampling != is_sampling


@pytest.mark.parametrize(("is_sampling", "cost_ratio"), [(False, 7 / 3), (True, 3 / 7)])
def test_cost_times_variance(is_sampling, cost_ratio):
    """Below 0.8, with the 95 % quantile of the ratio of two variances of 64 values."""
    limit = 0.8 / (cost_ratio * f.ppf(0.95, 63, 63))
    assert switched(is_sampling, 0.99 * limit) and not switched(is_sampling, 1.01 * limit)


def test_radiance_that_paths_miss_needs_emitter_sampling():
    """A difference of more than 0.15 of the tolerance, or a source that may add 0.3 of it."""
    assert switched(True, 0.01, 0.9986) and not switched(True, 0.01, 0.9940)
    chance = 2**13 * 0.003
    assert switched(True, 0.01, chance=0.99 * chance)
    assert not switched(True, 0.01, chance=1.01 * chance)
    assert switched(False, 0.01, 0.5, chance=chance)  # to sample emitters misses nothing

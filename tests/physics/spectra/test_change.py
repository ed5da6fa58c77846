"""Changes of a spectrum: what they add, and the range in which nothing is clipped."""

import numpy as np
import pytest

from mi_lcair.physics.spectra.change import CHANGES, NODES, Change

X, MOST = np.linspace(3, 5, 61), 0.95


@pytest.fixture(params=range(3))
def random(request):
    return np.random.default_rng(request.param)


def test_what_is_added(random):
    """The offset and the slope about the middle; the nodes hold what they say."""
    absorbed, nodes = random.uniform(0.3, 0.7, (len(X), 2)), random.normal(0, 0.02, NODES)
    scale, offset, slope = 1.1, 0.03, -0.02
    change = Change((3, 5), scale, offset, slope, tuple(nodes))
    added = change.of(X, absorbed, 1.0) - scale * absorbed
    assert np.ptp(added, axis=1) == pytest.approx(0)
    at_nodes = np.interp(change.nodes_um, X, added[:, 0])
    line = offset + slope * (change.nodes_um - 4)
    # A node lies between two of the wavelengths, where the spline is not straight
    assert at_nodes - line == pytest.approx(nodes, abs=1e-3)
    assert np.array_equal(change.of(X, 9 + absorbed, MOST), np.full_like(absorbed, MOST))
    assert Change((3, 5)).of(X, absorbed, 1.0) is absorbed


@pytest.mark.parametrize("name", [*CHANGES, "2"])
def test_clipping_begins_at_the_bounds(random, name):
    absorbed = random.uniform(0.3, 0.7, (len(X), 4))
    nodes = tuple(random.normal(0, 0.01, NODES))
    change = Change((3, 5), 1.05, 0.02, 0.01, nodes)
    low, high = change.bounds(name, X, absorbed, MOST)
    assert low < high
    for end in (low, high):
        values = change.replaced(name, end).unclipped(X, absorbed)
        assert values.min() > -1e-9 and values.max() < MOST + 1e-9
        assert min(abs(values).min(), abs(values - MOST).min()) < 1e-9

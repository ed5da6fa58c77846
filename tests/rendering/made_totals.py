"""Sums and totals from given means, without a scene."""

from types import SimpleNamespace

import numpy as np

from mi_lcair.rendering.statistics import Totals


def launch_of(windows: int, randomisations: int, points: int):
    return SimpleNamespace(
        window_numbers=np.arange(windows),
        randomisations=randomisations,
        points=points,
        paths=windows * randomisations * points,
    )


def sums_of(radiance, points, lowest=0.0, highest=0.0, chance=0.0, channels=None):
    """Sums of a launch with these mean radiances, (windows, randomisations)."""
    windows = len(radiance)
    return SimpleNamespace(
        valid=np.full(radiance.shape, float(points)),
        radiance=points * radiance,
        channels={} if channels is None else channels,
        lowest={"radiance": np.full(windows, lowest)},
        highest={"radiance": np.full(windows, highest)},
        unmet={"darker": np.full(windows, chance)},
        tail=None,
    )


def totals(radiance, points=64, unmet=None, **bounds):
    """Totals of one window, or of several, with these mean radiances of its randomisations.

    bounds: further arguments of `sums_of`.
    """
    radiance = np.atleast_2d(np.asarray(radiance, dtype=float))
    total = Totals(*radiance.shape, by_randomisation=True, unmet=unmet)
    total.add(launch_of(*radiance.shape, points), sums_of(radiance, points, **bounds))
    return total

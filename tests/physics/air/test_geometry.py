"""Straight lines over a round Earth, against points in the plane of line and Earth's centre."""

import numpy as np
import pytest

from mi_lcair.physics.air.geometry import (
    EFFECTIVE_RADIUS_M,
    height_along,
    length_between,
    lower_end,
)

LINES = [(50.0, 1.0, 20e3), (700.0, 8.0, 4000.0), (50.0, 90.0, 2e4), (3000.0, 0.2, 9e4)]


def point(height, elevation_deg, length):
    """Point at a length along a line from (0, radius + height)."""
    angle = np.radians(elevation_deg)
    return np.array([length * np.cos(angle), EFFECTIVE_RADIUS_M + height + length * np.sin(angle)])


def test_the_radius_is_that_of_the_headers_heights():
    assert pytest.approx(1.19 * 6371e3) == EFFECTIVE_RADIUS_M
    for elevation, length, height in ((1, 20e3, 425.3), (10, 5e3, 919.8), (90, 2e4, 20050)):
        assert height_along(50.0, elevation, length) == pytest.approx(height, abs=0.5)


@pytest.mark.parametrize("height, elevation, length", LINES)
def test_heights_along_a_line(height, elevation, length):
    top = np.hypot(*point(height, elevation, length)) - EFFECTIVE_RADIUS_M
    assert height_along(height, elevation, length) == pytest.approx(top, abs=1e-6)
    assert lower_end(top, elevation, length) == pytest.approx(height, abs=1e-6)
    assert length_between(height, top, elevation) == pytest.approx(length, abs=1e-4)


@pytest.mark.parametrize("height, elevation", [(700.0, 8.0), (5000.0, 3.0), (300.0, 90.0)])
def test_a_line_extended_down(height, elevation):
    length = length_between(height, 50.0, -elevation)
    end = np.hypot(*point(height, -elevation, length)) - EFFECTIVE_RADIUS_M
    assert end == pytest.approx(50.0, abs=1e-5)


def test_a_line_that_misses_a_height():
    """A line from 5 km that rises by 0.5 degrees comes down to 4711 m and no further."""
    lowest = (EFFECTIVE_RADIUS_M + 5000) * np.cos(np.radians(0.5)) - EFFECTIVE_RADIUS_M
    assert lowest == pytest.approx(4711, abs=1)
    assert length_between(5000.0, lowest - 0.01, -0.5) == 0.0
    # Downward, the first of the two points at the height counts
    down = length_between(5000.0, 4800.0, -0.5)
    assert 0 < down < (EFFECTIVE_RADIUS_M + 5000) * np.sin(np.radians(0.5))
    assert np.hypot(*point(5000.0, -0.5, down)) - EFFECTIVE_RADIUS_M == pytest.approx(4800)

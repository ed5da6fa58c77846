"""Heights and lengths along a straight line of sight over a round Earth.

The Earth has an effective radius, so that a straight line over it is as high as a refracted ray
over the Earth: 1.19 times the true radius gives the target heights of LOWTRAN7's slant paths within
0.8 m.
"""

import numpy as np

EFFECTIVE_RADIUS_M = 1.19 * 6.371e6


def height_along(lower_m, elevation_deg, length_m):
    """Height [m] at `length_m` [m] along a line that starts at the height `lower_m` [m].

    `elevation_deg` is the line's elevation at its start [degrees].
    """
    radius = EFFECTIVE_RADIUS_M + lower_m
    # The difference of two large numbers would lose digits: (b^2 - a^2) / (b + a) is b - a.
    gained = length_m * (length_m + 2 * radius * np.sin(np.radians(elevation_deg)))
    return lower_m + gained / (np.sqrt(radius**2 + gained) + radius)


def lower_end(upper_m: float, elevation_deg: float, length_m: float) -> float:
    """Height [m] of the lower end of a line whose upper end is at the height `upper_m` [m].

    `elevation_deg` is the line's elevation at its lower end [degrees].
    """
    sine, cosine = np.sin(np.radians(elevation_deg)), np.cos(np.radians(elevation_deg))
    upper = EFFECTIVE_RADIUS_M + upper_m
    return float(np.sqrt(upper**2 - (length_m * cosine) ** 2) - length_m * sine) - (
        EFFECTIVE_RADIUS_M
    )


def length_between(start_m: float, end_m: float, elevation_deg: float) -> float:
    """Length [m] of a line from one height [m] to the other, where it first reaches that height.

    `elevation_deg` is its elevation at the start [degrees]; 0 is returned if it misses the end's
    height.
    """
    start, end = EFFECTIVE_RADIUS_M + start_m, EFFECTIVE_RADIUS_M + end_m
    along = start * np.sin(np.radians(elevation_deg))
    square = along**2 + (end_m - start_m) * (start + end)
    if square < 0:
        return 0.0
    return float(-along + np.copysign(np.sqrt(square), elevation_deg))

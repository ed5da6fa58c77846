"""Surroundings of a model: the IR range (thesis 3.4.1) and the world sphere (3.4.2).

Both are closed and their facets face inward.
"""

import numpy as np

from mi_lcair.scenes.build.bodies import Facet, patch

RANGE_SIDE = 3.0  # m
# The thesis has 160 facets. 8 rows is the only even number with which four walls, and a floor and a
# ceiling whose facets match theirs, have that many.
RANGE_COLUMNS, RANGE_ROWS = 4, 8
UPPER_KELVIN, LOWER_KELVIN = 263, 253  # K, temperatures of the upper and lower half

WORLD_RADIUS = 10e3  # m, assumed; large compared with the model and its distance
RINGS, AZIMUTHS = 10, 20  # numbers of facets of the sky in elevation and azimuth, thesis 3.4.2.2
TERRAIN_KELVIN = 302.5  # K, thesis 3.4.2.1
SKY_KELVIN = 288  # K, temperature of the sky if no sky table is given, assumed


def ir_range() -> list[Facet]:
    """Return the IR range, a cube of 160 facets.

    Walls have 8 rows x 4 columns, floor and ceiling 4 x 4. The upper half is at 263 K, the lower at
    253 K.
    """
    upper = f"s*ir_range_wall*{UPPER_KELVIN}*group=walls"
    lower = f"t*ir_range_wall*{LOWER_KELVIN}*group=walls"
    half = RANGE_SIDE / 2
    across = np.linspace(-half, half, RANGE_COLUMNS + 1)
    up = np.linspace(-half, half, RANGE_ROWS + 1)
    # The first wall is at x = half. The others are quarter turns of it about z.
    wall = np.stack(np.broadcast_arrays(half, across[::-1], up[:, None]), axis=-1)
    walls = []
    for _ in range(4):
        walls.append(wall)
        wall = wall[..., [1, 0, 2]] * (-1, 1, 1)
    floor = np.stack(np.broadcast_arrays(across, across[:, None], -half), axis=-1)
    middle = RANGE_ROWS // 2
    facets = [facet for wall in walls for facet in patch(wall[middle:], upper)]
    facets += patch(floor[::-1] * (1, 1, -1), upper)
    facets += [facet for wall in walls for facet in patch(wall[: middle + 1], lower)]
    return facets + patch(floor, lower)


def world_sphere() -> list[Facet]:
    """Return the world sphere: the sky above the horizon and the terrain below.

    The sky has 10 rings of 9 degrees with 20 facets each. Each facet is labelled with the elevation
    of the middle of its ring. The terrain has the same rings below the horizon.
    """
    azimuth = -2 * np.pi * (np.arange(AZIMUTHS + 1) % AZIMUTHS) / AZIMUTHS
    elevation = np.linspace(-np.pi / 2, np.pi / 2, 2 * RINGS + 1)[:, None]
    grid = WORLD_RADIUS * np.stack(
        np.broadcast_arrays(
            np.cos(elevation) * np.cos(azimuth),
            np.cos(elevation) * np.sin(azimuth),
            np.sin(elevation),
        ),
        axis=-1,
    )
    facets = []
    for row in range(RINGS):
        middle = 90 / RINGS * (row + 0.5)
        facets += patch(
            grid[RINGS + row : RINGS + row + 2],
            f"s*blackbody*{SKY_KELVIN}*elevation_deg={middle:g}",
        )
    return facets + patch(grid[: RINGS + 1], f"t*blackbody*{TERRAIN_KELVIN}*group=terrain")

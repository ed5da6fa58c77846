"""What surrounds a model: the IR range (thesis 3.4.1) and the world sphere (3.4.2), closed, facing
inward.
"""

import numpy as np

from mi_lcair.scenes.build.bodies import Facet, patch

RANGE_SIDE = 3.0  # m
RANGE_COLUMNS, RANGE_ROWS = (
    4,
    8,
)  # the only even number of rows for which 4 walls, floor and ceiling that match have 160
UPPER_KELVIN, LOWER_KELVIN = 263, 253

WORLD_RADIUS = 10e3  # m; large against model and ranges, assumed
RINGS, AZIMUTHS = 10, 20  # of the upper half, 3.4.2.2; the lower half mirrors them
TERRAIN_KELVIN = 302.5  # 3.4.2.1
SKY_KELVIN = 288  # stand-in where no sky table is given, assumed


def ir_range() -> list[Facet]:
    """The cube of 160 facets: walls of 8 rows x 4 columns, floor and ceiling of 4 x 4, upper half
    263 K, lower 253 K.
    """
    upper = f"s*ir_range_wall*{UPPER_KELVIN}*group=walls"
    lower = f"t*ir_range_wall*{LOWER_KELVIN}*group=walls"
    half = RANGE_SIDE / 2
    across = np.linspace(-half, half, RANGE_COLUMNS + 1)
    up = np.linspace(-half, half, RANGE_ROWS + 1)
    # One wall at x = half, along +y as seen from inside; the others are its quarter turns about z.
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
    """The sky's 10 rings of 9 degrees x 20 facets, each labelled with the elevation of its middle,
    and the terrain below.
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

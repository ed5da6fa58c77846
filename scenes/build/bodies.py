"""Closed bodies of plane facets, built from grids of points.

Lengths are in m. The corners of a facet run anticlockwise as seen from outside. Neighbours share
their corners, so that a body has no gaps.
"""

from typing import NamedTuple

import numpy as np

SAME_POINT = 1e-7  # m, distance below which two corners count as one
PLANE = 1e-7  # m, deviation from a plane above which a quadrilateral is cut into two triangles


class Facet(NamedTuple):
    """A plane facet: its label, and its corners (3 or 4, 3) in m.

    The corners run anticlockwise as seen from outside.
    """

    label: str
    corners: np.ndarray


def patch(grid, label) -> list[Facet]:
    """Return the facets between the points of a grid (rows, columns, 3), row by row.

    The normal of a facet is the cross product of the direction along a row and the direction to the
    next row. It points outward. Where two corners coincide, the facet is a triangle or is left out.
    A quadrilateral that is not plane becomes two triangles.
    """
    grid = np.asarray(grid, float)
    facets = []
    for lower, upper in zip(grid, grid[1:]):
        for column in range(len(lower) - 1):
            corners = np.array([lower[column], lower[column + 1], upper[column + 1], upper[column]])
            corners = corners[
                np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1) > SAME_POINT
            ]
            if len(corners) == 4 and _off_plane(corners) > PLANE:
                facets += [Facet(label, corners[[0, 1, 2]]), Facet(label, corners[[0, 2, 3]])]
            elif len(corners) >= 3:
                facets.append(Facet(label, corners))
    return facets


def loft(sections, label) -> list[Facet]:
    """Return the closed body through `sections` (n, points, 3).

    It has a skin, and a flat cap on each end that is not a point. Each section is a plane closed
    curve: its last point is its first. It runs right-handed about the direction from the first
    section to the last. It has as many points in its first half as in its second, because a cap
    joins them in pairs. Similar and parallel sections give plane quadrilaterals.
    """
    sections = np.asarray(sections, float)
    return cap(sections[0], label) + patch(sections, label) + cap(sections[-1][::-1], label)


def cap(section, label) -> list[Facet]:
    """Return the plane facets inside a closed section (points, 3).

    The section runs clockwise as seen from outside.
    """
    half = len(section) // 2
    return patch([section[half:][::-1], section[: half + 1]], label)


def ring(x, radius, columns, centre=(0, 0), aspect=1, turn=0.0):
    """Return an ellipse in the plane x as a closed section (columns + 1, 3), right-handed about +x.

    Parameters
    ----------
    x
        Position of the plane [m].
    radius
        Half the height of the ellipse [m].
    columns
        Number of intervals along the ellipse.
    centre
        y and z of the centre [m].
    aspect
        Width divided by height.
    turn
        Angle of the first point from +y, in intervals.
    """
    angle = 2 * np.pi * (np.arange(columns + 1) % columns + turn) / columns
    y, z = aspect * radius * np.cos(angle) + centre[0], radius * np.sin(angle) + centre[1]
    return np.stack([np.full_like(y, x), y, z], axis=1)


def revolve(profile, columns, centre=(0, 0), turn=0.0):
    """Return a grid of rings (n, columns + 1, 3) about an axis along x at `centre` (y, z).

    profile: x and radius of the rings, (n, 2) in m. If it runs toward +x, the facets of the grid
    face away from the axis.
    """
    return np.stack([ring(x, radius, columns, centre, turn=turn) for x, radius in profile])


def mirrored(facets) -> list[Facet]:
    """Return the mirror images of the facets in the plane y = 0, with the same labels.

    Their corners are reversed, so that they face outward.
    """
    return [Facet(label, corners[::-1] * (1, -1, 1)) for label, corners in facets]


def _off_plane(corners):
    """Return the distance between the diagonals of a quadrilateral [m]."""
    normal = np.cross(corners[2] - corners[0], corners[3] - corners[1])
    return abs(np.dot(corners[1] - corners[0], normal)) / np.linalg.norm(normal)

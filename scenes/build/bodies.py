"""Closed bodies of plane facets, from grids of points. Lengths in metres.

A facet's corners run anticlockwise as seen from outside. Neighbours share their corners, so that a
body has no gaps.
"""

from typing import NamedTuple

import numpy as np

SAME_POINT = 1e-7  # m; corners that are closer are one
PLANE = 1e-7  # m; a quadrilateral that is farther from plane is cut in two


class Facet(NamedTuple):
    """A plane facet: its label and its corners (3 or 4, 3) in m, anticlockwise as seen from
    outside.
    """

    label: str
    corners: np.ndarray


def patch(grid, label) -> list[Facet]:
    """Facets between the points of a grid (rows, columns, 3), row by row; outside is (along a row)
    x (up the rows).

    Where corners coincide a facet is a triangle, or left out. A quadrilateral that is not plane
    becomes two triangles.
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
    """The closed body through `sections` (n, points, 3): its skin, and a flat cap on each end that
    is not a point.

    Each section is plane, ends where it began, runs right-handed about the way from the first to
    the last, and has as many points on the way out as on the way back: caps join them pairwise.
    Sections that are similar and parallel give plane quadrilaterals.
    """
    sections = np.asarray(sections, float)
    return cap(sections[0], label) + patch(sections, label) + cap(sections[-1][::-1], label)


def cap(section, label) -> list[Facet]:
    """The plane facets inside a closed section (points, 3), which runs clockwise as seen from
    outside.
    """
    half = len(section) // 2
    return patch([section[half:][::-1], section[: half + 1]], label)


def ring(x, radius, columns, centre=(0, 0), aspect=1, turn=0.0):
    """A closed section (columns + 1, 3) of an ellipse in the plane x, right-handed about +x.

    `radius` is half its height (m), `aspect` its width in heights, `centre` (y, z). The first
    point, which is the last again, lies `turn` columns beyond +y.
    """
    angle = 2 * np.pi * (np.arange(columns + 1) % columns + turn) / columns
    y, z = aspect * radius * np.cos(angle) + centre[0], radius * np.sin(angle) + centre[1]
    return np.stack([np.full_like(y, x), y, z], axis=1)


def revolve(profile, columns, centre=(0, 0), turn=0.0):
    """Grid of rings (n, columns + 1, 3) about an axis along x at `centre` (y, z), from `profile`
    (n, 2) of x and radius.

    Outside is outward where the profile runs toward +x.
    """
    return np.stack([ring(x, radius, columns, centre, turn=turn) for x, radius in profile])


def mirrored(facets) -> list[Facet]:
    """The facets on the other side of the plane y = 0, facing outward again; labels as they are."""
    return [Facet(label, corners[::-1] * (1, -1, 1)) for label, corners in facets]


def _off_plane(corners):
    """How far (m) the diagonals of a quadrilateral pass each other by."""
    normal = np.cross(corners[2] - corners[0], corners[3] - corners[1])
    return abs(np.dot(corners[1] - corners[0], normal)) / np.linalg.norm(normal)

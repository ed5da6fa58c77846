"""Walls of cavities as triangles."""

from dataclasses import dataclass

import numpy as np

from mi_lcair.cavities.shape import Shape

SIDES = 720  # sides of the polygon that stands for a circle
ARC_RINGS = 360  # rings of a sphere
PROFILE_RINGS = 120  # rings of each straight part of a wall whose temperature changes with depth


@dataclass(frozen=True)
class Wall:
    """Triangles of a wall with normals to the inside, and of the aperture, at z = 0 [m].

    corners: (n, 3). wall, aperture: corners of the triangles, (t, 3).
    """

    corners: np.ndarray
    wall: np.ndarray
    aperture: np.ndarray

    def depths(self) -> np.ndarray:
        """Depths of the centres of the wall's triangles [m], (t,)."""
        return self.corners[self.wall, 2].mean(axis=1)

    @staticmethod
    def of_shape(shape: Shape, rings: int) -> "Wall":
        """A shape, with a number of rings for each straight part of the wall.

        A polygon of the area of the circle stands for each circle.
        """
        r, z = shape.nodes(ARC_RINGS if shape.kind == "sphere" else rings)
        angle = 2 * np.pi * np.arange(SIDES) / SIDES
        r = np.insert(r, 0, 0.0) * np.sqrt(angle[1] / np.sin(angle[1]))
        z = np.insert(z, 0, 0.0)
        circle = np.array([np.cos(angle), np.sin(angle)])
        corners = np.concatenate(
            [np.vstack([a * circle, np.full(SIDES, b)]).T for a, b in zip(r, z)]
        )
        k = np.arange(SIDES)
        after = (k + 1) % SIDES
        rows = []
        for first in SIDES * np.arange(len(r) - 1):
            a, b, c, d = first + k, first + after, first + SIDES + k, first + SIDES + after
            upper, lower = np.stack([a, d, b], 1), np.stack([a, c, d], 1)
            rows.append(np.concatenate([upper, lower]))
        # Triangles at the axis have no area on one side
        faces = [rows[0][SIDES:], *rows[1:-1], rows[-1][:SIDES]]
        return Wall(corners, np.concatenate(faces[1:]), faces[0])

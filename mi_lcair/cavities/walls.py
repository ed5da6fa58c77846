"""Walls of cavities as triangles: of a shape, and of a user's own mesh with one hole."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import mitsuba as mi
import numpy as np

from mi_lcair.cavities.shape import Shape
from mi_lcair.errors import InputError, mitsuba_error
from mi_lcair.files import check_file, check_suffix
from mi_lcair.plugins.emission.triangles import loops, triangle_vertices, vertex_positions

SIDES = 720  # sides of the polygon in place of a circle
ARC_RINGS = 360  # rings of a sphere
PROFILE_RINGS = 120  # rings of each straight part of a wall whose temperature changes with depth
SAME = 1e-6  # corners this close are one, as a share of the mesh's size
FLAT = 1e-3  # largest distance of the aperture's edge from its plane, as a share of its size


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

        Each circle becomes a polygon of the same area.
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


@dataclass(frozen=True)
class OwnMesh:
    """A mesh, with its aperture at z = 0 and its inside at z > 0 [m].

    aperture: radius of the largest circle about the aperture's centre that it holds [m].
    aperture_area, wall_area: areas of the hole and of the wall [m^2].
    """

    triangles: Wall
    aperture: float
    aperture_area: float
    wall_area: float
    kind: str = "mesh"

    @property
    def depth(self) -> float:
        """Distance of the deepest point from the aperture's plane [m]."""
        return float(self.triangles.corners[:, 2].max())

    @staticmethod
    def read(table: Mapping, folder: Path) -> "OwnMesh":
        """The mesh of a table [shape] with the key `mesh`, a PLY or OBJ file in metres.

        Raises InputError for a mesh that is no wall with one flat hole.
        """
        if set(table) != {"mesh"} or not isinstance(table["mesh"], str):
            raise InputError('[shape] with a mesh has this key alone: mesh = "FILE.ply" or .obj')
        path = folder / table["mesh"]
        kind = check_suffix(path, (".ply", ".obj"), "mesh")[1:]
        check_file(path)
        if not path.is_file():
            raise InputError(f"mesh {path}: there is no such file")
        try:
            mesh = mi.load_dict({"type": kind, "filename": str(path)}, parallel=False)
        except (RuntimeError, UnicodeDecodeError) as error:
            if isinstance(error, RuntimeError) and str(error):
                raise mitsuba_error(error) from None
            # Mitsuba's message quotes the file; what is no text is lost, or cannot be decoded
            raise InputError(f"mesh {path}: is no {kind.upper()} file") from None
        corners = vertex_positions(mesh).astype(float)
        return of_triangles(corners, triangle_vertices(mesh), path.name)


def of_triangles(corners: np.ndarray, faces: np.ndarray, name: str) -> OwnMesh:
    """The cavity of a mesh; raises InputError, with the `name`, unless it has one flat hole."""
    size = np.ptp(corners, axis=0).max()
    _, first, number = np.unique(
        np.round(corners / (SAME * size)), axis=0, return_index=True, return_inverse=True
    )
    corners, faces = corners[first], number.ravel()[faces].astype(int)
    faces = faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]
    edges = np.concatenate([faces[:, [k, (k + 1) % 3]] for k in range(3)])
    pairs, counts = np.unique(np.sort(edges, axis=1), axis=0, return_counts=True)
    if counts.max() > 2:
        raise InputError(f"{name}: more than two triangles share an edge; a wall is one surface")
    free = pairs[counts == 1]
    if not len(free):
        raise InputError(f"{name}: is closed; a cavity has one hole, its aperture")
    loop, *_ = loops(free)
    if len(np.unique(loop)) < len(free):
        raise InputError(
            f"{name}: has holes that are not the aperture: an edge of {len(loop)} corners, and "
            f"{len(free) - len(loop)} more free edges; close all but one"
        )
    edge = corners[loop]
    centre = edge.mean(axis=0)
    spoke, after = edge - centre, np.roll(edge, -1, axis=0) - centre
    normal = np.cross(spoke, after).sum(axis=0) / 2
    area = float(np.linalg.norm(normal))
    z = normal / area
    if np.dot(corners.mean(axis=0) - centre, z) < 0:
        z = -z
    if abs(spoke @ z).max() > FLAT * np.sqrt(area):
        raise InputError(f"{name}: the edge of its hole does not lie in a plane")
    x = np.linalg.svd(z[None])[2][1]
    corners = (corners - centre) @ np.array([x, np.cross(z, x), z]).T
    if corners[:, 2].max() < FLAT * np.sqrt(area):
        raise InputError(f"{name}: lies in the plane of its hole; a cavity has a depth")
    if corners[:, 2].min() < -FLAT * np.sqrt(area):
        raise InputError(f"{name}: reaches in front of its aperture; the inside is behind it")
    a, b, c = (corners[faces[:, k]] for k in range(3))
    # The cone from the centre of the aperture to a triangle has a negative volume if its normal
    # points to the inside
    if np.einsum("ij,ij", a, np.cross(b, c)) > 0:
        faces = faces[:, ::-1]
    wall_area = float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)
    start, end = corners[loop][:, :2], np.roll(corners[loop][:, :2], -1, axis=0)
    side = np.linalg.norm(end - start, axis=1)
    away = abs(start[:, 0] * end[:, 1] - start[:, 1] * end[:, 0]) / side
    count = len(corners)
    fan = np.stack([np.full(len(loop), count), loop, np.roll(loop, -1)], axis=1)
    if np.sum(start[:, 0] * end[:, 1] - start[:, 1] * end[:, 0]) < 0:
        fan = fan[:, ::-1]
    wall = Wall(np.vstack([corners, np.zeros(3)]), faces, fan)
    return OwnMesh(wall, float(away.min()), area, wall_area)

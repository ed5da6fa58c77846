"""Shapes of cavities: bodies of revolution about the z axis, with a circular aperture at z = 0.

z is the depth below the plane of the aperture. All shapes are convex.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from math import pi, radians, sqrt, tan
from pathlib import Path
from typing import Literal

import mitsuba as mi
import numpy as np

from mi_lcair.declared import Described, Rule, entry, given, listed, rule
from mi_lcair.errors import InputError, mitsuba_error
from mi_lcair.files import check_file, check_suffix
from mi_lcair.plugins.emission.triangles import loops, triangle_vertices, vertex_positions

# What each kind takes beside radius_m and aperture_radius_m; a cone takes one of the two
TAKEN = {
    "cylinder": ("length_m",),
    "cone": ("length_m", "angle_deg"),
    "cylinder_cone": ("length_m", "angle_deg"),
    "sphere": (),
}


def of_its_kind(shape: "Shape") -> str | None:
    taken, stated = TAKEN[shape.kind], given(shape, ("length_m", "angle_deg"))
    if shape.kind == "cone":
        return None if len(stated) == 1 else "a cone needs one of length_m and angle_deg"
    needed = listed(taken) if taken else "neither length_m nor angle_deg"
    return None if stated == [*taken] else (f"a {shape.kind} needs {needed} and radius_m")


RULES = (
    Rule(of_its_kind),
    rule(
        lambda t: t.kind != "cylinder_cone" or t.cone_length < t.length_m,
        "length_m = {t.length_m:g}; must exceed the cone's {t.cone_length:g} m, which radius_m and "
        "angle_deg give",
    ),
    rule(
        lambda t: t.kind != "sphere" or t.aperture < t.radius_m,
        "a sphere needs an aperture_radius_m below its radius_m",
    ),
    rule(
        lambda t: t.aperture <= t.radius_m,
        "aperture_radius_m = {t.aperture:g}; must be at most radius_m = {t.radius_m:g}",
    ),
)


@dataclass(frozen=True, kw_only=True)
class Shape(Described, where="[shape]", rules=RULES):
    """Shape of a cavity. Raises InputError for numbers that make none.

    Attributes
    ----------
    kind : str
        "cylinder", "cone", "cylinder_cone" or "sphere".
    radius_m : float
        Radius of the cylinder, of the cone's base, or of the sphere [m].
    length_m : float or None
        Depth of the whole cavity [m], except of a sphere.
    angle_deg : float or None
        Full apex angle of the cone [deg]. A cone has a length or an angle.
    aperture_radius_m : float or None
        Radius of the aperture [m]. If it is smaller than the radius, a flat lid with the wall's
        properties surrounds it. None: the whole end is open.
    """

    kind: Literal["cylinder", "cone", "cylinder_cone", "sphere"]
    radius_m: float = entry(is_positive=True, unit="m")
    length_m: float | None = entry(None, is_positive=True, unit="m")
    angle_deg: float | None = entry(None, lower=1, upper=179, unit="degrees")
    aperture_radius_m: float | None = entry(None, is_positive=True, unit="m")

    @property
    def aperture(self) -> float:
        """Radius of the aperture [m]."""
        return self.radius_m if self.aperture_radius_m is None else self.aperture_radius_m

    @property
    def cone_length(self) -> float:
        """Length of the cone [m]."""
        if self.angle_deg is None:
            return self.length_m
        return self.radius_m / tan(radians(self.angle_deg) / 2)

    @property
    def depth(self) -> float:
        """Distance of the deepest point from the aperture's plane [m]."""
        if self.kind == "sphere":
            return self.radius_m + sqrt(self.radius_m**2 - self.aperture**2)
        return self.cone_length if self.kind == "cone" else self.length_m

    def corners(self) -> list[tuple[float, float]]:
        """Radius and depth of the corners [m], from the aperture's edge to the axis."""
        R, L = self.radius_m, self.depth
        edge = [(self.aperture, 0.0)] if self.aperture < R else []
        if self.kind == "cylinder":
            return [*edge, (R, 0.0), (R, L), (0.0, L)]
        if self.kind == "cone":
            return [*edge, (R, 0.0), (0.0, L)]
        return [*edge, (R, 0.0), (R, L - self.cone_length), (0.0, L)]

    @property
    def parts(self) -> int:
        """Number of straight parts of the wall; 1 for a sphere."""
        return 1 if self.kind == "sphere" else len(self.corners()) - 1

    def nodes(self, count: int) -> np.ndarray:
        """Radii and depths [m] of circles that divide the wall into rings, (2, n).

        They go from the aperture's edge to the axis. Each straight part of the wall has `count`
        rings, which are narrow at its ends, where the radiance changes fastest.
        """
        steps = (1 - np.cos(pi * np.arange(count + 1) / count)) / 2
        if self.kind == "sphere":
            first = np.arcsin(self.aperture / self.radius_m)
            angles = first + (pi - first) * steps
            # The depth of the centre is that of the last node less the radius
            r, z = self.radius_m * np.sin(angles), self.depth - self.radius_m * (1 + np.cos(angles))
        else:
            r, z = (
                np.concatenate([[values[0]], *(a + (b - a) * steps[1:] for a, b in pairs)])
                for values in zip(*self.corners())
                for pairs in [list(zip(values, values[1:]))]
            )
        z[0], r[-1] = 0.0, 0.0
        return np.array([r, z])

    def areas(self, nodes: np.ndarray) -> np.ndarray:
        """Areas of the rings between nodes [m^2], those of the curved wall itself."""
        r, z = nodes
        if self.kind == "sphere":
            return 2 * pi * self.radius_m * np.diff(z)
        return pi * (r[1:] + r[:-1]) * np.hypot(np.diff(r), np.diff(z))

    @property
    def wall_area(self) -> float:
        """Area of the wall [m^2]."""
        return float(self.areas(self.nodes(1)).sum())


# Walls of cavities as triangles: of a shape, and of a user's own mesh with one hole
# ----------------------------------------------------------------------------------

SIDES = 720  # sides of the polygon in place of a circle
ARC_RINGS = 360  # rings of a sphere
PROFILE_RINGS = 120  # rings of each straight part of a wall whose temperature changes with depth
SAME = 1e-6  # corners this close are one, as a share of the mesh's size
FLAT = 1e-3  # largest distance of the aperture's edge from its plane, as a share of its size


@dataclass(frozen=True)
class CavityWall:
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
    def of_shape(shape: Shape, rings: int) -> "CavityWall":
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
        return CavityWall(corners, np.concatenate(faces[1:]), faces[0])


@dataclass(frozen=True)
class OwnMesh:
    """A mesh, with its aperture at z = 0 and its inside at z > 0 [m].

    aperture: radius of the largest circle about the aperture's centre that it holds [m].
    aperture_area, wall_area: areas of the hole and of the wall [m^2].
    """

    triangles: CavityWall
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
            raise InputError('[shape] with a mesh has only this key: mesh = "FILE.ply" or .obj')
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
    wall = CavityWall(np.vstack([corners, np.zeros(3)]), faces, fan)
    return OwnMesh(wall, float(away.min()), area, wall_area)

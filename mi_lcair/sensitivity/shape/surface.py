"""The surface of a model whose vertices move one by one, and what a sensor sees of it."""

from functools import cached_property

import mitsuba as mi
import numpy as np

from mi_lcair.errors import InputError, check_known
from mi_lcair.models3d.coincident import weld
from mi_lcair.motions.motion import groups_of_meshes
from mi_lcair.plugins.emission.triangles import triangle_vertices, vertex_positions
from mi_lcair.rendering.facets.starts import facings, meshes_of_model, projected
from mi_lcair.rendering.window import window_size

EDGE_ON = 1e-6  # cosine of a triangle below which it is seen from neither side
NEARER = 0.1  # least part of its triangles' heights that counts, however near other surfaces are
LEAST_HEIGHTS = 3.0  # largest reach in the least height of a vertex's triangles
THINNEST = 1e-3  # least reach in their mean height, however thin one of them is
BESIDE = 1e-3  # distance from a vertex, in these heights, at which other surfaces are looked for


class Surface:
    """The triangles of a model, and those of its vertices that move: the vertices of a group.

    Vertices at the same position move together, also those of other groups, so that no crack opens.
    Raises InputError for an unknown group, or if a part of the model is no mesh or has a
    triangle without area.

    scene: Scene. meshes: those of the model. vertices: of all meshes (V, 3) [m], Float64. ends:
    numbers of vertices at which the next mesh begins. triangles: their vertices (T, 3). moving:
    number of each vertex among those that move, -1 for one that does not, (V,). positions: those of
    the moving vertices, (n, 3) [m]. corners: as `moving`, for the corners of the triangles, (T, 3).
    in_group: whether a triangle is one of the group (T,). facing, sides: see `facings`.
    """

    def __init__(self, scene, group: str):
        self.scene, self.meshes = scene, meshes_of_model(scene)
        groups = groups_of_meshes(scene)
        check_known(f"group of meshes of {scene.name}", groups, group)
        if self.meshes is None:
            raise InputError(f"{scene.name}: a part of the model is no mesh, and has no vertices")
        vertices = [vertex_positions(mesh).astype(float) for mesh in self.meshes]
        faces = [triangle_vertices(mesh).astype(np.int64) for mesh in self.meshes]
        ends = np.cumsum(list(map(len, vertices)))
        self.ends = ends[:-1]
        self.vertices = np.concatenate(vertices)
        firsts = np.append(0, self.ends)
        self.triangles = np.concatenate([f + first for f, first in zip(faces, firsts)])
        of_group = [mesh in groups[group] for mesh in self.meshes]
        self.in_group = np.repeat(of_group, list(map(len, faces)))
        welded, moving = weld(self.vertices), np.full(ends[-1], -1)
        places = np.unique(welded[self.triangles[self.in_group]])
        moving[places] = np.arange(len(places))
        self.moving, self.positions = moving[welded], self.vertices[places]
        self.corners = self.moving[self.triangles]
        self.facing, self.sides = facings(self.meshes)
        for number in np.flatnonzero(~self.normals.any(axis=1)):
            mesh = np.searchsorted(np.cumsum(list(map(len, faces))), number, side="right")
            first = sum(map(len, faces[:mesh]))
            raise InputError(
                f"{scene.name}: triangle {number - first} of shape '{self.meshes[mesh].id()}' has "
                "no area; remove it"
            )

    @cached_property
    def normals(self) -> np.ndarray:
        """Twice the area of each triangle times its outward normal, (T, 3) [m^2]."""
        a, b, c = np.moveaxis(self.vertices[self.triangles], 1, 0)
        return np.cross(b - a, c - a) * self.facing[:, None]

    def at_vertices(self, values: np.ndarray, of=slice(None)) -> np.ndarray:
        """Sums at the moving vertices over their triangles; values: (T,), or by corner (T, 3)."""
        values = np.broadcast_to(np.reshape(values, (len(self.triangles), -1)), self.corners.shape)
        corners, values = self.corners[of], values[of]
        return np.bincount(corners[corners >= 0], values[corners >= 0], len(self.positions))

    @cached_property
    def areas(self) -> np.ndarray:
        """A third of the area of the group's triangles at each moving vertex, (n,) [m^2]."""
        return self.at_vertices(np.linalg.norm(self.normals, axis=1) / 6, self.in_group)

    @cached_property
    def outward(self) -> np.ndarray:
        """Outward unit normals at the moving vertices: means over the group's triangles, (n, 3).

        The normal is 0 where they cancel, as in a plate without thickness.
        """
        sums = np.array([self.at_vertices(axis, self.in_group) for axis in self.normals.T])
        lengths = np.linalg.norm(sums, axis=0)
        known = lengths > EDGE_ON * self.areas
        return np.divide(sums, lengths, out=np.zeros_like(sums), where=known).T

    def reach(self) -> np.ndarray:
        """Distances over which the surroundings of the moving vertices change, (n,) [m].

        It is the mean height of the triangles, by area, or the distance to the next surface before
        or behind the vertex if that is nearer; at most some of their least heights, such as the
        thickness of a plate at its rim, so that thin triangles do not turn far.
        """
        corners = self.vertices[self.triangles]
        longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
        twice_area = np.linalg.norm(self.normals, axis=1)
        height = self.at_vertices(twice_area**2 / np.maximum(longest, 1e-300))
        height /= np.maximum(self.at_vertices(twice_area), 1e-300)
        thinnest = np.full(len(height) + 1, np.inf)
        np.minimum.at(thinnest, self.corners, (twice_area / longest)[:, None])
        largest = np.clip(LEAST_HEIGHTS * thinnest[:-1], THINNEST * height, height)
        nearest = np.full(len(height), np.inf)
        for normals in (self.outward, -self.outward):
            start = self.positions + BESIDE * height[:, None] * normals
            ray = mi.Ray3f(mi.Point3f(*start.T), mi.Vector3f(*normals.T))
            hit = self.scene.mi.ray_intersect_preliminary(ray)
            nearest = np.fmin(nearest, np.where(hit.is_valid().numpy(), hit.t.numpy(), np.inf))
        return np.minimum(np.maximum(nearest, NEARER * height), largest)

    def colours(self) -> np.ndarray:
        """A number for each moving vertex that differs between the corners of a triangle, (n,)."""
        neighbours = [set() for _ in self.positions]
        for triple in self.corners[(self.corners >= 0).any(axis=1)].tolist():
            for vertex in set(triple) - {-1}:
                neighbours[vertex].update(triple)
        colours = np.full(len(neighbours), -1)
        for vertex in np.argsort([-len(near) for near in neighbours], kind="stable"):
            taken = {colours[near] for near in neighbours[vertex] - {-1}}
            colours[vertex] = next(k for k in range(len(taken) + 1) if k not in taken)
        return colours

    def displaced(self, displacements: np.ndarray) -> np.ndarray:
        """All vertices after displacements (n, 3) of those that move, (V, 3) [m]."""
        return self.vertices + np.append(displacements, np.zeros((1, 3)), axis=0)[self.moving]

    def buffers(self, vertices: np.ndarray) -> dict[mi.Shape, np.ndarray]:
        """The vertices (V, 3) [m] by mesh."""
        return dict(zip(self.meshes, np.split(vertices, self.ends)))

    def whole(self, sensor) -> np.ndarray:
        """Areas of the triangles in parts of the window's area, (T,)."""
        return np.linalg.norm(self.normals, axis=1) / (2 * np.prod(window_size(sensor)))

    def in_view(self, sensor, vertices: np.ndarray) -> np.ndarray:
        """Visible areas of the triangles in parts of the window's area, (T,).

        The area of a triangle that is edge-on is 0.
        """
        toward = projected(vertices[self.triangles], sensor)
        toward *= np.where(np.abs(toward) > EDGE_ON * self.whole(sensor), self.facing, 0)
        return np.abs(toward) * np.where(toward > 0, *self.sides[::-1])

    def growth(self, sensor, along: np.ndarray) -> np.ndarray:
        """Derivatives of the visible areas with respect to the displacements of corners, (T, 3).

        It is the mean of both one-sided derivatives for a triangle that is edge-on.

        along: displacement of each moving vertex per unit of its parameter, (n, 3) [m].
        """
        corners, growth = self.vertices[self.triangles], np.empty(self.triangles.shape)
        along = np.append(along, np.zeros((1, 3)), axis=0)[self.corners]
        toward = projected(corners, sensor) * self.facing
        side = np.where(np.abs(toward) > EDGE_ON * self.whole(sensor), np.sign(toward), 0)
        back, front = self.sides
        factor = (front * (1 + side) - back * (1 - side)) / 2
        for k in range(3):
            # The signed area is linear in the position of one corner
            moved = corners.copy()
            moved[:, k] += along[:, k]
            growth[:, k] = factor * (projected(moved, sensor) * self.facing - toward)
        return growth

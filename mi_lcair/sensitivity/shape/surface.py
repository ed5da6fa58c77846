"""The surface of a model whose vertices move one by one, and what a sensor sees of it."""

from functools import cached_property
from itertools import count

import mitsuba as mi
import numpy as np
from scipy.sparse import csr_array

from mi_lcair.errors import InputError, check_known
from mi_lcair.models3d.coincident import weld
from mi_lcair.plugins.emission.triangles import triangle_vertices, vertex_positions
from mi_lcair.rendering.facets.polygons import normals_of
from mi_lcair.rendering.facets.starts import facings, meshes_of_model, projected
from mi_lcair.rendering.motions.motion import groups_of_meshes
from mi_lcair.rendering.window import window, window_size

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
    numbers of vertices at which the next mesh begins. triangles: their vertices (T, 3),
    anticlockwise about the outward normal. moving:
    number of each vertex among those that move, -1 for one that does not, (V,). positions: those of
    the moving vertices, (n, 3) [m]. corners: as `moving`, for the corners of the triangles, (T, 3).
    has: 1 for the moving vertices of each triangle, (T, n). in_group: whether a triangle is one of
    the group (T,). sides: see `facings`.
    """

    def __init__(self, scene, group: str):
        self.scene, self.meshes = scene, meshes_of_model(scene)
        groups = groups_of_meshes(scene)
        check_known(f"group of meshes of {scene.name}", groups, group)
        if self.meshes is None:
            raise InputError(f"{scene.name}: a part of the model is no mesh, and has no vertices")
        vertices = [vertex_positions(mesh).astype(float) for mesh in self.meshes]
        faces = [
            triangle_vertices(mesh)[:, :: -1 if mesh.has_flipped_normals() else 1].astype(int)
            for mesh in self.meshes
        ]
        for mesh, corners in zip(self.meshes, (v[f] for v, f in zip(vertices, faces))):
            flat = ~normals_of(corners).any(axis=1)
            if flat.any():
                raise InputError(
                    f"{scene.name}: triangle {flat.argmax()} of shape '{mesh.id()}' has no area; "
                    "remove it"
                )
        *firsts, _ = ends = np.cumsum([0, *map(len, vertices)])
        self.ends, self.vertices = ends[1:-1], np.concatenate(vertices)
        self.triangles = np.concatenate([f + first for f, first in zip(faces, firsts)])
        of_group = [mesh in groups[group] for mesh in self.meshes]
        self.in_group = np.repeat(of_group, list(map(len, faces)))
        welded, moving = weld(self.vertices), np.full(len(self.vertices), -1)
        places = np.unique(welded[self.triangles[self.in_group]])
        moving[places] = np.arange(len(places))
        self.moving, self.positions = moving[welded], self.vertices[places]
        self.corners = self.moving[self.triangles]
        self.has = self.by_vertex(np.ones(self.corners.shape))
        self.sides = facings(self.meshes)[1]

    def by_vertex(self, values: np.ndarray) -> csr_array:
        """Values of the corners of each triangle (T, 3) by moving vertex, (T, n)."""
        triangle, corner = np.nonzero(self.corners >= 0)
        places = triangle, self.corners[triangle, corner]
        shape = len(values), len(self.positions)
        return csr_array((values[triangle, corner], places), shape=shape)

    @cached_property
    def normals(self) -> np.ndarray:
        """Twice the area of each triangle times its outward normal, (T, 3) [m^2]."""
        return normals_of(self.vertices[self.triangles])

    @cached_property
    def areas(self) -> np.ndarray:
        """A third of the area of the group's triangles at each moving vertex, (n,) [m^2]."""
        return (self.in_group * np.linalg.norm(self.normals, axis=1) / 6) @ self.has

    @cached_property
    def outward(self) -> np.ndarray:
        """Outward unit normals at the moving vertices: means over the group's triangles, (n, 3).

        The normal is 0 where they cancel, as in a plate without thickness.
        """
        sums = self.has.T @ (self.normals * self.in_group[:, None])
        lengths = np.linalg.norm(sums, axis=1, keepdims=True)
        known = lengths > EDGE_ON * self.areas[:, None]
        return np.divide(sums, lengths, out=np.zeros_like(sums), where=known)

    def reach(self) -> np.ndarray:
        """Distances over which the surroundings of the moving vertices change, (n,) [m].

        It is the mean height of the triangles, by area, or the distance to the next surface before
        or behind the vertex if that is nearer; at most some of their least heights, such as the
        thickness of a plate at its rim, so that thin triangles do not turn far.
        """
        corners = self.vertices[self.triangles]
        longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
        twice_area = np.linalg.norm(self.normals, axis=1)
        heights = twice_area / longest
        height = (twice_area * heights) @ self.has / (twice_area @ self.has)
        thinnest = 1 / self.has.multiply(1 / heights[:, None]).max(axis=0).toarray().ravel()
        largest = np.clip(LEAST_HEIGHTS * thinnest, THINNEST * height, height)
        nearest = np.full(len(height), np.inf)
        for normals in (self.outward, -self.outward):
            start = self.positions + BESIDE * height[:, None] * normals
            ray = mi.Ray3f(mi.Point3f(*start.T), mi.Vector3f(*normals.T))
            hit = self.scene.mi.ray_intersect_preliminary(ray)
            nearest = np.fmin(nearest, np.where(hit.is_valid().numpy(), hit.t.numpy(), np.inf))
        return np.minimum(np.maximum(nearest, NEARER * height), largest)

    def colours(self) -> np.ndarray:
        """A number for each moving vertex that differs between the corners of a triangle, (n,)."""
        beside = csr_array(self.has.T @ self.has)
        neighbours = np.split(beside.indices, beside.indptr[1:-1])
        colours = np.full(len(neighbours), -1)
        for vertex in np.argsort([-len(near) for near in neighbours], kind="stable"):
            taken = set(colours[neighbours[vertex]].tolist())
            colours[vertex] = next(k for k in count() if k not in taken)
        return colours

    def displaced(self, displacements: np.ndarray) -> np.ndarray:
        """All vertices after displacements (n, 3) of those that move, (V, 3) [m]."""
        return self.vertices + np.append(displacements, np.zeros((1, 3)), axis=0)[self.moving]

    def by_mesh(self, vertices: np.ndarray) -> dict[mi.Shape, np.ndarray]:
        """The vertices (V, 3) [m] by mesh."""
        return dict(zip(self.meshes, np.split(vertices, self.ends)))

    def in_view(self, sensor, vertices: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Visible areas of the triangles in parts of the window's area, (T,).

        Also their derivatives with respect to the areas toward the sensor. The area of a triangle
        that is edge-on is 0. Its derivative is the mean of the one-sided ones.
        """
        toward = projected(vertices[self.triangles], sensor)
        whole = np.linalg.norm(self.normals, axis=1) / (2 * np.prod(window_size(sensor)))
        side = np.where(np.abs(toward) > EDGE_ON * whole, np.sign(toward), 0)
        back, front = self.sides
        slope = (front * (1 + side) - back * (1 - side)) / 2
        return np.where(side == 0, 0, slope * toward), slope

    def growth(self, sensor, along: np.ndarray) -> csr_array:
        """Derivatives of the visible areas with respect to the displacements, (T, n).

        along: displacement of each moving vertex per unit of its parameter, (n, 3) [m].
        """
        corners = self.vertices[self.triangles]
        opposite = np.roll(corners, -1, axis=1) - np.roll(corners, 1, axis=1)
        change = np.cross(along[self.corners], opposite) @ -window(sensor)[-1]
        slope = self.in_view(sensor, self.vertices)[1] / (2 * np.prod(window_size(sensor)))
        return self.by_vertex(slope[:, None] * change)

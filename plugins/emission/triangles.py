"""Sampling of the triangles of emitting meshes: the triangle, and the point on it."""

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.plugins.derivatives import members, own_memory, unrecorded

ABSENT = 0xFFFFFFFF  # entry of a mesh that is not in the table
# Names of a mesh's buffers in Mitsuba 3.9. In 3.10 they begin without "vertex_", and are tensors.
VERTICES, NORMALS, TEXTURE = "vertex_positions", "vertex_normals", "vertex_texcoords"
FACES = "faces"


def pointer_id(pointer) -> int:
    """The number by which a Dr.Jit pointer refers to its object."""
    return int(dr.reinterpret_array(mi.UInt32, pointer)[0])


def table_size(ids) -> int:
    """Entries of a table by pointer: a power of two, so that scenes that are alive elsewhere, which
    raise the numbers of pointers, hardly ever change the kernels that hold the size.
    """
    return max(64, 1 << max(ids, default=0).bit_length())


def is_faceted(shape) -> bool:
    """Whether a shape consists of triangles.

    Mitsuba's `is_mesh` cannot be used, because it is also true for a `rectangle`.
    """
    return VERTICES in members(shape)


def vertex_buffer(mesh) -> mi.Float:
    """Mitsuba's own array of the coordinates of a mesh's vertices."""
    return members(mesh)[VERTICES]


def vertex_positions(mesh) -> np.ndarray:
    """Vertices of a mesh [m], (n, 3), Float32."""
    return points(vertex_buffer(mesh))


def points(buffer: mi.Float) -> np.ndarray:
    """The coordinates in a buffer of vertices, (n, 3)."""
    return buffer.numpy().reshape(-1, 3)


def hidden_buffers(shape) -> tuple[mi.Float, mi.UInt32]:
    """Arrays of the vertices and triangles of a mesh or a `rectangle`, which shows them to no
    `traverse`.
    """
    return shape.vertex_positions_buffer(), shape.faces_buffer()


def corners_of(shape) -> np.ndarray:
    """Corners of the triangles of a mesh or a rectangle, (n, 3, 3) [m], Float32."""
    vertices, faces = hidden_buffers(shape)
    return points(vertices)[faces.numpy().reshape(-1, 3)]


def set_triangles(mesh, vertices: np.ndarray, triangles: np.ndarray) -> None:
    """Give a mesh its vertices [m], (n, 3), and its triangles, the numbers of vertices, (m, 3)."""
    parameters = mi.traverse(mesh)
    buffers = mi.Float(np.ravel(vertices)), mi.UInt32(triangles.astype(np.uint32).ravel())
    own_memory(buffers)
    parameters[VERTICES], parameters[FACES] = buffers
    parameters.update()


def set_vertices(scene: mi.Scene, buffers: dict) -> None:
    """Give meshes other vertices, mi.Float of 3 n coordinates [m], and rebuild what finds hits."""
    for mesh, buffer in buffers.items():
        parameters = mi.traverse(mesh)
        parameters[VERTICES] = buffer
        parameters.update()
    refresh_geometry(scene)


def refresh_geometry(scene: mi.Scene) -> None:
    """Rebuild the acceleration structure of a scene if its meshes have changed since.

    Mitsuba does so only for changes that were made by `mi.traverse(scene)`, not for those by
    `mi.traverse(mesh)`.
    """
    scene.parameters_changed([])


def triangle_corners(mesh) -> tuple[np.ndarray, ...]:
    """First, second and third corners of a mesh's triangles [m], (n, 3) each, Float32."""
    vertices, faces = vertex_positions(mesh), triangle_vertices(mesh)
    return tuple(vertices[faces[:, corner]] for corner in range(3))


def triangle_vertices(mesh) -> np.ndarray:
    """Numbers of the three vertices of each of a mesh's triangles, (n, 3)."""
    return members(mesh)[FACES].numpy().reshape(-1, 3)


class PrimitiveTable:
    """Numbers of the primitives of shapes or of emitters, found by the pointer of a hit.

    ids: numbers of the pointers. numbers: for each, one number or one for each primitive. A shape
    that is not a mesh may have several primitives, but it is one facet. otherwise: the number of
    everything else, which is entry 0 of `values`.
    """

    def __init__(self, ids: list[int], numbers: list, otherwise: int):
        counts = list(map(len, numbers))
        first, last = np.zeros((2, table_size(ids)), dtype=np.uint32)
        first[ids] = 1 + np.cumsum([0, *counts[:-1]])
        last[ids] = [count - 1 for count in counts]
        self.first, self.last = mi.UInt32(first), mi.UInt32(last)
        self.values = mi.UInt32(np.concatenate([[otherwise], *numbers]).astype(np.uint32))
        dr.make_opaque(self.first, self.last, self.values)

    def at(self, pointer, prim_index, active=True) -> mi.UInt32:
        """The number of a primitive; `otherwise` where it is not active."""
        return dr.gather(mi.UInt32, self.values, self.entry(pointer, prim_index, active))

    def entry(self, pointer, prim_index, active=True) -> mi.UInt32:
        """The place of a primitive's number in `values`; 0 where it is not active."""
        key = dr.reinterpret_array(mi.UInt32, pointer)
        known = mi.Bool(active) & (key < dr.width(self.first))
        last = dr.gather(mi.UInt32, self.last, key, known)
        return dr.gather(mi.UInt32, self.first, key, known) + dr.minimum(prim_index, last)


def numbers_of_triangles(meshes) -> PrimitiveTable:
    """The numbers of the triangles of meshes, from 1 on, and 0 for everything else."""
    ids = [pointer_id(mi.ShapePtr(mesh)) for mesh in meshes]
    ends = np.cumsum([len(triangle_vertices(mesh)) for mesh in meshes])
    return PrimitiveTable(ids, np.split(1 + np.arange(ends[-1]), ends[:-1]), 0)


def random_integer(sample):
    """32 random bits (UInt32) from a uniform 2D sample, whose numbers hold 23 bits each."""
    high, low = (mi.UInt32(number * 2**16) for number in (sample.x, sample.y))
    return (high << 16) | low


class Choice:
    """Table from which a random 32-bit integer draws an index with given probabilities.

    A Float32 random number has only 2^23 values, too few for accurate probabilities of millions of
    indices. The table therefore holds integers. Probabilities are rounded to multiples of 2^-32,
    and `probability` holds the rounded values, which are exact for the indices that are drawn.

    weights: (n,) or (rows, n), proportional to the probabilities, not all 0 in a row. probability:
    the same shape, NumPy Float64. count: n.
    """

    UNRECORDED = ("probability",)

    def __init__(self, weights):
        parts = np.cumsum(weights, axis=-1) / np.sum(weights, axis=-1, keepdims=True)
        ends = np.rint(parts * 2.0**32).astype(np.uint64)
        ends[..., -1] = 2**32
        self.probability = np.diff(ends, prepend=np.uint64(0)) / 2.0**32
        self.ends = mi.UInt32(np.minimum(ends, 2**32 - 1).astype(np.uint32).ravel())
        self.count = ends.shape[-1]
        dr.make_opaque(self.ends)

    @staticmethod
    def of_ends(ends: mi.UInt32, count: int) -> "Choice":
        """A table that draws only, from the `ends` of another one."""
        table = Choice.__new__(Choice)
        table.ends, table.count = ends, count
        return table

    def pick(self, number, active=True, first=0):
        """The index that a random 32-bit integer selects in the row that begins at `first`."""
        return dr.binary_search(
            0,
            self.count - 1,
            lambda k: dr.gather(mi.UInt32, self.ends, first + k, active) <= number,
        )

    def pick_and_rest(self, sample, active=True, first=0):
        """The index that a 2D sample of 23 + 23 bits selects, and a 2D sample for a point in it.

        All bits of the first number and the lowest 9 bits of the second one select the index. The
        first coordinate of the point is the position of the 32-bit integer among all integers that
        select the same index. The second coordinate is the second number.
        """
        high, low = mi.UInt32(sample.x * 2**23), mi.UInt32(sample.y * 2**23) & (2**9 - 1)
        number = (high << 9) | low
        index = self.pick(number, active, first)
        end = dr.gather(mi.UInt32, self.ends, first + index, active)
        before = first + dr.maximum(index, 1) - 1
        start = dr.gather(mi.UInt32, self.ends, before, active & (index > 0))
        within = (mi.Float(number - start) + 0.5) / mi.Float(dr.maximum(end - start, 1))
        return index, mi.Point2f(dr.minimum(within, dr.one_minus_epsilon(mi.Float)), sample.y)


class TriangleTable:
    """The triangles of some meshes, numbered consecutively from the first mesh to the last.

    counts: number of triangles of each mesh. area: (n,), NumPy Float64 [m^2].
    """

    UNRECORDED = ("counts", "area")

    def __init__(self, meshes):
        corners, first = [], {}
        for mesh in meshes:
            first[pointer_id(mi.ShapePtr(mesh))] = sum(len(p) for p, _, _ in corners)
            corners.append(triangle_corners(mesh))
        self.counts = [len(p) for p, _, _ in corners]
        p0, p1, p2 = (np.concatenate(points).astype(np.float64) for points in zip(*corners))
        flips = [
            np.full(count, -1.0 if mesh.has_flipped_normals() else 1.0)
            for mesh, count in zip(meshes, self.counts)
        ]
        normal = np.cross(p1 - p0, p2 - p0) * np.concatenate(flips)[:, None]
        self.area = 0.5 * np.linalg.norm(normal, axis=1)
        self.first = mi.UInt32(
            np.array([first.get(k, ABSENT) for k in range(table_size(first))], dtype=np.uint32)
        )
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
        # One row each for the corner and two edges, and the normal in the rows' fourth numbers.
        # Dr.Jit reads four consecutive numbers at once, which is faster than one at a time.
        rows = np.stack([p0, p1 - p0, p2 - p0], axis=1)
        self.rows = mi.Float(np.concatenate([rows, normal[:, :, None]], axis=2).ravel())
        own_memory([self.first, self.rows])

    def point(self, triangle, sample, active=True):
        """Barycentric coordinates, point [m] and normal on a triangle, for a uniform 2D sample."""
        return point_on(self.rows, triangle, sample, active)

    def find(self, shape, prim_index, active=True):
        """The number of a shape's triangle, and whether the triangle is in the table."""
        key = dr.reinterpret_array(mi.UInt32, shape)
        known = active & (key < dr.width(self.first))
        first = dr.gather(mi.UInt32, self.first, key, known)
        known &= first != ABSENT
        return dr.select(known, first + prim_index, 0), known

    def density(self, probability):
        """Density per area [1/m^2] of uniform points on triangles drawn with `probability`."""
        return mi.Float(
            np.divide(probability, self.area, out=np.zeros_like(self.area), where=self.area > 0)
        )


def point_on(rows: mi.Float, triangle, sample, active=True):
    """As `TriangleTable.point`; rows: those of such a table."""
    uv = mi.warp.square_to_uniform_triangle(sample)
    corner, edge_1, edge_2 = (
        dr.gather(mi.Vector4f, rows, 3 * triangle + row, active) for row in range(3)
    )
    point = mi.Point3f((corner + uv.x * edge_1 + uv.y * edge_2).xyz)
    return uv, point, mi.Normal3f(corner.w, edge_1.w, edge_2.w)


def is_mirrored(shape) -> bool:
    """Whether the `to_world` of a shape mirrors it, as a negative scale does."""
    matrix = np.array(members(shape)["to_world"].matrix, dtype=float)[:3, :3]
    return np.linalg.det(np.squeeze(matrix)) < 0


def sphere_of(shape) -> tuple[float, ...]:
    """Centre of a sphere, and 1 or, with flipped normals, -1.

    For another shape the sign of Mitsuba's normals at its position samples, and zeros. Those of a
    mirrored cylinder point to the other side.
    """
    if shape.class_name() == "Cylinder" and unrecorded(is_mirrored, shape):
        return -1.0, 0.0, 0.0, 0.0
    if shape.class_name() != "Sphere":
        return 1.0, 0.0, 0.0, 0.0
    sign = -1.0 if shape.has_flipped_normals() else 1.0
    return *np.array(shape.bbox().center(), dtype=float).tolist(), sign


def normal_of(ps, sphere: mi.Vector4f) -> mi.Normal3f:
    """Normal at a position sample of a shape; sphere: see `sphere_of`.

    Mitsuba 3.9 leaves out the turn of a sphere from its normals.
    """
    outward = dr.normalize(ps.p - mi.Point3f(sphere.xyz)) * sphere.w
    return dr.select(sphere.w == 0, ps.n * sphere.x, mi.Normal3f(outward))


def loops(edges: np.ndarray) -> list[list[int]]:
    """Closed lines of edges (n, 2) between numbered corners: the corners of each, in order."""
    ends = {}
    for a, b in edges.tolist():
        ends.setdefault(a, []).append(b)
        ends.setdefault(b, []).append(a)
    lines = []
    while ends:
        line = [next(iter(ends))]
        while line[-1] in ends:
            here = line[-1]
            there = ends[here].pop()
            ends[there].remove(here)
            for end in {here, there}:
                if not ends[end]:
                    del ends[end]
            line.append(there)
        lines.append(line[:-1])
    return lines

"""Starting points of the deterministic methods.

These are points of the visible facets. Each carries the projected area of the part of a facet that
it represents.
"""

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from benchmarks.methods.propagation.problem import Problem
from mi_lcair.rendering.window import window

# Each part of a triangle is divided into FINER^2 = 16 smaller ones, over which its visible share is
# counted. The middle of one of them is the middle of the part itself.
FINER = 4


@dataclass(frozen=True)
class Points:
    """Points of visible triangles.

    ray: rays of the sensor to the points. area: projected area that each point represents, the
    A cos(theta) V of Eq 3.13 [m^2]. triangle: row of the triangle that each point lies on. cast:
    number of rays that were traced to find the points.
    """

    ray: mi.Ray3f
    area: mi.Float
    triangle: mi.UInt32
    cast: int

    def by_triangle(self, count: int) -> np.ndarray:
        """Visible projected area of each of `count` triangles, (count,) [m^2]."""
        return np.bincount(self.triangle.numpy(), self.area.numpy().astype(float), count)


def visible_points(problem: Problem, count: int, corners=None, owner=None) -> Points:
    """Return about `count` points on the visible triangles of the model.

    The number of points on a triangle is proportional to its projected area, and at least one. Each
    triangle is projected and clipped to the window exactly. The clipped polygon is divided into
    equal parts. 16 rays to each part determine its visible share. The point of the part is its
    middle, or the visible point nearest to the middle.

    Parameters
    ----------
    problem
        Scene and sensor.
    count
        Approximate number of points.
    corners : (T, 3, 3)
        Corners of the triangles or of parts of them; by default the triangles of the scene [m].
    owner : (T,)
        Number of the scene's triangle to which each row of `corners` belongs.
    """
    table = problem.facets
    if corners is None:
        corners, owner = table.triangles, np.arange(len(table.triangles))
    origin, right, up, direction = window(problem.scene.sensor(0))
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    faces_sensor = (normal @ direction < 0) & (table.type[table.triangle_facet[owner]] == "model")
    plane = np.stack([(corners - origin) @ axis / (axis @ axis) for axis in (right, up)], axis=-1)
    inside = np.all((plane >= 0) & (plane <= 1), axis=(1, 2))
    meets = np.all((plane.max(axis=1) > 0) & (plane.min(axis=1) < 1), axis=1) & faces_sensor

    pieces, row = [plane[meets & inside]], [np.flatnonzero(meets & inside)]
    for k in np.flatnonzero(meets & ~inside):
        polygon = cut(plane[k])
        fan = [(polygon[0], *pair) for pair in zip(polygon[1:], polygon[2:])]
        if fan:
            pieces.append(np.array(fan))
            row.append(np.full(len(fan), k))
    pieces, row = np.concatenate(pieces), np.concatenate(row)

    area = problem.window_area * 0.5 * np.abs(np.linalg.det(pieces[:, 1:] - pieces[:, :1]))
    divisions = np.maximum(1, np.round(np.sqrt(count * area / area.sum()))).astype(int)
    places, piece, part, parts_before = [], [], [], 0
    for n in np.unique(divisions):
        divided = np.flatnonzero(divisions == n)
        weights, within = finer_middles(n)
        places.append(np.einsum("mc,tcx->tmx", weights, pieces[divided]).reshape(-1, 2))
        piece.append(np.repeat(divided, len(weights)))
        part.append((parts_before + n * n * np.arange(len(divided))[:, None] + within).ravel())
        parts_before += n * n * len(divided)
    places, piece, part = np.concatenate(places), np.concatenate(piece), np.concatenate(part)

    start = origin + places[:, :1] * right + places[:, 1:] * up
    ray = mi.Ray3f(mi.Point3f(start.T), mi.Vector3f(np.broadcast_to(direction, start.shape).T))
    hit = problem.scene.mi.ray_intersect_preliminary(ray)
    triangle, known = problem.triangles.find(hit.shape, hit.prim_index, hit.is_valid())
    in_sight = np.flatnonzero((known & (triangle == mi.UInt32(owner[row[piece]]))).numpy())
    _, first, counts = np.unique(part[in_sight], return_index=True, return_counts=True)
    nearest = in_sight[first]
    return Points(
        dr.gather(mi.Ray3f, ray, mi.UInt32(nearest)),
        mi.Float((area / (FINER * divisions) ** 2)[piece[nearest]] * counts),
        mi.UInt32(row[piece[nearest]]),
        len(piece),
    )


def finer_middles(n: int) -> tuple[np.ndarray, np.ndarray]:
    """Middles of the (FINER n)^2 equal parts of a triangle, and the n^2 parts that they lie in.

    Returns the barycentric coordinates of the middles, (FINER^2 n^2, 3), and for each the number of
    the part. Within a part, the middles nearest to the part's own come first.
    """
    weights = barycentric_middles(FINER * n)
    part = part_index(mi.Point2f(weights[:, 1:].T), mi.UInt32(n)).numpy()
    order = np.argsort(
        np.linalg.norm(weights - barycentric_middles(n)[part], axis=1), kind="stable"
    )
    return weights[order], part[order]


def cut(polygon) -> list:
    """Clip a convex polygon to the unit square (Sutherland and Hodgman 1974)."""
    for axis in (0, 1):
        for sign, limit in ((1, 0.0), (-1, -1.0)):
            kept = []
            for a, b in zip(polygon, [*polygon[1:], *polygon[:1]]):
                da, db = sign * a[axis] - limit, sign * b[axis] - limit
                if da >= 0:
                    kept.append(a)
                if da * db < 0:
                    kept.append(a + (b - a) * da / (da - db))
            polygon = kept
    return polygon


def barycentric_middles(n: int) -> np.ndarray:
    """Barycentric coordinates of the middles of the n^2 equal parts of a triangle, (n^2, 3).

    The order is that of `part_index`.
    """
    i, j, upper = parts(n)
    third = np.where(upper, 2, 1) / 3
    u, v = (i + third) / n, (j + third) / n
    return np.stack([1 - u - v, u, v], axis=1)


def parts(n: int) -> tuple[np.ndarray, ...]:
    """Place of each of the n^2 equal parts of a triangle.

    Returns the row, the place in the row, and whether the part is turned by half a turn.
    """
    i = np.repeat(np.arange(n), 2 * np.arange(n, 0, -1) - 1)
    k = np.arange(n * n) - i * (2 * n - i)
    return i, k // 2, k % 2 == 1


def part_corners(corners, n: int) -> np.ndarray:
    """Corners of the n^2 equal parts of triangles, (T n^2, 3, 3), in the triangles' own sense."""
    i, j, upper = (values[:, None] for values in parts(n))
    u = (i + np.where(upper, [1, 1, 0], [0, 1, 0])) / n
    v = (j + np.where(upper, [0, 1, 1], [0, 0, 1])) / n
    return np.einsum("mkc,tcx->tmkx", np.stack([1 - u - v, u, v], axis=-1), corners).reshape(
        -1, 3, 3
    )


def part_index(uv, n: mi.UInt32) -> mi.UInt32:
    """Number of the part, out of n^2, that contains a point.

    uv: barycentric coordinates of the point that belong to the second and third corner.
    """
    i = dr.minimum(mi.UInt32(uv.x * n), n - 1)
    j = dr.minimum(mi.UInt32(uv.y * n), n - 1 - i)
    upper = uv.x * n - i + uv.y * n - j > 1
    k = 2 * j + dr.select(upper & (j < n - 1 - i), mi.UInt32(1), 0)
    return i * (2 * n - i) + k

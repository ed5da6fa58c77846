"""Where the deterministic methods look from: points of the visible facets, each with the projected
area that it stands for.
"""

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.benchmark.propagation.problem import Problem
from mi_lcair.rendering.window import window

# subdivision of a part by which its visible share is counted; the middle of one of the 16 is the
# part's own
FINER = 4


@dataclass(frozen=True)
class Points:
    """Rays of the sensor to points of visible triangles; `area`: the projected area that each
    stands for, the A cos(theta) V of Eq 3.13 [m^2]; `triangle`: the row of the corners that it lies
    on; `cast`: how many rays it took to find them.
    """

    ray: mi.Ray3f
    area: mi.Float
    triangle: mi.UInt32
    cast: int


def visible_points(problem: Problem, count: int, corners=None, owner=None) -> Points:
    """About `count` points, at least one on each visible triangle of the model, in proportion to
    projected area.

    Each triangle is projected and cut to the window exactly; what is left is divided into equal
    parts. Of each part 16 rays tell how much is in sight, and its middle, or the nearest to it that
    is in sight, stands for it. corners (T, 3, 3), owner (T,): parts of the scene's triangles and of
    which triangle; by default the triangles themselves.
    """
    table = problem.facets
    if corners is None:
        corners, owner = table.triangles, np.arange(len(table.triangles))
    origin, right, up, direction = window(problem.scene.sensor(0))
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    faces_us = (normal @ direction < 0) & (table.type[table.triangle_facet[owner]] == "model")
    plane = np.stack([(corners - origin) @ axis / (axis @ axis) for axis in (right, up)], axis=-1)
    inside = np.all((plane >= 0) & (plane <= 1), axis=(1, 2))
    meets = np.all((plane.max(axis=1) > 0) & (plane.min(axis=1) < 1), axis=1) & faces_us

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
        chosen = np.flatnonzero(divisions == n)
        weights, within = finer_middles(n)
        places.append(np.einsum("mc,tcx->tmx", weights, pieces[chosen]).reshape(-1, 2))
        piece.append(np.repeat(chosen, len(weights)))
        part.append((parts_before + n * n * np.arange(len(chosen))[:, None] + within).ravel())
        parts_before += n * n * len(chosen)
    places, piece, part = np.concatenate(places), np.concatenate(piece), np.concatenate(part)

    start = origin + places[:, :1] * right + places[:, 1:] * up
    ray = mi.Ray3f(mi.Point3f(start.T), mi.Vector3f(np.broadcast_to(direction, start.shape).T))
    hit = problem.scene.mi.ray_intersect_preliminary(ray)
    found, known = problem.triangles.find(hit.shape, hit.prim_index, hit.is_valid())
    in_sight = np.flatnonzero((known & (found == mi.UInt32(owner[row[piece]]))).numpy())
    _, first, counts = np.unique(part[in_sight], return_index=True, return_counts=True)
    seen = in_sight[first]
    return Points(
        dr.gather(mi.Ray3f, ray, mi.UInt32(seen)),
        mi.Float((area / (FINER * divisions) ** 2)[piece[seen]] * counts),
        mi.UInt32(row[piece[seen]]),
        len(piece),
    )


def finer_middles(n: int) -> tuple[np.ndarray, np.ndarray]:
    """Middles of the (FINER n)^2 equal parts of a triangle, as weights of its corners, and in which
    of its n^2 parts each lies; of one part, the nearest to its middle first.
    """
    weights = barycentric_middles(FINER * n)
    part = part_index(mi.Point2f(weights[:, 1:].T), mi.UInt32(n)).numpy()
    order = np.argsort(
        np.linalg.norm(weights - barycentric_middles(n)[part], axis=1), kind="stable"
    )
    return weights[order], part[order]


def cut(polygon) -> list:
    """A convex polygon's part inside the unit square (Sutherland and Hodgman 1974)."""
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
    """Middles of the n^2 equal parts of a triangle, as weights of its corners, in the order of
    `part_index`; (n^2, 3).
    """
    i, j, upper = parts(n)
    third = np.where(upper, 2, 1) / 3
    u, v = (i + third) / n, (j + third) / n
    return np.stack([1 - u - v, u, v], axis=1)


def parts(n: int) -> tuple[np.ndarray, ...]:
    """Row, place in the row, and whether it stands on its head, of the n^2 equal parts of a
    triangle.
    """
    i = np.repeat(np.arange(n), 2 * np.arange(n, 0, -1) - 1)
    k = np.arange(n * n) - i * (2 * n - i)
    return i, k // 2, k % 2 == 1


def part_corners(corners, n: int) -> np.ndarray:
    """Corners of the n^2 equal parts of triangles, (T n^2, 3, 3), anticlockwise as they are."""
    i, j, upper = (values[:, None] for values in parts(n))
    u = (i + np.where(upper, [1, 1, 0], [0, 1, 0])) / n
    v = (j + np.where(upper, [0, 1, 1], [0, 0, 1])) / n
    return np.einsum("mkc,tcx->tmkx", np.stack([1 - u - v, u, v], axis=-1), corners).reshape(
        -1, 3, 3
    )


def part_index(uv, n: mi.UInt32) -> mi.UInt32:
    """Which of the n^2 parts holds a point, by the weights uv of the second and third corner."""
    i = dr.minimum(mi.UInt32(uv.x * n), n - 1)
    j = dr.minimum(mi.UInt32(uv.y * n), n - 1 - i)
    upper = uv.x * n - i + uv.y * n - j > 1
    k = 2 * j + dr.select(upper & (j < n - 1 - i), mi.UInt32(1), 0)
    return i * (2 * n - i) + k

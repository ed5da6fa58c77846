"""Where the deterministic methods look from: points of the visible facets, each with the projected area that it stands for."""
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from .problem import Problem


@dataclass(frozen=True)
class Points:
    """Rays of the sensor to points of visible triangles; `area`: the projected area that each stands for [m^2]; `triangle`:
    the row of the corners that it lies on. The areas are those of Eq 3.13, A cos(theta) V."""
    ray: mi.Ray3f
    area: mi.Float
    triangle: mi.UInt32

    def part(self, first: int, count: int) -> "Points":
        index = first + dr.arange(mi.UInt32, min(count, dr.width(self.area) - first))
        return Points(*(dr.gather(type(values), values, index) for values in (self.ray, self.area, self.triangle)))


def visible_points(problem: Problem, count: int, corners=None, owner=None) -> Points:
    """About `count` points, at least one on each visible triangle of the model, in proportion to projected area.

    Each triangle is projected and cut to the window exactly; what is left is divided into equal parts, and the middle of
    each, if nothing hides it, stands for that part. corners (T, 3, 3), owner (T,): parts of the scene's triangles and of
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

    area = problem.window_area * 0.5 * np.abs(np.cross(pieces[:, 1] - pieces[:, 0], pieces[:, 2] - pieces[:, 0]))
    divisions = np.maximum(1, np.round(np.sqrt(count * area / area.sum()))).astype(int)
    places, piece = [], []
    for n in np.unique(divisions):
        chosen = np.flatnonzero(divisions == n)
        places.append(np.einsum("mc,tcx->tmx", barycentric_middles(n), pieces[chosen]).reshape(-1, 2))
        piece.append(np.repeat(chosen, n * n))
    places, piece = np.concatenate(places), np.concatenate(piece)

    start = origin + places[:, :1] * right + places[:, 1:] * up
    ray = mi.Ray3f(mi.Point3f(start.T), mi.Vector3f(np.broadcast_to(direction, start.shape).T))
    hit = problem.scene.mi.ray_intersect_preliminary(ray)
    found, known = problem.triangles.find(hit.shape, hit.prim_index, hit.is_valid())
    seen = dr.compress(known & (found == mi.UInt32(owner[row[piece]])))
    points = Points(ray, mi.Float((area / divisions**2)[piece]), mi.UInt32(row[piece]))
    return Points(*(dr.gather(type(values), values, seen) for values in (points.ray, points.area, points.triangle)))


def window(sensor) -> tuple[np.ndarray, ...]:
    """An orthographic sensor's window: a corner, its two sides, and the direction of view; Float64."""
    ray, _ = sensor.sample_ray(0, 0, mi.Point2f([0, 1, 0], [0, 0, 1]), mi.Point2f(0.5))
    corner = np.array(ray.o, dtype=np.float64).T
    direction = np.array(ray.d, dtype=np.float64).reshape(3, -1)[:, 0]
    return corner[0], corner[1] - corner[0], corner[2] - corner[0], direction


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
    """Middles of the n^2 equal parts of a triangle, as weights of its corners, in the order of `part_index`; (n^2, 3)."""
    i, j, upper = parts(n)
    third = np.where(upper, 2, 1) / 3
    u, v = (i + third) / n, (j + third) / n
    return np.stack([1 - u - v, u, v], axis=1)


def parts(n: int) -> tuple[np.ndarray, ...]:
    """Row, place in the row, and whether it stands on its head, of the n^2 equal parts of a triangle."""
    i = np.repeat(np.arange(n), 2 * np.arange(n, 0, -1) - 1)
    k = np.arange(n * n) - i * (2 * n - i)
    return i, k // 2, k % 2 == 1


def part_corners(corners, n: int) -> np.ndarray:
    """Corners of the n^2 equal parts of triangles, (T n^2, 3, 3), anticlockwise as they are."""
    i, j, upper = (values[:, None] for values in parts(n))
    u = (i + np.where(upper, [1, 1, 0], [0, 1, 0])) / n
    v = (j + np.where(upper, [0, 1, 1], [0, 0, 1])) / n
    return np.einsum("mkc,tcx->tmkx", np.stack([1 - u - v, u, v], axis=-1), corners).reshape(-1, 3, 3)


def part_index(uv, n: mi.UInt32) -> mi.UInt32:
    """Which of the n^2 parts holds a point, by the weights uv of the second and third corner."""
    i = dr.minimum(mi.UInt32(uv.x * n), n - 1)
    j = dr.minimum(mi.UInt32(uv.y * n), n - 1 - i)
    upper = uv.x * n - i + uv.y * n - j > 1
    k = 2 * j + dr.select(upper & (j < n - 1 - i), mi.UInt32(1), 0)
    return i * (2 * n - i) + k

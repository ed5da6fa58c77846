"""Sheets: one-sided facets back to back. A ray meets the one of the two whose front it sees.

Both lie in one plane, so that rounding decides which of them Mitsuba finds.
"""

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.coincident import SINGLE, overlaps, unit_normals
from mi_lcair.plugins.derivatives import held, own_memory
from mi_lcair.plugins.emission.emissivity import SIDES
from mi_lcair.plugins.emission.triangles import (
    PrimitiveTable,
    corners_of,
    hidden_buffers,
    pointer_id,
)

NEAR = 1e-5  # difference of the heights of planes that are compared, as a part of the scene's size
BESIDE = -1e-5  # least coordinates of a point of a triangle, whose three add up to 1
MOST_KEPT = 16  # geometries whose sheets are kept
KEPT = {}  # for the variables of a geometry: its sheets, and the variables, so that they stay


@dataclass
class Sheets:
    """The triangles of a scene that lie back to back with others, as Dr.Jit arrays.

    number: of each triangle, from 1; 0 for those in no sheet. first: index of each triangle's first
    partner in `partner`, and the end of the list. partner: numbers of triangles, from 0. rows:
    corner of each triangle and its two sides [m], with its normal in the fourth numbers. shape,
    primitive: the triangle.
    """

    number: PrimitiveTable
    first: mi.UInt32
    partner: mi.UInt32
    rows: mi.Float
    shape: mi.UInt32
    primitive: mi.UInt32

    @staticmethod
    def of(scene: mi.Scene) -> "Sheets | None":
        """The sheets of a scene; None if it has none. Those of one geometry are found once."""
        shapes = [shape for shape in scene.shapes() if is_one_sided(shape)]
        buffers = [buffer for shape in shapes for buffer in hidden_buffers(shape)]
        key = *(pointer_id(mi.ShapePtr(s)) for s in shapes), *(buffer.index for buffer in buffers)
        if key not in KEPT:
            if len(KEPT) >= MOST_KEPT:
                KEPT.clear()
            KEPT[key] = sheets_of(shapes), held(buffers)
        return KEPT[key][0]

    @dr.syntax
    def front(self, pi, ray, active=True) -> mi.PreliminaryIntersection3f:
        """Hits of rays, moved from the back of a triangle to the front of its partner."""
        pi = mi.PreliminaryIntersection3f(pi)
        number = self.number.at(pi.shape, pi.prim_index, active & pi.is_valid())
        in_sheet, here = number > 0, dr.maximum(number, 1) - 1
        k, end = (dr.gather(mi.UInt32, self.first, here + one, in_sheet) for one in (0, 1))
        best, uv, partner = mi.Float(BESIDE), mi.Point2f(0), mi.UInt32(here)
        searching = in_sheet & (dr.dot(self.corner(here, in_sheet)[3], ray.d) > 0)
        while dr.hint(searching & (k < end), label="sheets"):
            there = dr.gather(mi.UInt32, self.partner, k)
            corner, a, b, n = self.corner(there, searching)
            # Coordinates of the point at which the ray passes the plane
            along = ray.o + ray.d * dr.dot(corner - ray.o, n) / dr.dot(ray.d, n) - corner
            area = dr.dot(dr.cross(a, b), n)
            u, v = dr.dot(dr.cross(along, b), n) / area, dr.dot(dr.cross(a, along), n) / area
            least = dr.minimum(dr.minimum(u, v), 1 - u - v)
            is_better = least > best
            best, partner = dr.select(is_better, least, best), dr.select(is_better, there, partner)
            uv = dr.select(is_better, mi.Point2f(u, v), uv)
            k += 1
        found = best > BESIDE
        shape = dr.gather(mi.UInt32, self.shape, partner, found)
        pi.shape = dr.select(found, dr.reinterpret_array(mi.ShapePtr, shape), pi.shape)
        primitive = dr.gather(mi.UInt32, self.primitive, partner, found)
        pi.prim_index = dr.select(found, primitive, pi.prim_index)
        pi.prim_uv = dr.select(found, uv, pi.prim_uv)
        return pi

    def corner(self, triangle, active) -> tuple:
        """Corner of a triangle, its two sides and its normal."""
        rows = [dr.gather(mi.Vector4f, self.rows, 3 * triangle + k, active) for k in range(3)]
        corner, a, b = (mi.Vector3f(row.xyz) for row in rows)
        return corner, a, b, mi.Vector3f(*(row.w for row in rows))


def nearest_hit(scene, sheets: Sheets | None, ray, coherent=False, active=True):
    """What rays hit first, as Mitsuba's `ray_intersect_preliminary`."""
    pi = scene.ray_intersect_preliminary(ray, coherent=coherent, active=active)
    return pi if sheets is None else sheets.front(pi, ray, active)


def is_one_sided(shape) -> bool:
    """Whether a shape consists of triangles whose backs neither emit nor reflect."""
    front, back = (bool(shape.bsdf().flags() & int(side)) for _, side in SIDES)
    return shape.is_mesh() and front and not back


def sheets_of(shapes: list) -> Sheets | None:
    """The sheets of one-sided shapes of triangles; None if there are none."""
    if not shapes:
        return None
    meshes = list(map(corners_of, shapes))
    counts, corners = [len(mesh) for mesh in meshes], np.concatenate(meshes).astype(float)
    turn = np.repeat([-1.0 if shape.has_flipped_normals() else 1.0 for shape in shapes], counts)
    pairs = back_to_back(corners, turn)
    if not len(pairs):
        return None
    (here, there), ids = pairs.T, [pointer_id(mi.ShapePtr(shape)) for shape in shapes]
    used, partner = np.unique(there, return_inverse=True)  # each triangle is a partner
    number, starts = np.zeros(len(corners), np.int64), np.cumsum([0, *counts])
    number[used] = 1 + np.arange(len(used))
    rows = np.zeros((len(used), 3, 4))
    rows[..., :3] = corners[used]
    rows[:, 1:, :3] -= rows[:, :1, :3]
    rows[..., 3] = unit_normals(corners[used]) * turn[used, None]
    first = np.searchsorted(here, np.append(used, len(corners)))
    primitive = (np.arange(len(corners)) - np.repeat(starts[:-1], counts))[used]
    shape = np.repeat(ids, counts)[used]
    arrays = [mi.UInt32(part.astype(np.uint32)) for part in (first, partner, shape, primitive)]
    first, partner, shape, primitive, rows = own_memory([*arrays, mi.Float(rows.ravel())])
    table = PrimitiveTable(ids, np.split(number, starts[1:-1]), 0)
    return Sheets(table, first, partner, rows, shape, primitive)


def back_to_back(corners: np.ndarray, turn: np.ndarray) -> np.ndarray:
    """Pairs of triangles (n, 3, 3) that overlap in one plane and face away from each other, (P, 2).

    Each pair is given in both orders, by rising first numbers. turn: 1, or -1 for a triangle that
    faces where its corners are clockwise, (n,).
    """
    normals, middle = unit_normals(corners) * turn[:, None], corners.mean(axis=1)
    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    # Most triangles have no plane that others face the other way. Heights over a point beside the
    # scene, which is no point of symmetry, tell so at once.
    height = np.einsum("tk,tk->t", normals, middle - low + [0.31, 0.53, 0.71] * (high - low))
    below = np.sort(-height)
    near = NEAR * np.linalg.norm(high - low)
    ends = (np.searchsorted(below, height + shift) for shift in (-near, near))
    some = np.flatnonzero(np.subtract(*ends) != 0)
    turned = np.where(turn[some, None, None] < 0, corners[some][:, [0, 2, 1]], corners[some])
    pairs = some[overlaps(turned).back_to_back]
    pairs = np.concatenate([pairs, pairs[:, ::-1]])
    a, b = pairs.T
    # Facets that face each other across a gap are none, unless it is one of rounding
    gap = np.einsum("pk,pk->p", middle[b] - middle[a], normals[a])
    pairs = pairs[gap <= 8 * SINGLE * abs(corners[a]).max(axis=(1, 2))]
    return pairs[np.lexsort(pairs.T[::-1])]

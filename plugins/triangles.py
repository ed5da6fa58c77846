"""Emitting facets as one table to draw from: which facet, and where on it."""

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.plugins.derivatives import members

ABSENT = 0xFFFFFFFF


def pointer_id(pointer) -> int:
    """The number by which Dr.Jit's pointers refer to an object."""
    return int(dr.reinterpret_array(mi.UInt32, pointer)[0])


def is_faceted(shape) -> bool:
    """Whether a shape consists of triangles; Mitsuba's `rectangle` calls itself a mesh but has
    none.
    """
    return "vertex_positions" in members(shape)


class Facets:
    """The triangles of some meshes, drawn with a probability proportional to area times a weight.

    meshes: list of Mitsuba meshes. weights: per mesh None (area alone) or an array, width 1 or one
    value per face. Facets are numbered through over all meshes, in their order.
    """

    def __init__(self, meshes, weights=None):
        corners, first = [], {}
        for mesh in meshes:
            first[pointer_id(mi.ShapePtr(mesh))] = sum(len(p) for p, _, _ in corners)
            buffers = members(mesh)
            vertices, faces = (
                buffers[name].numpy().reshape(-1, 3) for name in ("vertex_positions", "faces")
            )
            corners.append(tuple(vertices[faces[:, corner]] for corner in range(3)))
        p0, p1, p2 = (np.concatenate(points).astype(np.float64) for points in zip(*corners))
        flips = [
            np.full(len(p), -1.0 if mesh.has_flipped_normals() else 1.0)
            for mesh, (p, _, _) in zip(meshes, corners)
        ]
        normal = np.cross(p1 - p0, p2 - p0) * np.concatenate(flips)[:, None]
        area = 0.5 * np.linalg.norm(normal, axis=1)
        importance = area.copy()
        if weights is not None:
            importance *= np.concatenate(
                [np.broadcast_to(w, len(p)) for w, (p, _, _) in zip(weights, corners)]
            )
        self.first = mi.UInt32(
            np.array([first.get(k, ABSENT) for k in range(max(first) + 1)], dtype=np.uint32)
        )
        self.corner, self.edge_1, self.edge_2 = (
            mi.Point3f(p0.T),
            mi.Vector3f((p1 - p0).T),
            mi.Vector3f((p2 - p0).T),
        )
        self.normal = mi.Normal3f(
            (normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)).T
        )
        self.density = mi.Float(
            np.divide(importance / importance.sum(), area, out=np.zeros_like(area), where=area > 0)
        )
        self.cumulated = mi.Float(np.cumsum(importance / importance.sum()))

    def sample(self, sample, active=True):
        """(facet, barycentric coordinates, point, normal, density [1/m^2]) for a uniform 2D sample."""
        last = dr.width(self.cumulated) - 1
        facet = dr.binary_search(
            0, last, lambda k: dr.gather(mi.Float, self.cumulated, k, active) <= sample.x
        )
        gather = lambda kind, table: dr.gather(kind, table, facet, active)
        above = gather(mi.Float, self.cumulated)
        below = dr.select(
            facet > 0, dr.gather(mi.Float, self.cumulated, dr.maximum(facet, 1) - 1, active), 0
        )
        x = dr.clip(
            (sample.x - below) / dr.maximum(above - below, 1e-30), 0, dr.one_minus_epsilon(mi.Float)
        )
        uv = mi.warp.square_to_uniform_triangle(mi.Point2f(x, sample.y))
        point = (
            gather(mi.Point3f, self.corner)
            + uv.x * gather(mi.Vector3f, self.edge_1)
            + uv.y * gather(mi.Vector3f, self.edge_2)
        )
        return facet, uv, point, gather(mi.Normal3f, self.normal), gather(mi.Float, self.density)

    def find(self, shape, prim_index, active=True):
        """The facet's number and whether the primitive is in the table at all."""
        key = dr.reinterpret_array(mi.UInt32, shape)
        known = active & (key < dr.width(self.first))
        first = dr.gather(mi.UInt32, self.first, key, known)
        known &= first != ABSENT
        return dr.select(known, first + prim_index, 0), known

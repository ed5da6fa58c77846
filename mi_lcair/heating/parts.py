"""Parts of facets, from which points of a facet are drawn, and which shapes are closed."""

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np
from scipy import sparse

from mi_lcair.models3d.coincident import unique_rows
from mi_lcair.plugins.derivatives import own_memory
from mi_lcair.plugins.emission.triangles import normal_of, pointer_id, sphere_of
from mi_lcair.rendering.facets.table import FacetTable

ROUND = ("Sphere", "Ellipsoids")  # shapes without triangles that are closed


@dataclass
class Parts:
    """Parts of the facets on which paths begin: triangles, or whole shapes that are no meshes.

    facet: index of each part's facet; it rises. until: share of the facet's area in its parts up to
    this one. shape, primitive, is_triangle: of each part. sphere: centre of a part that is a
    sphere, and 1 or, with flipped normals, -1; 0 for other parts.
    """

    facet: mi.UInt32
    until: mi.Float
    shape: mi.UInt32
    primitive: mi.UInt32
    is_triangle: mi.Bool
    sphere: mi.Vector4f

    @staticmethod
    def of(table: FacetTable, numbers: np.ndarray, shapes: list) -> "Parts":
        """The parts of the facets with these numbers, which rise."""
        shape = table.shape_index[table.triangle_facet]
        primitive = np.arange(len(shape)) - np.searchsorted(shape, shape)
        p0, p1, p2 = np.moveaxis(table.triangles, 1, 0)
        area = np.linalg.norm(np.cross(p1 - p0, p2 - p0), axis=1)
        whole = numbers[~np.isin(numbers, table.triangle_facet)]
        facet = np.concatenate([table.triangle_facet, whole])
        area = np.concatenate([area, np.ones(len(whole))])
        primitive = np.concatenate([primitive, np.zeros(len(whole), int)])
        of_facet = np.argsort(facet, kind="stable")
        of_facet = of_facet[np.isin(facet[of_facet], numbers)]
        index = np.searchsorted(numbers, facet[of_facet])
        share = area[of_facet] / np.bincount(index, area[of_facet])[index]
        of_part = table.shape_index[facet[of_facet]]
        ids = np.array([pointer_id(mi.ShapePtr(shape)) for shape in shapes])
        arrays = [
            mi.UInt32(index.astype(np.uint32)),
            mi.Float(np.cumsum(share) - index),  # the shares of a facet add up to 1
            mi.UInt32(ids[of_part].astype(np.uint32)),
            mi.UInt32(primitive[of_facet].astype(np.uint32)),
        ]
        own_memory(arrays)
        sphere = mi.Vector4f(np.array([sphere_of(shape) for shape in shapes])[of_part].T)
        return Parts(*arrays, mi.Bool(of_facet < len(table.triangle_facet)), sphere)

    def point(self, facet: mi.UInt32, u: mi.Float, sample: mi.Point2f) -> mi.SurfaceInteraction3f:
        """Uniform points of facets; `wi` is not set."""

        def is_before(k):
            part = dr.gather(Parts, self, k)
            return (part.facet < facet) | ((part.facet == facet) & (part.until < u))

        last = dr.width(self.facet) - 1
        part = dr.gather(Parts, self, dr.binary_search(0, last, is_before))
        pi = dr.zeros(mi.PreliminaryIntersection3f, dr.width(facet))
        pi.shape = shape = dr.reinterpret_array(mi.ShapePtr, part.shape)
        pi.prim_index, pi.prim_uv = part.primitive, mi.warp.square_to_uniform_triangle(sample)
        si = shape.compute_surface_interaction(
            dr.zeros(mi.Ray3f), pi, mi.RayFlags.All, part.is_triangle
        )
        ps = shape.sample_position(0, sample, ~part.is_triangle)
        n = normal_of(ps, part.sphere)
        whole = dr.zeros(mi.SurfaceInteraction3f, dr.width(facet))
        whole.p, whole.n, whole.uv, whole.sh_frame = ps.p, n, ps.uv, mi.Frame3f(n)
        si = dr.select(part.is_triangle, si, whole)
        si.sh_frame = mi.Frame3f(si.sh_frame.n)  # Mitsuba leaves out the tangents of a triangle
        si.shape, si.prim_index, si.t = shape, part.primitive, mi.Float(0)
        return si


def closed_shapes(table: FacetTable, shapes: list, one_sided: np.ndarray) -> np.ndarray:
    """Whether each shape is part of a closed surface, (shapes,).

    A closed surface has a triangle on both sides of each edge, which run through the edge in
    opposite directions. one_sided: whether each shape is; only these are put together.
    """
    shape = table.shape_index[table.triangle_facet]
    closed = np.array([shape.class_name() in ROUND for shape in shapes])
    closed[np.unique(shape)] = True
    used = one_sided[shape]
    if used.any():
        owner = np.repeat(shape[used], 3)
        _, corner = unique_rows(table.triangles[used].reshape(-1, 3))
        start, end = corner, np.roll(corner.reshape(-1, 3), -1, axis=1).ravel()
        edges = sparse.csr_array((np.ones(len(start)), (start, end)))
        surplus = (edges - edges.T)[start, end]
        closed[owner[surplus != 0]] = False
    return closed

"""Parts of facets: triangles or whole shapes, from which points of a facet are drawn."""

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.plugins.derivatives import own_memory
from mi_lcair.plugins.emission.triangles import pointer_id
from mi_lcair.rendering.facets.table import FacetTable


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
            of_part = dr.gather(mi.UInt32, self.facet, k)
            until = dr.gather(mi.Float, self.until, k)
            return (of_part < facet) | ((of_part == facet) & (until < u))

        part = dr.binary_search(0, dr.width(self.facet) - 1, is_before)
        shape = dr.reinterpret_array(mi.ShapePtr, dr.gather(mi.UInt32, self.shape, part))
        is_triangle = dr.gather(mi.Bool, self.is_triangle, part)
        pi = dr.zeros(mi.PreliminaryIntersection3f, dr.width(facet))
        pi.prim_index = dr.gather(mi.UInt32, self.primitive, part)
        pi.prim_uv, pi.shape = mi.warp.square_to_uniform_triangle(sample), shape
        si = shape.compute_surface_interaction(dr.zeros(mi.Ray3f), pi, mi.RayFlags.All, is_triangle)
        ps = shape.sample_position(0, sample, ~is_triangle)
        # Mitsuba 3.9 leaves out the turn of a sphere from its normals
        sphere = dr.gather(mi.Vector4f, self.sphere, part)
        outward = dr.normalize(ps.p - mi.Point3f(sphere.xyz)) * sphere.w
        ps.n = dr.select(sphere.w == 0, ps.n, mi.Normal3f(outward))
        si.p = dr.select(is_triangle, si.p, ps.p)
        si.n = dr.select(is_triangle, si.n, ps.n)
        si.uv = dr.select(is_triangle, si.uv, ps.uv)
        si.sh_frame = mi.Frame3f(dr.select(is_triangle, si.sh_frame.n, ps.n))
        si.shape, si.prim_index, si.t = shape, pi.prim_index, mi.Float(0)
        return si


def sphere_of(shape) -> tuple[float, ...]:
    """Centre of a sphere, and 1 or, with flipped normals, -1; zeros for another shape."""
    if shape.class_name() != "Sphere":
        return 0.0, 0.0, 0.0, 0.0
    return *np.array(shape.bbox().center()), -1.0 if shape.has_flipped_normals() else 1.0

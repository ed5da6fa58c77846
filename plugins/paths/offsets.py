"""How far from a surface a ray starts, so that it does not hit the surface itself."""

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.plugins.emission.triangles import is_faceted, pointer_id, triangle_corners
from mi_lcair.plugins.paths.rounding import UNIT

# Distances in roundings: of the coordinates of a hit, which follow from those of three corners, and
# of lengths along the surface, which enter the distance of the next hit.
OF_POSITION, OF_SIZE = 3, 64


class Offsets:
    """Offsets of the starts of rays from the surfaces of a scene.

    of_size: part of the offset that depends on the size of a shape's triangles, by the pointer to
    the shape [m].
    """

    def __init__(self, scene):
        shapes = list(scene.shapes())
        ids = [pointer_id(mi.ShapePtr(shape)) for shape in shapes]
        of_size = np.zeros(max(ids, default=0) + 1)
        of_size[ids] = [OF_SIZE * UNIT * extent(shape) for shape in shapes]
        self.of_size = mi.Float(of_size)
        dr.make_opaque(self.of_size)

    def at(self, si) -> mi.Float:
        """Offset at a hit [m]."""
        of_size = dr.gather(mi.Float, self.of_size, dr.reinterpret_array(mi.UInt32, si.shape))
        return OF_POSITION * UNIT * dr.max(dr.abs(si.p)) + of_size

    def leave(self, si, d) -> mi.Point3f:
        """Start of a ray from the hit `si` in the direction `d`, just off the surface [m].

        Mitsuba's offset, (1 + |p|) 9e-5 m, is too large for a small part. Float32 needs an offset
        of only a few rounding errors of the coordinates and of the triangle. The start of a
        reflected ray is also moved toward the observer by the same distance. A hit on the edge
        between two walls lies on both walls, and the offset from one wall would leave the start on
        the other.
        """
        mitsuba = (1 + dr.max(dr.abs(si.p))) * mi.math.RayEpsilon
        offset = dr.minimum(mitsuba, self.at(si))
        cos = dr.dot(si.n, d)
        observer = si.to_world(si.wi)
        back = dr.select(cos * dr.dot(si.n, observer) > 0, dr.minimum(offset, 0.5 * si.t), 0)
        return dr.fma(observer, back, dr.fma(si.n, dr.mulsign(offset, cos), si.p))


def extent(shape) -> float:
    """Longest side of a shape's triangles, or the diagonal of another shape's box [m]."""
    if not is_faceted(shape):
        box = shape.bbox()
        return float(np.linalg.norm(np.array(box.max) - np.array(box.min)))
    a, b, c = triangle_corners(shape)
    return max(
        float(np.linalg.norm(p - q, axis=1).max(initial=0.0)) for p, q in ((a, b), (b, c), (c, a))
    )

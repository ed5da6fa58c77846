"""Rounding in Float32: where a ray starts beside a surface, and the error of a radiance.

A ray starts so far from a surface that it does not hit the surface itself. More samples do not
reduce the error of a radiance.
"""

from math import sqrt

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.plugins.emission.triangles import is_faceted, pointer_id, triangle_corners

UNIT = 2.0**-24  # the largest relative error of one rounding
OPERATIONS = 8  # roundings at each reflection of a path: in weights, in products and in a sum
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
    """Longest side of a shape's triangles, or a part of the diagonal of another shape's box [m].

    A hit on a sphere is computed from its radius, and has a smaller error than one on a triangle.
    An offset that is larger by d lets the part 2 d / radius of its rays, which graze it, pass by.
    """
    if not is_faceted(shape):
        box, part = shape.bbox(), 16 if shape.class_name() == "Sphere" else 4
        return float(np.linalg.norm(np.array(box.max) - np.array(box.min))) / part
    a, b, c = triangle_corners(shape)
    return max(
        float(np.linalg.norm(p - q, axis=1).max(initial=0.0)) for p, q in ((a, b), (b, c), (c, a))
    )


def rounding_error(reflections: int) -> float:
    """Relative rms error of a radiance after this number of reflections.

    The error of each rounding is assumed to be uniform up to UNIT and independent of the others. In
    an isothermal room all paths are alike and round in the same way. The mean over many paths then
    has the same error as one path.
    """
    return UNIT * sqrt(OPERATIONS * (reflections + 1) / 3)

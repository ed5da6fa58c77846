"""Hits that a replay of paths reads, so that it does not trace their rays again."""

import drjit as dr
import mitsuba as mi

from mi_lcair.plugins.paths.sheets import nearest_hit

MOST_BYTES = 2**28  # of the hits that are kept
OF_HIT = 32  # bytes of a hit


class KeptHits:
    """The hits of the first rays of paths, which the pass before a replay writes.

    Memory does not grow with the number of reflections: beyond MOST_BYTES a replay traces again.

    kinds: number of rays of a vertex. rays: number of rays of a path. is_read: whether the hits are
    written already.
    """

    def __init__(self, kinds: int, reflections: int):
        self.kinds, self.rays, self.is_read = kinds, 1 + kinds * reflections, False

    def begin(self, paths: int) -> None:
        """Make room for the hits of a number of paths."""
        self.slots = min(self.rays, MOST_BYTES // (OF_HIT * paths))
        self.lane, self.paths, self.is_read = dr.arange(mi.UInt32, paths), paths, False
        size = 4 * max(self.slots * paths, 1)
        self.numbers, self.places = dr.empty(mi.Float, size), dr.empty(mi.UInt32, size)

    def end(self, state) -> None:
        """Evaluate the hits, and the state of the pass, so that a replay may read them."""
        dr.eval(state, self.numbers, self.places)
        self.is_read = True

    def nearest(self, scene, sheets, ray, slot, goes_on, active, coherent=False):
        """As `nearest_hit`, for a ray of a path with the number `slot`.

        goes_on: the paths that reach the ray's start, the same in both passes. active: those of
        them whose ray is traced.
        """
        kept = goes_on & (slot < self.slots)
        index = slot * self.paths + self.lane
        if not self.is_read:
            pi = nearest_hit(scene, sheets, ray, coherent, active)
            is_valid = dr.select(pi.valid, mi.Float(1), 0)
            pointers = (dr.reinterpret_array(mi.UInt32, p) for p in (pi.shape, pi.instance))
            places = mi.Vector4u(pi.prim_index, pi.shape_index, *pointers)
            dr.scatter(self.numbers, mi.Vector4f(pi.t, *pi.prim_uv, is_valid), index, kept)
            dr.scatter(self.places, places, index, kept)
            return pi
        pi = nearest_hit(scene, sheets, ray, coherent, active & ~kept)
        numbers = dr.gather(mi.Vector4f, self.numbers, index, kept)
        places = dr.gather(mi.Vector4u, self.places, index, kept)
        read = dr.zeros(mi.PreliminaryIntersection3f, dr.width(index))
        read.t, read.prim_uv, read.valid = numbers.x, mi.Point2f(numbers.yz), numbers.w > 0
        read.prim_index, read.shape_index = places.x, places.y
        read.shape = dr.reinterpret_array(mi.ShapePtr, places.z)
        read.instance = dr.reinterpret_array(mi.ShapePtr, places.w)
        return dr.select(kept, read, pi)

"""Hits and drawn directions that a replay of paths reads, and does not find again."""

import drjit as dr
import mitsuba as mi

from mi_lcair.plugins.emission.emitter_table import DrawnDirection
from mi_lcair.plugins.paths.sheets import nearest_hit

MOST_BYTES = 2**28  # of what is kept
OF_HIT, OF_DRAWN = 32, 32  # bytes of each


class KeptHits:
    """The hits of paths that the pass before a replay writes, and the directions that it draws.

    Memory does not grow with the number of reflections: beyond MOST_BYTES a replay traces again.
    Directions are kept where there is room for all of them and for all hits.

    kinds: number of rays of a vertex. rays, drawn_rays: numbers of rays of a path, and of those
    that are drawn. first: hits of the first rays; None where they are not kept. keeps_drawn:
    whether drawn directions are kept. is_read: whether all is written already.
    """

    def __init__(self, kinds: int, reflections: int):
        self.kinds, self.is_read = kinds, False
        self.rays, self.drawn_rays = 1 + kinds * reflections, (kinds - 1) * reflections

    def begin(self, paths: int) -> None:
        """Make room for a number of paths."""
        most = MOST_BYTES // paths  # bytes of a path
        self.slots = min(self.rays, most // OF_HIT)
        self.lane, self.paths, self.is_read = dr.arange(mi.UInt32, paths), paths, False
        of_path = self.rays * OF_HIT + self.drawn_rays * OF_DRAWN
        self.keeps_drawn = self.drawn_rays > 0 and of_path <= most
        drawn_rays = self.drawn_rays * self.keeps_drawn
        hits, drawn = (max(4 * rays * paths, 1) for rays in (self.slots - 1, drawn_rays))
        self.numbers, self.places = dr.empty(mi.Float, hits), dr.empty(mi.UInt32, hits)
        self.to, self.by = dr.empty(mi.Float, drawn), dr.empty(mi.Float, drawn)

    def end(self, state, first) -> None:
        """Evaluate all hits, and the state of the pass, so that a replay may read them.

        first: those of the first rays.
        """
        self.first = first if self.slots else None
        dr.eval(state, self.first, self.numbers, self.places, self.to, self.by)
        self.is_read = True

    def nearest(self, scene, sheets, ray, slot, goes_on, active):
        """As `nearest_hit`, for a ray of a path with the number `slot` after the first ray.

        goes_on: the paths that reach the ray's start, the same in both passes. active: those of
        them whose ray is traced.
        """
        kept = goes_on & (slot + 1 < self.slots)
        index = slot * self.paths + self.lane
        if not self.is_read:
            pi = nearest_hit(scene, sheets, ray, active=active)
            is_valid = dr.select(pi.valid, mi.Float(1), 0)
            pointers = (dr.reinterpret_array(mi.UInt32, p) for p in (pi.shape, pi.instance))
            places = mi.Vector4u(pi.prim_index, pi.shape_index, *pointers)
            dr.scatter(self.numbers, mi.Vector4f(pi.t, *pi.prim_uv, is_valid), index, kept)
            dr.scatter(self.places, places, index, kept)
            return pi
        pi = nearest_hit(scene, sheets, ray, active=active & ~kept)
        numbers = dr.gather(mi.Vector4f, self.numbers, index, kept)
        places = dr.gather(mi.Vector4u, self.places, index, kept)
        read = dr.zeros(mi.PreliminaryIntersection3f, dr.width(index))
        read.t, read.prim_uv, read.valid = numbers.x, mi.Point2f(numbers.yz), numbers.w > 0
        read.prim_index, read.shape_index = places.x, places.y
        read.shape = dr.reinterpret_array(mi.ShapePtr, places.z)
        read.instance = dr.reinterpret_array(mi.ShapePtr, places.w)
        return dr.select(kept, read, pi)

    def drawn(self, draw, number, active) -> DrawnDirection:
        """A drawn panel, from the function `draw`. number: that of the drawn ray of a path."""
        index = number * self.paths + self.lane
        if not self.is_read:
            drawn = draw()
            ds, panel = drawn.ds, dr.reinterpret_array(mi.Float, drawn.index)
            dr.scatter(self.to, mi.Vector4f(*ds.d, ds.dist), index, active)
            dr.scatter(self.by, mi.Vector4f(ds.pdf, drawn.compared, panel, 0), index, active)
            return drawn
        to, by = (dr.gather(mi.Vector4f, rows, index, active) for rows in (self.to, self.by))
        ds = dr.zeros(mi.DirectionSample3f)
        ds.d, ds.dist, ds.pdf = mi.Vector3f(to.xyz), to.w, by.x
        panel = dr.reinterpret_array(mi.UInt32, by.z)
        return DrawnDirection(ds, by.y, panel, None, mi.Bool(True), mi.Float(0))

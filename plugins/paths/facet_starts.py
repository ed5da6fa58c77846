"""Starts on facets: paths that begin where the sensor sees a drawn point of a facet.

They follow the facets when these move. Two poses of a scene with the same random numbers are then
compared point by point, and hardly any noise is left in their difference.
"""

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.plugins.derivatives import own_memory
from mi_lcair.plugins.emission.triangles import Choice, pointer_id, triangle_vertices
from mi_lcair.plugins.recorders.recorder import Recorder


@dataclass
class FacetTable:
    """The triangles on which paths may begin, as Dr.Jit arrays.

    ends: those of `Choice`, with a row for each window. outline: corner of each triangle and its
    two sides in each window, in parts of the window. weight: weight of each triangle's paths in
    each window. shape, primitive: the triangle. windows: number of windows that have tables of
    their own; if it is 1, all share one. count: number of triangles.
    """

    ends: mi.UInt32
    outline: mi.Float
    weight: mi.Float
    shape: mi.UInt32
    primitive: mi.UInt32
    windows: mi.UInt32
    count: int

    def place(
        self, sample: mi.Point2f, window: mi.UInt32
    ) -> tuple[mi.Point2f, mi.Float, "OnFacet"]:
        """A position in a window, the weight of its path, and what its first hit must be."""
        first = (window % self.windows) * self.count
        choice = Choice.of_ends(self.ends, self.count)
        index, sample = choice.pick_and_rest(sample, first=first)
        uv = mi.warp.square_to_uniform_triangle(sample)
        corner, right, up = (
            dr.gather(mi.Point2f, self.outline, 3 * (first + index) + row) for row in range(3)
        )
        position = corner + uv.x * right + uv.y * up
        inside = dr.all((position >= 0) & (position < 1))
        weight = dr.select(inside, dr.gather(mi.Float, self.weight, first + index), 0)
        shape, primitive = (
            dr.gather(mi.UInt32, numbers, index) for numbers in (self.shape, self.primitive)
        )
        return position, weight, OnFacet(shape, primitive, mi.Bool(False))


@dataclass
class OnFacet(Recorder):
    """Follows the paths whose first hit is the triangle on which they began.

    shape: number of the pointer to its shape. counts: whether a path is one of them.
    """

    shape: mi.UInt32
    primitive: mi.UInt32
    counts: mi.Bool

    def begin(self, first, ray, active) -> mi.Bool:
        same = dr.reinterpret_array(mi.UInt32, first.shape) == self.shape
        self.counts = active & first.is_valid() & same & (first.prim_index == self.primitive)
        return mi.Bool(self.counts)


@dataclass(frozen=True)
class FacetStarts:
    """A density of starts over the facets of a scene in one pose; in place of an `Aim`.

    tables: for `Paths`. largest_weight, largest_on_model: largest weight of a path of each window,
    (windows,), or (1,) if all have the same density. largest_direct: the largest of weight times
    radiance that is seen without a reflection, the same shape [W m^-2 sr^-1]. every: beside other
    paths, the number of these for each that begins on a facet. direct: see `Aim`.
    """

    tables: FacetTable
    largest_weight: np.ndarray
    largest_on_model: np.ndarray
    largest_direct: np.ndarray
    every: int = 1
    direct: "FacetStarts | None" = None

    @staticmethod
    def at(meshes, outlines, area, choice: Choice, direct=0.0) -> "FacetStarts":
        """Starts on the n triangles of meshes.

        Parameters
        ----------
        meshes : list of mi.Shape
        outlines : ndarray, shape (..., n, 3, 2)
            Corners of the triangles in parts of the window, or of each window.
        area : ndarray, shape (..., n)
            Their visible areas in parts of the window's area.
        choice : Choice
            Draws a triangle; with a row for each window.
        direct : ndarray, shape (n,), or float
            Upper bound of their radiance without reflections [W m^-2 sr^-1].
        """
        counts = [len(triangle_vertices(mesh)) for mesh in meshes]
        ids = [pointer_id(mi.ShapePtr(mesh)) for mesh in meshes]
        sides = np.array(outlines, dtype=np.float32)
        sides[..., 1:, :] = outlines[..., 1:, :] - outlines[..., :1, :]
        drawn = choice.probability > 0
        weight = np.divide(area, choice.probability, out=np.zeros_like(area), where=drawn)
        weight = np.atleast_2d(weight)
        table = FacetTable(
            mi.UInt32(choice.ends),
            mi.Float(sides.ravel()),
            mi.Float(weight.ravel()),
            mi.UInt32(np.repeat(ids, counts).astype(np.uint32)),
            mi.UInt32(np.concatenate([np.arange(n) for n in counts]).astype(np.uint32)),
            dr.opaque(mi.UInt32, len(weight)),
            choice.count,
        )
        own_memory([table.outline, table.weight, table.shape, table.primitive])
        largest = weight.max(axis=1)
        return FacetStarts(table, largest, largest, (weight * direct).max(axis=1))

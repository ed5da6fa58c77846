"""Starts on facets: paths that begin where the sensor sees a drawn point of a facet.

They follow the facets when these move. Two poses of a scene with the same random numbers are then
compared point by point, and hardly any noise is left in their difference.
"""

from dataclasses import dataclass
from typing import ClassVar

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.plugins.derivatives import own_memory
from mi_lcair.plugins.emission.triangles import Choice, pointer_id
from mi_lcair.plugins.recorders.recorder import Recorder


@dataclass
class FacetTable:
    """The triangles on which paths may begin, as Dr.Jit arrays.

    choice: ends of `Choice`. outline: corner of each triangle and its two sides in the window, in
    parts of the window. weight: weight of each triangle's paths. shape, primitive: the triangle.
    """

    ends: mi.UInt32
    outline: mi.Float
    weight: mi.Float
    shape: mi.UInt32
    primitive: mi.UInt32

    def place(self, sample: mi.Point2f) -> tuple[mi.Point2f, mi.Float, "OnFacet"]:
        """A position in the window, the weight of its path, and what its first hit must be."""
        index, sample = Choice.of_ends(self.ends).pick_and_rest(sample)
        uv = mi.warp.square_to_uniform_triangle(sample)
        corner, right, up = (
            dr.gather(mi.Point2f, self.outline, 3 * index + row) for row in range(3)
        )
        position = corner + uv.x * right + uv.y * up
        inside = dr.all((position >= 0) & (position < 1))
        weight = dr.select(inside, dr.gather(mi.Float, self.weight, index), 0)
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

    tables: for `Paths`. largest_weight, largest_on_model: largest weight of a path. largest_direct:
    the largest of weight times radiance that is seen without a reflection [W m^-2 sr^-1].
    """

    tables: FacetTable
    largest_weight: float
    largest_on_model: float
    largest_direct: float

    direct: ClassVar[None] = None  # see `Aim`: all of these paths bring everything

    @staticmethod
    def at(meshes, outlines, area, choice: Choice, direct=0.0) -> "FacetStarts":
        """Starts on the triangles of meshes.

        Parameters
        ----------
        meshes : list of mi.Shape
        outlines : list of ndarray, shape (n, 3, 2)
            Corners of the triangles of each mesh in parts of the window, Float64.
        area : ndarray, shape (n,)
            Visible area of all triangles in parts of the window's area.
        choice : Choice
            Draws one of all triangles.
        direct : ndarray, shape (n,), or float
            Upper bound of their radiance without reflections [W m^-2 sr^-1].
        """
        counts = [len(outline) for outline in outlines]
        ids = [pointer_id(mi.ShapePtr(mesh)) for mesh in meshes]
        corners = np.concatenate(outlines)
        sides = corners[:, 1:] - corners[:, :1]
        drawn = choice.probability > 0
        weight = np.divide(area, choice.probability, out=np.zeros_like(area), where=drawn)
        table = FacetTable(
            mi.UInt32(choice.ends),
            mi.Float(np.concatenate([corners[:, :1], sides], axis=1).ravel()),
            mi.Float(weight),
            mi.UInt32(np.repeat(ids, counts).astype(np.uint32)),
            mi.UInt32(np.concatenate([np.arange(n) for n in counts]).astype(np.uint32)),
        )
        own_memory([table.outline, table.weight, table.shape, table.primitive])
        largest = float(weight.max())
        return FacetStarts(table, largest, largest, float((weight * direct).max()))

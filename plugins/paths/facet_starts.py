"""Starts on facets: paths that begin where the sensor sees a drawn point of a facet.

They follow the facets when these move. Two poses of a scene with the same random numbers are then
compared point by point, and hardly any noise is left in their difference.
"""

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.plugins.derivatives import own_memory
from mi_lcair.plugins.emission.triangles import Choice, point_on, pointer_id, triangle_vertices


@dataclass
class FacetTable:
    """The triangles on which paths may begin, as Dr.Jit arrays.

    ends: those of `Choice`, with a row for each window. rows: corner of each triangle and its two
    sides, as those of `TriangleTable` [m]. extent: diagonal of the box around all [m]. weight:
    weight of each triangle's paths in each window. shape, primitive: the triangle. windows: number
    of windows that have tables of their own; if it is 1, all share one. count: number of triangles.
    """

    ends: mi.UInt32
    rows: mi.Float
    extent: mi.Float
    weight: mi.Float
    shape: mi.UInt32
    primitive: mi.UInt32
    windows: mi.UInt32
    count: int

    def place(self, sample: mi.Point2f, window: mi.UInt32) -> tuple[mi.Float, "FacetPoint"]:
        """The weight of a path in a window, and the point that it has to hit first."""
        first = (window % self.windows) * self.count
        choice = Choice.of_ends(self.ends, self.count)
        index, sample = choice.pick_and_rest(sample, first=first)
        _, p, _ = point_on(self.rows, index, sample)
        shape, primitive = (
            dr.gather(mi.UInt32, numbers, index) for numbers in (self.shape, self.primitive)
        )
        weight = dr.gather(mi.Float, self.weight, first + index)
        return weight, FacetPoint(p, shape, primitive, self.extent)


@dataclass
class FacetPoint:
    """The point of a triangle on which a path begins.

    p: the point [m]. shape: number of the pointer to its shape. primitive: the triangle. extent:
    see `FacetTable`.
    """

    p: mi.Point3f
    shape: mi.UInt32
    primitive: mi.UInt32
    extent: mi.Float

    def first_hit(self, scene, ray) -> tuple[mi.PreliminaryIntersection3f, mi.Bool]:
        """What a sensor's ray toward the point hits first, and whether that is the triangle.

        The start of the ray is known to a rounding of its coordinates, which may be more than the
        facet of a distant sensor is wide. The ray is therefore traced from the near side of the
        model, and another one from there back to the sensor.
        """
        distance = dr.dot(self.p - ray.o, ray.d)
        near = dr.minimum(distance, self.extent)
        start, before = self.p - near * ray.d, distance - near
        hit = scene.ray_intersect_preliminary(
            mi.Ray3f(start, ray.d, ray.maxt - before, 0, []), coherent=False
        )
        hidden = scene.ray_test(mi.Ray3f(start, -ray.d, before, 0, []), before > 0)
        same = dr.reinterpret_array(mi.UInt32, hit.shape) == self.shape
        same &= hit.is_valid() & (hit.prim_index == self.primitive)
        hit.t += before
        return hit, same & ~hidden


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
    def at(meshes, corners, area, choice: Choice, direct=0.0) -> "FacetStarts":
        """Starts on the n triangles of meshes.

        Parameters
        ----------
        meshes : list of mi.Shape
        corners : ndarray, shape (n, 3, 3)
            Corners of the triangles [m].
        area : ndarray, shape (..., n)
            Their visible areas in parts of the window's area.
        choice : Choice
            Draws a triangle; with a row for each window.
        direct : ndarray, shape (n,), or float
            Upper bound of their radiance without reflections [W m^-2 sr^-1].
        """
        counts = [len(triangle_vertices(mesh)) for mesh in meshes]
        ids = [pointer_id(mi.ShapePtr(mesh)) for mesh in meshes]
        rows = np.zeros((choice.count, 3, 4))
        rows[..., :3] = corners
        rows[:, 1:] -= rows[:, :1]
        extent = float(np.linalg.norm(np.ptp(corners.reshape(-1, 3), axis=0)))
        drawn = choice.probability > 0
        weight = np.divide(area, choice.probability, out=np.zeros_like(area), where=drawn)
        weight = np.atleast_2d(weight)
        table = FacetTable(
            mi.UInt32(choice.ends),
            mi.Float(rows.ravel()),
            dr.opaque(mi.Float, extent),
            mi.Float(weight.ravel()),
            mi.UInt32(np.repeat(ids, counts).astype(np.uint32)),
            mi.UInt32(np.concatenate([np.arange(n) for n in counts]).astype(np.uint32)),
            dr.opaque(mi.UInt32, len(weight)),
            choice.count,
        )
        own_memory([table.rows, table.weight, table.shape, table.primitive])
        largest = weight.max(axis=1)
        return FacetStarts(table, largest, largest, (weight * direct).max(axis=1))

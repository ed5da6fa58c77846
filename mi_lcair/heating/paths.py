"""Paths that begin on facets, and what they meet.

A path begins at a point of a facet, on one of its sides, in a direction drawn by the cosine. It is
followed as from an observer, against the direction of the light: of what surface j emits, facet i
absorbs the part of the area

    G_ij = A_i <eps_i(theta) W eps_j(theta')>,

where W is the product of the weights of the reflections between. The mean is over the paths of
facet i, and A_i is the area of its sides.
"""

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np
from scipy import sparse

from mi_lcair.heating.closed import closed_shapes
from mi_lcair.heating.conductors import RINGS_DEG
from mi_lcair.heating.surfaces import Surfaces
from mi_lcair.plugins.derivatives import own_memory
from mi_lcair.plugins.emission.triangles import pointer_id
from mi_lcair.plugins.emitters.thermal_emitter import is_thermal
from mi_lcair.plugins.paths.offsets import Offsets
from mi_lcair.plugins.samplers.lattice import VECTOR, Lattice
from mi_lcair.rendering.facets.table import FacetTable
from mi_lcair.rendering.scene import Scene

LEFT = 1e-6  # throughput at which a path ends
MOST_REFLECTIONS = 10_000
RANDOMISATIONS = 8
CELLS, LANES = 2**24, 2**22  # most numbers that a launch adds up, and most of its paths
RINGS = len(RINGS_DEG) - 1
# Ends of paths, the columns after those of the facets: the rings of the sky, then these. What meets
# the back of a closed surface began inside a body and is buried.
ENDS = ("ground", "truncated", "buried", "backs", "passive")


@dataclass
class Parts:
    """Parts of the facets on which paths begin: triangles, or whole shapes that are no meshes.

    facet: index of each part's facet; it rises. until: share of the facet's area in its parts up to
    this one. shape, primitive, is_triangle: of each part.
    """

    facet: mi.UInt32
    until: mi.Float
    shape: mi.UInt32
    primitive: mi.UInt32
    is_triangle: mi.Bool

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
        total = np.bincount(index, area[of_facet])
        until = np.cumsum(area[of_facet]) - (np.cumsum(total) - total)[index]
        ids = np.array([pointer_id(mi.ShapePtr(shape)) for shape in shapes])
        arrays = [
            mi.UInt32(index.astype(np.uint32)),
            mi.Float(until / total[index]),
            mi.UInt32(ids[table.shape_index[facet[of_facet]]].astype(np.uint32)),
            mi.UInt32(primitive[of_facet].astype(np.uint32)),
        ]
        own_memory(arrays)
        return Parts(*arrays, mi.Bool(of_facet < len(table.triangle_facet)))

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
        si.p = dr.select(is_triangle, si.p, ps.p)
        si.n = dr.select(is_triangle, si.n, ps.n)
        si.uv = dr.select(is_triangle, si.uv, ps.uv)
        si.sh_frame = mi.Frame3f(dr.select(is_triangle, si.sh_frame.n, ps.n))
        si.shape, si.prim_index, si.t = shape, pi.prim_index, mi.Float(0)
        return si


@dataclass(frozen=True, eq=False)
class Means:
    """Means of what the paths of n facets met, for each randomisation.

    between: sparse, (n, n), what the paths of each row's facet met of the others. ends:
    (RANDOMISATIONS, n, rings and ENDS). lost: (shapes,), sums over the facets of the shares that
    ended on the backs of shapes or on shapes that do not emit.
    """

    between: list[sparse.csr_array]
    ends: np.ndarray
    lost: np.ndarray

    @staticmethod
    def of(n: int, facet, run, column, values, lost) -> "Means":
        """The means from the values of entries."""
        is_end, between = column >= n, []
        ends = np.zeros((RANDOMISATIONS, n, RINGS + len(ENDS)))
        ends[run[is_end], facet[is_end], column[is_end] - n] = values[is_end]
        for k in range(RANDOMISATIONS):
            of_run = ~is_end & (run == k)
            places = facet[of_run], column[of_run]
            between.append(sparse.csr_array((values[of_run], places), shape=(n, n)))
        return Means(between, ends, lost)

    def end(self, name: str) -> np.ndarray:
        """The means that ended in one of ENDS, (RANDOMISATIONS, n)."""
        return self.ends[:, :, RINGS + ENDS.index(name)]


class FacetPaths:
    """Traces paths from the facets of a scene that emit.

    Attributes
    ----------
    table : FacetTable
    number : (n,)
        Numbers of the facets that emit, in the table.
    surfaces : Surfaces
    sides : (n,)
        Number of sides of each facet that emit.
    """

    def __init__(self, scene: Scene, surfaces: Surfaces):
        self.scene, self.surfaces, self.table = scene, surfaces, FacetTable(scene)
        self.shapes = list(scene.mi.shapes())
        table = self.table
        emits = np.array([is_thermal(shape.emitter()) for shape in self.shapes])
        exists = table.shape_index >= 0
        self.number = np.flatnonzero(
            exists & (table.type != "sky") & emits[table.shape_index] & (table.area > 0)
        )
        self.parts = Parts.of(table, self.number, self.shapes)
        self.offsets = Offsets(scene.mi)
        of_shape = np.array(surfaces.of_shape)
        of_facet = of_shape[table.shape_index[self.number]]
        flags = [int(surface.bsdf.flags()) for surface in surfaces.different]
        sides = [surface.sides for surface in surfaces.different]
        self.sides = np.array([len(s) for s in sides])[of_facet]
        n = len(self.number)
        column = np.full(table.count, n + RINGS + ENDS.index("passive"))
        column[table.type == "sky"] = n
        column[self.number] = np.arange(n)
        ids = [pointer_id(mi.ShapePtr(shape)) for shape in self.shapes]
        by_pointer = np.zeros((4, max(ids) + 1), dtype=np.uint32)
        by_pointer[:3, ids] = np.arange(len(ids)), of_shape, np.array(flags)[of_shape]
        is_one_sided = np.array([len(s) == 1 for s in sides])[of_shape]
        backs = n + RINGS + ENDS.index("backs") - closed_shapes(table, self.shapes, is_one_sided)
        by_pointer[3, ids] = backs
        self.index_of, self.surface_of, self.flags_of, self.back_of = map(mi.UInt32, by_pointer)
        self.column = mi.UInt32(column.astype(np.uint32))
        # The side of a path: in front, or behind for the share of the numbers above
        in_front = np.array([s.count(1) / max(len(s), 1) for s in sides])
        self.in_front = mi.Float(in_front)
        self.vector = mi.UInt32(VECTOR)
        dr.eval(self.index_of, self.surface_of, self.flags_of, self.back_of, self.column)
        dr.eval(self.in_front)

    @property
    def columns(self) -> int:
        """Number of columns of what paths meet: facets, rings of the sky, and ENDS."""
        return len(self.number) + RINGS + len(ENDS)

    def respond(self, si, numbers, active):
        """Direction, weight and emissivity of the surfaces at hits, seen along `si.wi`."""

        def of(surface):
            def respond(si, u, v, active):
                bs, weight = surface.bsdf.sample(mi.BSDFContext(), si, u, v, active)
                return bs.wo, weight[0], surface.emissivity.eval(surface.bsdf, si, active)

            return respond

        targets = [of(surface) for surface in self.surfaces.different]
        if len(targets) == 1:
            return targets[0](si, *numbers, active)
        return dr.switch(self.at(self.surface_of, si), targets, si, *numbers, active)

    def emissivity(self, si, active):
        """Emissivity of the surfaces at points, toward `si.wi`."""
        targets = [
            lambda si, active, s=surface: mi.Float(s.emissivity.eval(s.bsdf, si, active))
            for surface in self.surfaces.different
        ]
        if len(targets) == 1:
            return targets[0](si, active)
        return dr.switch(self.at(self.surface_of, si), targets, si, active)

    def at(self, table: mi.UInt32, si, active=True) -> mi.UInt32:
        """The number of each hit's shape in a table by the pointer to it."""
        return dr.gather(mi.UInt32, table, dr.reinterpret_array(mi.UInt32, si.shape), active)

    def start(self, facet: mi.UInt32, sampler: Lattice) -> mi.SurfaceInteraction3f:
        """Points on facets with a direction `wi`, drawn by the cosine on one of the sides."""
        sample, u, v = sampler.next_2d(), sampler.next_1d(), sampler.next_2d()
        si = self.parts.point(facet, u, sample)
        in_front = dr.gather(mi.Float, self.in_front, self.at(self.surface_of, si))
        wi = mi.warp.square_to_cosine_hemisphere(v)
        wi.z = dr.select(sampler.next_1d() < in_front, wi.z, -wi.z)
        si.wi = wi
        return si

    def means(self, points: int, seed: int) -> "Means":
        """What the paths of the facets meet.

        Parameters
        ----------
        points : int
            Paths of each facet in each of the RANDOMISATIONS.
        seed : int

        Returns
        -------
        Means
        """
        n, C, Float64 = len(self.number), self.columns, dr.float64_array_t(mi.Float)
        lost, parts = dr.zeros(mi.Float, len(self.shapes)), []
        step = max(1, min(n, CELLS // (RANDOMISATIONS * C)))
        for first in range(0, n, step):
            facets = min(step, n - first)
            met = dr.zeros(Float64, facets * RANDOMISATIONS * C)
            most = max(1, LANES // (facets * RANDOMISATIONS))
            for point in range(0, points, most):
                self._launch(first, facets, point, min(most, points - point), seed, met, lost)
            # Facets meet few of the others, so that the cells are compressed before they are copied
            cell = dr.compress(met > 0)
            values = dr.gather(Float64, met, cell).numpy()
            parts.append((cell.numpy() + np.int64(first) * RANDOMISATIONS * C, values))
        cells, values = (np.concatenate(column) for column in zip(*parts))
        row, column = np.divmod(cells, C)
        facet, run = np.divmod(row, RANDOMISATIONS)
        lost = lost.numpy() / (points * RANDOMISATIONS)
        return Means.of(n, facet, run, column, values / points, lost)

    def _launch(self, first, facets, point, points, seed, met, lost) -> None:
        """Trace `points` paths from `point` on, of each randomisation of each facet."""
        lane = dr.arange(mi.UInt32, facets * RANDOMISATIONS * points)
        first, points, seed, point = (dr.opaque(mi.UInt32, k) for k in (first, points, seed, point))
        row, number = lane // points, lane % points
        sampler = Lattice.at(first * RANDOMISATIONS + row, point + number, seed, self.vector)
        si = self.start(first + row // RANDOMISATIONS, sampler)
        weight = self.emissivity(si, mi.Bool(True))
        to = si.to_world(si.wi)
        ray = mi.Ray3f(self.offsets.leave(si, to), to)
        self._follow(ray, weight, sampler, row * self.columns, met, lost)
        dr.eval(met, lost)

    @dr.syntax
    def _follow(self, ray, weight, sampler, row, met, lost):
        """Follow paths and add what they meet to the cells from `row` on."""
        n, Float64 = len(self.number), dr.float64_array_t(mi.Float)
        scene, weight, active = self.scene.mi, mi.Float(weight), weight > 0
        reflections = mi.UInt32(0)
        while dr.hint(active, label="exchange"):
            pi = scene.ray_intersect_preliminary(ray, coherent=False, active=active)
            si = pi.compute_surface_interaction(ray, mi.RayFlags.All, active)
            hits = active & si.is_valid()
            facet = self.table.number(si.shape, si.prim_index, hits)
            column = dr.gather(mi.UInt32, self.column, facet, hits)
            # The sky is what escapes, or a shape of that type
            escapes = active & (~hits | (column == n))
            hits &= ~escapes
            to, factor, emissivity = self.respond(si, (sampler.next_1d(), sampler.next_2d()), hits)
            flags = self.at(self.flags_of, si, hits)
            in_front = mi.has_flag(flags, mi.BSDFFlags.FrontSide) & (si.wi.z > 0)
            behind = mi.has_flag(flags, mi.BSDFFlags.BackSide) & (si.wi.z < 0)
            is_back = hits & ~in_front & ~behind
            column = dr.select(is_back, self.at(self.back_of, si, hits), column)
            column = dr.select(escapes, n + self.ring(ray.d), column)
            part = dr.select(hits & ~is_back, weight * emissivity, weight)
            dr.scatter_add(met, Float64(part), row + column, active)
            is_lost = hits & (column >= n + RINGS + ENDS.index("backs"))
            dr.scatter_add(lost, part, self.at(self.index_of, si, hits), is_lost)

            weight *= factor
            reflections += 1
            active = hits & ~is_back & (weight > 0)
            ends = active & ((weight < LEFT) | (reflections >= MOST_REFLECTIONS))
            dr.scatter_add(met, Float64(weight), row + n + RINGS + ENDS.index("truncated"), ends)
            active &= ~ends
            d = si.to_world(to)
            ray = mi.Ray3f(self.offsets.leave(si, d), d)

    def ring(self, d) -> mi.UInt32:
        """The ring of the sky in a direction, counted from the horizon; RINGS below it."""
        step = np.radians(RINGS_DEG[1])
        k = dr.minimum(mi.UInt32(dr.asin(dr.clip(d.z, 0, 1)) / step), RINGS - 1)
        return dr.select(d.z < 0, RINGS + ENDS.index("ground"), k)

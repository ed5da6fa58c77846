"""Paths that begin on facets, and what they meet.

A path begins at a point of a facet, on one of its sides, in a direction drawn by the cosine. It is
followed as from an observer, against the direction of the light: of what surface j emits, facet i
absorbs the part of the area

    G_ij = A_i <eps_i(theta) W eps_j(theta')>,

where W is the product of the weights of the reflections between. The mean is over the paths of
facet i, and A_i is the area of its sides.
"""

from dataclasses import dataclass
from functools import partial

import drjit as dr
import mitsuba as mi
import numpy as np
from scipy import sparse

from mi_lcair.errors import InputError
from mi_lcair.heating.closed import closed_shapes
from mi_lcair.heating.conductors import RINGS_DEG
from mi_lcair.heating.parts import Parts
from mi_lcair.heating.surfaces import Surfaces
from mi_lcair.plugins.emission.triangles import pointer_id
from mi_lcair.plugins.emitters.thermal_emitter import is_thermal
from mi_lcair.plugins.paths.offsets import Offsets
from mi_lcair.plugins.samplers.lattice import VECTOR, Lattice
from mi_lcair.rendering.facets.table import FacetTable
from mi_lcair.rendering.limits import check_free
from mi_lcair.rendering.scene import Scene

FAINT = 1e-4  # throughput below which half of the paths end, and the others count twice
MOST_REFLECTIONS = (
    10_000  # bound of the reflections in a closed cavity that absorbs hardly anything
)
RANDOMISATIONS = 8
CELLS, LANES = 2**24, 2**22  # most numbers that a launch adds up, and most of its paths
# Memory for each number that is kept [bytes]: 106 to 143 on a bowl of 8,000 facets
BYTES = 150
RINGS = len(RINGS_DEG) - 1
# Ends of paths, the columns after those of the facets: the rings of the sky, then these. What meets
# the back of a closed surface began inside a body and is buried.
ENDS = ("ground", "truncated", "buried", "backs", "passive")


def points_of(rays: int) -> int:
    """Number of points of each randomisation for at least so many paths."""
    return -(-rays // RANDOMISATIONS)


@dataclass(frozen=True, eq=False)
class Means:
    """Means of what the paths of n facets met, for each randomisation.

    between: sparse, (rows, n), what the paths of each row met of the facets. ends:
    (RANDOMISATIONS, rows, rings and ENDS). lost: (shapes,), sums over the rows of the shares that
    ended on the backs of shapes or on shapes that do not emit.
    """

    between: list[sparse.csr_array]
    ends: np.ndarray
    lost: np.ndarray

    @staticmethod
    def of(rows: int, n: int, cells, values, lost) -> "Means":
        """The means from values of cells, which are numbered by row, randomisation and column."""
        place, column = np.divmod(cells, n + RINGS + len(ENDS))
        row, run = np.divmod(place, RANDOMISATIONS)
        is_end, between = column >= n, []
        ends = np.zeros((RANDOMISATIONS, rows, RINGS + len(ENDS)))
        ends[run[is_end], row[is_end], column[is_end] - n] = values[is_end]
        for k in range(RANDOMISATIONS):
            of_run = ~is_end & (run == k)
            places = row[of_run], column[of_run]
            between.append(sparse.csr_array((values[of_run], places), shape=(rows, n)))
        return Means(between, ends, lost)

    def end(self, name: str) -> np.ndarray:
        """The means that ended in one of ENDS, (RANDOMISATIONS, rows)."""
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
    reflected : bool
        Whether paths are of the light that a side of a facet has reflected, or else of what a facet
        absorbs.
    rows : (rows,)
        Index of the facet of each row of paths: one for each side of `reflected` light, otherwise
        one for each facet.
    row_sides : (rows,)
        Side of each row, 1 in front and -1 behind; 0 for any.
    """

    def __init__(self, scene: Scene, surfaces: Surfaces, reflected: bool = False):
        self.scene, self.surfaces, self.table = scene, surfaces, FacetTable(scene)
        self.shapes = list(scene.mi.shapes())
        table = self.table
        emits = np.array([is_thermal(shape.emitter()) for shape in self.shapes])
        exists = table.shape_index >= 0
        self.number = np.flatnonzero(exists & (table.type != "sky") & emits[table.shape_index])
        for number in self.number[~(table.area[self.number] > 0)]:
            shape = self.shapes[table.shape_index[number]]
            raise InputError(
                f"{scene.name}: facet {number} of shape '{shape.id()}' has no area; remove it"
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
        self.in_front = mi.Float([s.count(1) / max(len(s), 1) for s in sides])
        self.reflected = reflected
        self.rows = np.repeat(np.arange(n), self.sides) if reflected else np.arange(n)
        self.row_sides = np.zeros(n)
        if reflected:
            self.row_sides = np.concatenate([sides[k] for k in of_facet])
        self.row_facet = mi.UInt32(self.rows.astype(np.uint32))
        self.row_side = mi.Float(self.row_sides)
        self.vector = mi.UInt32(VECTOR)
        dr.eval(self.index_of, self.surface_of, self.flags_of, self.back_of, self.column)
        dr.eval(self.in_front, self.row_facet, self.row_side)

    @property
    def columns(self) -> int:
        """Number of columns of what paths meet: facets, rings of the sky, and ENDS."""
        return len(self.number) + RINGS + len(ENDS)

    def respond(self, si, numbers, active):
        """Direction, weight and emissivity of the surfaces at hits, seen along `si.wi`."""

        def respond(surface, si, u, v, active):
            bs, weight = surface.bsdf.sample(mi.BSDFContext(), si, u, v, active)
            return bs.wo, weight[0], surface.emissivity.eval(surface.bsdf, si, active)

        return self.of_surfaces(respond, si, *numbers, active)

    def emissivity(self, si, active):
        """Emissivity of the surfaces at points, toward `si.wi`."""

        def emissivity(surface, si, active):
            return mi.Float(surface.emissivity.eval(surface.bsdf, si, active))

        return self.of_surfaces(emissivity, si, active)

    def of_surfaces(self, function, si, *arguments):
        """What a function of a surface returns for the surface at each hit."""
        targets = [partial(function, surface) for surface in self.surfaces.different]
        if len(targets) == 1:
            return targets[0](si, *arguments)
        return dr.switch(self.at(self.surface_of, si), targets, si, *arguments)

    def sides_at(self, si, active=True) -> tuple[mi.Bool, mi.Bool]:
        """Whether `si.wi` is in front, and whether it is behind, of a surface with such a side."""
        flags = self.at(self.flags_of, si, active)
        in_front = mi.has_flag(flags, mi.BSDFFlags.FrontSide) & (si.wi.z > 0)
        return in_front, mi.has_flag(flags, mi.BSDFFlags.BackSide) & (si.wi.z < 0)

    def sees_sky(self, si, to, active) -> mi.Bool:
        """Whether nothing but the sky is in the directions `to` from the active points."""
        ray = mi.Ray3f(self.offsets.leave(si, to), to)
        pi = self.scene.mi.ray_intersect_preliminary(ray, coherent=False, active=active)
        facet = self.table.number(pi.shape, pi.prim_index, pi.is_valid())
        column = dr.gather(mi.UInt32, self.column, facet, pi.is_valid())
        return active & (~pi.is_valid() | (column == len(self.number)))

    def at(self, table: mi.UInt32, si, active=True) -> mi.UInt32:
        """The number of each hit's shape in a table by the pointer to it."""
        return dr.gather(mi.UInt32, table, dr.reinterpret_array(mi.UInt32, si.shape), active)

    def start(self, row: mi.UInt32, sampler: Lattice) -> mi.SurfaceInteraction3f:
        """Points on the facets of rows with a direction `wi`, drawn by the cosine."""
        sample, u, v = sampler.next_2d(), sampler.next_1d(), sampler.next_2d()
        si = self.parts.point(dr.gather(mi.UInt32, self.row_facet, row), u, sample)
        in_front = dr.gather(mi.Float, self.in_front, self.at(self.surface_of, si))
        side = dr.gather(mi.Float, self.row_side, row)
        side = dr.select(side != 0, side, in_front - sampler.next_1d())
        si.wi = mi.warp.square_to_cosine_hemisphere(v)
        si.wi.z = dr.mulsign(si.wi.z, side)
        return si

    def means(self, points: int, seed: int) -> Means:
        """What the paths of the rows meet.

        Parameters
        ----------
        points : int
            Paths of each row in each of the RANDOMISATIONS.
        seed : int

        Returns
        -------
        Means

        Raises
        ------
        InputError
            If the numbers that the first launches keep say that memory does not suffice for all.
        """
        rows, C = len(self.rows), self.columns
        lost, parts, kept = dr.zeros(mi.Float, len(self.shapes)), [], 0
        step = max(1, min(rows, CELLS // (RANDOMISATIONS * C)))
        for first in range(0, rows, step):
            count = min(step, rows - first)
            met = dr.zeros(mi.Float64, count * RANDOMISATIONS * C)
            tally = met, lost
            most = max(1, LANES // (count * RANDOMISATIONS))
            for point in range(0, points, most):
                self._launch(first, count, point, min(most, points - point), seed, tally)
            # Facets meet few of the others, so that the cells are compressed before they are copied
            cell = dr.compress(met > 0)
            values = dr.gather(mi.Float64, met, cell).numpy() / points
            parts.append((cell.numpy() + np.int64(first) * RANDOMISATIONS * C, values))
            kept += len(values)
            check_free(
                BYTES * kept * rows / (first + count),
                f"exchange of {rows} facets with {points * RANDOMISATIONS} paths each",
                "trace fewer rays, or give the model larger facets",
            )
        cells, values = (np.concatenate(column) for column in zip(*parts))
        lost = lost.numpy() / (points * RANDOMISATIONS)
        return Means.of(rows, len(self.number), cells, values, lost)

    def _launch(self, first, rows, point, points, seed, tally) -> None:
        """Trace `points` paths from `point` on, of each randomisation of each row."""
        lane = dr.arange(mi.UInt32, rows * RANDOMISATIONS * points)
        first, points, seed, point = (dr.opaque(mi.UInt32, k) for k in (first, points, seed, point))
        run, number = lane // points, lane % points
        sampler = Lattice.at(first * RANDOMISATIONS + run, point + number, seed, self.vector)
        si = self.start(first + run // RANDOMISATIONS, sampler)
        absorbed = self.emissivity(si, mi.Bool(True))
        # What is absorbed of the sky's light is the same for light that arrives. Light that a side
        # has reflected begins with the weight 1.
        weight = mi.Float(1) if self.reflected else absorbed
        of_escape = absorbed if self.reflected else mi.Float(1)
        to = si.to_world(si.wi)
        ray = mi.Ray3f(self.offsets.leave(si, to), to)
        self._follow(ray, weight, of_escape, sampler, run * self.columns, tally)
        dr.eval(tally)

    @dr.syntax
    def _follow(self, ray, weight, of_escape, sampler, row, tally):
        """Follow paths and add what they meet to the cells from `row` on.

        of_escape: factor of what escapes. tally: what is added up, by row, randomisation and
        column, and what is lost, by shape.
        """
        met, lost = tally
        n, scene = len(self.number), self.scene.mi
        weight, active = mi.Float(weight), weight > 0
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
            in_front, behind = self.sides_at(si, hits)
            is_back = hits & ~in_front & ~behind
            column = dr.select(is_back, self.at(self.back_of, si, hits), column)
            column = dr.select(escapes, n + self.ring(ray.d), column)
            part = weight * dr.select(hits & ~is_back, emissivity, 1)
            part *= dr.select(escapes, of_escape, 1)
            dr.scatter_add(met, mi.Float64(part), row + column, active)
            is_lost = hits & (column >= n + RINGS + ENDS.index("backs"))
            dr.scatter_add(lost, part, self.at(self.index_of, si, hits), is_lost)

            weight *= factor
            # Russian roulette keeps the means
            weight *= dr.select(weight < FAINT, dr.select(sampler.next_1d() < 0.5, 2, 0), 1)
            reflections += 1
            active = hits & ~is_back & (weight > 0)
            ends = active & (reflections >= MOST_REFLECTIONS)
            dr.scatter_add(met, mi.Float64(weight), row + n + RINGS + ENDS.index("truncated"), ends)
            active &= ~ends
            d = si.to_world(to)
            ray = mi.Ray3f(self.offsets.leave(si, d), d)

    def ring(self, d) -> mi.UInt32:
        """The ring of the sky in a direction, counted from the horizon; RINGS below it."""
        step = np.radians(RINGS_DEG[1])
        k = dr.minimum(mi.UInt32(dr.asin(dr.clip(d.z, 0, 1)) / step), RINGS - 1)
        return dr.select(d.z < 0, RINGS + ENDS.index("ground"), k)

"""Paths that begin on facets, and what they meet.

A path begins at a point on a side of a facet, in a direction drawn by the cosine. It is followed as
from an observer, against the direction of the light: of what surface j emits, a side of facet i
absorbs the part of the area

    G_ij = A_i <eps_i(theta) W eps_j(theta')>,

where W is the product of the weights of the reflections between. The mean is over the paths of the
side, and A_i is its area.
"""

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np
from scipy import sparse

from mi_lcair.errors import InputError
from mi_lcair.heating.conductors import RINGS_DEG
from mi_lcair.heating.parts import Parts, closed_shapes
from mi_lcair.heating.surfaces import Surfaces
from mi_lcair.plugins.emitters.thermal_emitter import is_thermal
from mi_lcair.plugins.samplers.lattice import VECTOR, Lattice
from mi_lcair.rendering.facets.table import FacetTable
from mi_lcair.rendering.facets.tracer import FacetTracer
from mi_lcair.rendering.limits import check_free
from mi_lcair.rendering.scene import Scene

# Part of a path's first weight below which half of the paths end, and the others count twice
FAINT = 1e-4
# Bound of the reflections in a closed cavity that absorbs hardly anything
MOST_REFLECTIONS = 10_000
RANDOMISATIONS = 8
# Paths of the first launch, most paths of a launch, and most hits that it keeps
PILOT, LANES, SLOTS = 2**16, 2**22, 2**23
# Memory for each number that is kept [bytes]: 123 on a bowl of 99,500 facets
BYTES = 150
RINGS = len(RINGS_DEG) - 1
# Ends of paths, the columns after those of the facets: the rings of the sky, then these. What meets
# the back of a closed surface began inside a body and is buried. Other backs, and surfaces that do
# not emit, take no part in the exchange: what meets them is lost.
ENDS = ("ground", "truncated", "buried", "lost")


def points_of(rays: int) -> int:
    """Number of points of each randomisation for at least so many paths."""
    return -(-rays // RANDOMISATIONS)


@dataclass(frozen=True, eq=False)
class Means:
    """Means of what the paths of some rows met of n facets, for each randomisation.

    between: sparse, (rows, n), what the paths of each row met of the facets. ends:
    (RANDOMISATIONS, rows, rings and ENDS). lost: (shapes,), sums over the rows of what was lost on
    each shape.
    """

    between: list[sparse.csr_array]
    ends: np.ndarray
    lost: np.ndarray

    def end(self, name: str) -> np.ndarray:
        """The means that ended in one of ENDS, (rows,)."""
        return self.ends[:, :, RINGS + ENDS.index(name)].mean(axis=0)

    def sums(self, weights: sparse.csr_array) -> "Means":
        """Sums over the rows with weights, (other rows, rows)."""
        ends = np.array([weights @ ends for ends in self.ends])
        return Means([weights @ between for between in self.between], ends, self.lost)


class FacetPaths:
    """Traces paths from the facets of a scene that emit. Each of their sides is a row of paths.

    Attributes
    ----------
    table : FacetTable
    number : (n,)
        Numbers of the facets that emit, in the table.
    rows : (rows,)
        Index of the facet of each row.
    areas : sparse, (n, rows)
        Area of the side of each row [m^2], in the row of its facet.
    reflected : bool
        Whether paths are of the light that a side has reflected, or else of what it absorbs.
    """

    def __init__(self, scene: Scene, surfaces: Surfaces, reflected: bool = False):
        self.table = table = FacetTable(scene)
        self.surfaces, self.reflected, self.shapes = surfaces, reflected, list(scene.mi.shapes())
        self.tracer = FacetTracer(scene, table, surfaces.different, surfaces.of_shape)
        self.number = emitting_facets(table, self.shapes, scene.name)
        n, index = len(self.number), np.arange(len(self.number))
        self.parts = Parts.of(table, self.number, self.shapes)
        of_shape = np.array(surfaces.of_shape)
        self.surface_of_facet = of_shape[table.shape_index[self.number]]
        self.rows = np.repeat(index, self.of_facets(lambda surface: len(surface.sides)))
        places = (self.rows, np.arange(len(self.rows)))
        area = table.area[self.number][self.rows]
        self.areas = sparse.csr_array((area, places), shape=(n, len(self.rows)))
        self.row_facet = mi.UInt32(self.rows.astype(np.uint32))
        self.row_side = mi.Float(self.of_rows(lambda surface: surface.sides))
        column = self.end("lost") + table.shape_index
        column[table.type == "sky"] = n
        column[self.number] = index
        self.column = mi.UInt32(column.astype(np.uint32))
        count = np.array([len(surface.sides) for surface in surfaces.different])[of_shape]
        is_closed = closed_shapes(table, self.shapes, count == 1)
        lost = self.end("lost") + np.arange(len(self.shapes))
        backs = np.where(is_closed, self.end("buried"), lost)[table.shape_index]
        self.back_of, self.vector = mi.UInt32(backs.astype(np.uint32)), mi.UInt32(VECTOR)
        dr.eval(self.column, self.back_of, self.row_facet, self.row_side)

    def end(self, name: str) -> int:
        """The column of one of ENDS. What is lost has one for each shape, from there on."""
        return len(self.number) + RINGS + ENDS.index(name)

    def of_facets(self, function) -> np.ndarray:
        """Values of a function of a surface, of the surface of each facet, (n,)."""
        values = [function(surface) for surface in self.surfaces.different]
        return np.array(values)[self.surface_of_facet]

    def of_rows(self, function) -> np.ndarray:
        """Values of a function that returns one for each side of a surface, (rows,)."""
        values = [function(surface) for surface in self.surfaces.different]
        return np.concatenate([values[k] for k in self.surface_of_facet])

    def sees_sky(self, si, to, active) -> mi.Bool:
        """Whether nothing but the sky is in the directions `to` from the active points."""
        met, facet = self.tracer.meet(self.tracer.leave(si, to), active)
        column = dr.gather(mi.UInt32, self.column, facet, met.is_valid())
        return active & (~met.is_valid() | (column == len(self.number)))

    def starts(self, place: mi.UInt32, point: mi.UInt32, seed) -> tuple:
        """Even points on the facets of rows, the sides of the rows, and the paths' samplers.

        place: number of the path's row plus the number of rows times that of its randomisation.
        point: number of the path among those of the place.
        """
        rows = dr.opaque(mi.UInt32, len(self.rows))
        row, seed = place % rows, dr.opaque(mi.UInt32, seed)
        sampler = Lattice.at(row * RANDOMISATIONS + place // rows, point, seed, self.vector)
        sample = sampler.next_2d()
        facet = dr.gather(mi.UInt32, self.row_facet, row)
        si = self.parts.point(facet, sampler.next_1d(), sample)
        return si, dr.gather(mi.Float, self.row_side, row), sampler

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
        n, rows, k = len(self.number), len(self.rows), self.end("lost")
        columns, paths = k + len(self.shapes), rows * points
        runs = [sparse.csr_array((rows, columns))] * RANDOMISATIONS
        begin, whole, lanes = 0, paths * RANDOMISATIONS, PILOT
        while begin < whole:
            end = min(begin + lanes, whole)
            count, *hits = self._launch(begin, end - begin, points, seed)
            count = int(count[0])
            lanes = min(LANES, (end - begin) * SLOTS // max(2 * count, 1))  # half of the slots
            if count > SLOTS:
                continue
            place, column, value = (array.numpy()[:count] for array in hits)
            shape = rows * RANDOMISATIONS, columns
            met = sparse.csr_array((value.astype(float), (place, column)), shape=shape) / points
            for run in range(begin // paths, (end - 1) // paths + 1):
                runs[run] = runs[run] + met[run * rows : (run + 1) * rows]
            begin = end
            check_free(
                BYTES * sum(run.nnz for run in runs) * whole / end,
                f"exchange of {n} facets with {points * RANDOMISATIONS} paths each",
                "trace fewer rays, or give the model larger facets",
            )
        ends = [np.column_stack([run[:, n:k].toarray(), run[:, k:].sum(axis=1)]) for run in runs]
        lost = sum(run[:, k:].sum(axis=0) for run in runs)
        return Means([run[:, :n] for run in runs], np.array(ends), lost)

    def _launch(self, begin: int, count: int, points: int, seed: int) -> tuple:
        """Trace some of the paths, counted through the `points` of the places of `starts`.

        Returns the number of hits, and of each its place, column, and value.
        """
        first, offset = (dr.opaque(mi.UInt32, k) for k in divmod(begin, points))
        lane, points = offset + dr.arange(mi.UInt32, count), dr.opaque(mi.UInt32, points)
        place = first + lane // points
        si, side, sampler = self.starts(place, lane % points, seed)
        si.wi = mi.warp.square_to_cosine_hemisphere(sampler.next_2d())
        si.wi.z = dr.mulsign(si.wi.z, side)
        _, absorbed, _, _ = self.tracer.respond(si, mi.Bool(True))
        # What is absorbed of the sky's light is the same for light that arrives. Light that a side
        # has reflected begins with the weight 1.
        weight = mi.Float(1) if self.reflected else absorbed
        of_escape = absorbed if self.reflected else mi.Float(1)
        ray = self.tracer.leave(si, si.to_world(si.wi))
        slots = dr.empty(mi.UInt32, SLOTS), dr.empty(mi.UInt32, SLOTS), dr.empty(mi.Float, SLOTS)
        hits = dr.zeros(mi.UInt32, 1), *slots
        self._follow(ray, weight, of_escape, sampler, place, hits)
        dr.eval(hits)
        return hits

    @dr.syntax
    def _follow(self, ray, weight, of_escape, sampler, place, hits):
        """Follow paths and keep what they meet.

        of_escape: factor of what escapes. place: of the paths' row and randomisation. hits: see
        `_launch`.
        """
        n, tracer = len(self.number), self.tracer
        weight, faint, active = mi.Float(weight), FAINT * weight, weight > 0
        reflections = mi.UInt32(0)
        while dr.hint(active, label="exchange"):
            si, facet = tracer.meet(ray, active)
            ends = reflections == MOST_REFLECTIONS
            meets = active & ~ends & si.is_valid()
            column = dr.gather(mi.UInt32, self.column, facet, meets)
            # The sky is what escapes, or a shape of that type
            escapes = active & ~ends & (~meets | (column == n))
            meets &= ~escapes
            u, v = sampler.next_1d(), sampler.next_2d()
            has_side, emissivity, to, factor = tracer.respond(si, meets, u, v)
            is_back = meets & ~has_side
            back = dr.gather(mi.UInt32, self.back_of, facet, meets)
            column = dr.select(is_back, back, column)
            column = dr.select(escapes, n + self.ring(ray.d), column)
            column = dr.select(ends, self.end("truncated"), column)
            part = weight * dr.select(meets & ~is_back, emissivity, 1)
            part *= dr.select(escapes, of_escape, 1)
            keep(hits, (place, column, part), active & (part > 0))

            weight *= factor
            # Russian roulette keeps the means
            weight *= dr.select(weight < faint, dr.select(sampler.next_1d() < 0.5, 2, 0), 1)
            reflections += 1
            active = meets & ~is_back & (weight > 0)
            ray = tracer.leave(si, si.to_world(to))

    def ring(self, d) -> mi.UInt32:
        """The ring of the sky in a direction, counted from the horizon; RINGS below it."""
        step = np.radians(RINGS_DEG[1])
        k = dr.minimum(mi.UInt32(dr.asin(dr.clip(d.z, 0, 1)) / step), RINGS - 1)
        return dr.select(d.z < 0, RINGS, k)


def keep(hits, values, active) -> None:
    """Append values to the slots of hits, as long as there are any."""
    count, *slots = hits
    slot = dr.scatter_inc(count, mi.UInt32(0), active)
    for kept, value in zip(slots, values):
        dr.scatter(kept, value, slot, active & (slot < SLOTS))


def emitting_facets(table: FacetTable, shapes: list, name: str) -> np.ndarray:
    """Numbers of the facets that emit and are no sky, (n,).

    name: of the scene. Raises InputError if there is none, or one without an area.
    """
    emits = np.array([is_thermal(shape.emitter()) for shape in shapes])
    exists = table.shape_index >= 0
    number = np.flatnonzero(exists & (table.type != "sky") & emits[table.shape_index])
    if not len(number):
        raise InputError(f"{name}: no surface emits, so that no heat is exchanged")
    for facet in number[~(table.area[number] > 0)]:
        shape = shapes[table.shape_index[facet]]
        raise InputError(f"{name}: facet {facet} of shape '{shape.id()}' has no area; remove it")
    return number

"""Recorder of derivatives of the radiance of paths with respect to parameters.

A path's radiance is a sum over the emitters that it meets: L = sum_k beta_k Le_k. It depends on a
parameter of an emitter through Le_k alone, and on a parameter of a material through the throughput
beta_k and the emissivity. The sampled directions and their densities are constants. The derivative
of L in a material's parameter p is therefore, with the scores s_j = d log f_j / dp,

    dL/dp = sum_k beta_k dLe_k/dp + sum_j s_j (radiance after reflection j).

The radiance after reflection j is the whole radiance less that before it. Two sums along the path
suffice: A = sum_j s_j and E = sum_k beta_k dLe_k/dp - sum_j s_j (radiance before reflection j),
and dL/dp = E + A L. All columns come from the same paths.

For a narrow lobe the scores are large, and cancel only in the mean over many paths. The control
variate Z = sum_j beta_j c_j (d HDR_j/dp - w_j s_j), with w = f / pdf, has the mean 0 for any c that
does not depend on the sampled direction. Where c is the mean incoming radiance, E + A L + Z is free
of most of this noise. Where the incoming radiance is uneven, but a narrow lobe sees one body, what
that body emits along the mirror direction is a better c. M is the same sum with the deviation of
this emission from its mean in place of c, so that E + A L + Z + M has both.

Where f_j is 0, the score has no value. The path then goes on as a latent one with the weight 1 in
place of f_j / pdf_j, see `columns/tables.py`. With B = (df_j/dp) / pdf_j and the radiance M that it
meets, dL/dp = E + A L + B M. Scores of reflectances near 0 are large, and A L and E cancel. They
are therefore summed in Float64.
"""

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.plugins.columns.tables import CELLS, ColumnTables
from mi_lcair.plugins.emission.triangles import PrimitiveTable
from mi_lcair.plugins.paths.launch import Launch, ParallelRays
from mi_lcair.plugins.recorders.recorder import (
    Emission,
    Recorder,
    Recorders,
    Reflection,
    Store,
    add_to,
    entries,
    zeros,
)


@dataclass
class Columns(Recorder):
    """Sums along each path from which its columns follow, see the top of this file.

    radiance: weighted radiance so far [W m^-2 sr^-1]. E, A, Z: the sums; their last entry takes
    what belongs to parameters without a column. cell: cell of the film in which the path begins.
    B, latent: the sum and the radiance along the latent path; None where nothing is explored.
    M: a sum, see above; None where no surface has a narrow lobe. surface: the surfaces where the
    paths are, as far as they have columns.

    Its channels are column.N, for materials control.N and mirror.N, and `weighted`, the weighted
    radiance, of which the columns are derivatives.
    """

    tables: ColumnTables
    radiance: mi.Float
    E: dr.Local
    A: dr.Local
    Z: dr.Local
    cell: mi.UInt32
    B: dr.Local | None
    latent: mi.Float | None
    M: dr.Local | None

    needs_drawn_hit = True
    surface = ()

    @property
    def needs_mirrored(self) -> bool:
        return self.tables.has_mirrors

    @staticmethod
    def of(tables: ColumnTables, cell, explores: bool) -> "Columns":
        size, Float = tables.size + 1, dr.float64_array_t(mi.Float) if explores else mi.Float
        sums = zeros(size, Float), zeros(size, Float), zeros(size)
        latent = (zeros(size), mi.Float(0)) if explores else (None, None)
        M = zeros(size if tables.has_mirrors else 0)
        return Columns(tables, Float(0), *sums, mi.UInt32(cell), *latent, M)

    def meet(self, bsdf, wi) -> None:
        self.surface = self.tables.vertices(bsdf, wi)

    def emission(self, emission: Emission) -> None:
        tables, radiance, weight = self.tables, emission.radiance, emission.weight
        factor = mi.Float(1)
        if tables.weight is not None:
            factor = tables.weight_of(emission)
            radiance, weight = radiance * factor, weight * factor
        self.radiance += radiance
        if emission.latent is not None:
            self.latent += emission.latent * factor
        for part, share in emission.parts:
            entry, of_part = tables.entry(emission.emitter, part), emission.radiance * share
            if tables.weight is not None:
                of_part *= dr.gather(mi.Float, tables.weight, entry)
            for columns, slopes in tables.sources:
                column = dr.gather(mi.UInt32, columns, entry)
                add_to(self.E, column, of_part * dr.gather(mi.Float, slopes, entry))
        surface = tables.entry(emission.emitter, emission.prim)
        weight *= dr.gather(mi.Float, tables.radiance, surface)
        for vertex in self.emitting_surface(emission):
            for column, slope in zip(vertex.columns(), vertex.emissivity()):
                add_to(self.E, column, weight * slope)
        if emission.drawn_to is not None:
            # The direction is one of many: it depends on the reflecting surface too
            for vertex in self.surface:
                slopes = vertex.along(emission.drawn_to)[1]
                for column, slope in zip(vertex.columns(), slopes):
                    add_to(self.E, column, emission.before * factor * slope)

    def emitting_surface(self, emission: Emission) -> list:
        if emission.hit is None:
            return []
        if emission.drawn_to is None:
            return self.surface
        return self.tables.vertices(emission.hit.bsdf(), emission.hit.wi)

    def reflect(self, reflection: Reflection) -> None:
        """Add the scores of a reflection.

        Also of directions of weight 0, for the mean of the control variate to be 0.
        """
        tables, weight, active = self.tables, reflection.weight, reflection.active
        later = CELLS * CELLS + tables.surface_number(reflection.bsdf)
        place = dr.select(reflection.bounce == 0, self.cell, later)
        c = reflection.throughput * dr.gather(mi.Float, tables.incoming, place)
        uneven = None
        if tables.has_mirrors:
            uneven = reflection.mirrored - dr.gather(mi.Float, tables.mirrored, place)
            uneven *= reflection.throughput
        for vertex in self.surface:
            value, slopes = vertex.along(reflection.to, reflection.is_delta)
            counts, latent = active & (value > 0), reflection.becomes_latent
            if latent is not None:
                counts &= ~latent & (reflection.throughput != 0)
            relative = dr.select(counts, 1 / dr.select(counts, value, 1), 0)
            for column, slope, of_HDR in zip(vertex.columns(), slopes, vertex.HDR[1]):
                score = slope * relative
                add_to(self.A, column, score)
                add_to(self.E, column, -score * self.radiance)
                weighted = weight * score
                if latent is not None:
                    of_latent = slope / dr.select(latent, reflection.pdf, 1)
                    of_latent = dr.select(latent, of_latent, 0)
                    add_to(self.B, column, of_latent)
                    weighted += of_latent
                deviation = dr.select(active, of_HDR - weighted, 0)
                add_to(self.Z, column, c * deviation)
                if uneven is not None:
                    add_to(self.M, column, uneven * deviation)

    def samples(self, L) -> dict:
        E, A, Z, M = (entries(local) for local in (self.E, self.A, self.Z, self.M))
        materials = range(self.tables.materials)
        columns = [E[k] + A[k] * self.radiance for k in materials] + E[len(materials) : -1]
        for k, factor in zip(materials, entries(self.B)):
            columns[k] += factor * self.latent
        channels = {f"column.{k}": mi.Float(column) for k, column in enumerate(columns)}
        channels |= {f"control.{k}": Z[k] for k in materials}
        channels |= {f"mirror.{k}": value for k, value in zip(materials, M)}
        return channels | {"weighted": mi.Float(self.radiance)}


# Recorder of the mean incoming radiance of reflections, for the control variate of `Columns`
# -------------------------------------------------------------------------------------------


@dataclass
class Incoming(Recorder):
    """Sums from which the mean incoming radiance of reflections follows.

    The reflections are counted separately for the first one of each path and, after that, for each
    surface. A drawn direction has no part in the incoming radiance of sampled directions. radiance:
    weighted radiance so far [W m^-2 sr^-1]. number: number of reflections. before: radiance before
    them, summed. throughput: throughput after them, summed. latent: where a latent path began.
    mirrored: radiance emitted along their mirror directions, times the throughput, summed; None
    where no surface has a narrow lobe.

    Its channels are reflected.N, throughput.N and mirrored.N: N = 0 for the first reflection, then
    surfaces.
    """

    tables: ColumnTables
    radiance: mi.Float
    number: dr.Local
    before: dr.Local
    throughput: dr.Local
    latent: mi.UInt32
    mirrored: dr.Local | None

    @property
    def needs_mirrored(self) -> bool:
        return self.tables.has_mirrors

    @staticmethod
    def of(tables: ColumnTables) -> "Incoming":
        size = tables.surfaces + 1
        sums, mirrored = (zeros(size) for _ in range(3)), zeros(size if tables.has_mirrors else 0)
        return Incoming(tables, mi.Float(0), *sums, mi.UInt32(0), mirrored)

    def emission(self, emission: Emission) -> None:
        tables, factor = self.tables, mi.Float(1)
        if tables.weight is not None:
            factor = tables.weight_of(emission)
        self.radiance += emission.radiance * factor
        if emission.latent is not None:
            # It is what the surface there receives, and reached the sensor after no other one
            add_to(self.before, self.latent, -emission.latent * factor)

    def reflect(self, reflection: Reflection) -> None:
        place = self.tables.surface_number(reflection.bsdf)
        is_first = reflection.bounce == 0
        counts = reflection.active & (is_first | (place > 0))
        place, weight = dr.select(is_first, 0, place), reflection.weight
        if reflection.becomes_latent is not None:
            weight = dr.select(reflection.becomes_latent, 1, weight)
            self.latent = dr.select(reflection.becomes_latent, place, self.latent)
            counts &= reflection.throughput != 0
        throughput = reflection.throughput * weight
        parts = [(self.number, mi.Float(1)), (self.before, self.radiance)]
        parts.append((self.throughput, throughput))
        if self.mirrored is not None:
            parts.append((self.mirrored, throughput * reflection.mirrored))
        for sums, value in parts:
            add_to(sums, place, dr.select(counts, value, 0))

    def samples(self, L) -> dict:
        number, before, throughput = map(entries, (self.number, self.before, self.throughput))
        channels = {f"mirrored.{k}": value for k, value in enumerate(entries(self.mirrored))}
        for k in range(len(number)):
            channels[f"reflected.{k}"] = number[k] * self.radiance - before[k]
            channels[f"throughput.{k}"] = throughput[k]
        return channels


# Recorder of the triangles that a path meets, for derivatives with respect to their vertices
# -------------------------------------------------------------------------------------------

PASSED = 8  # further triangles of a path that are kept in a scene with surfaces that rays pass


@dataclass
class MetTriangles(Recorder):
    """Triangles that each path meets: with its rays, and with those toward drawn emitters.

    count: number of hits of each path so far. store: the triangles.
    """

    count: mi.UInt32
    store: Store

    def note(self, hit) -> None:
        """Note the triangle of a hit, an interaction of any kind."""
        store = self.store
        number = store.table.at(hit.shape, hit.prim_index, hit.is_valid())
        store.note(self.count, self.count < store.slots, number=number)
        self.count += 1

    def begin(self, first, ray, active) -> mi.Bool:
        self.note(first)
        return active

    def emission(self, emission: Emission) -> None:
        if emission.toward is not None:
            self.note(emission.toward)
        elif emission.hit is not None:
            self.note(emission.hit)


def met_triangles(tracer, sensor, launch: Launch, triangles: PrimitiveTable) -> tuple:
    """Trace the paths of a launch that begins on facets, see `FacetStarts`.

    Call it inside the context `BouncePath.prepared`. triangles: their numbers, from 1 on, and 0 for
    everything else.

    Returns
    -------
    L : ndarray, shape (paths,)
        Radiance of each path; 0 if it does not see the triangle on which it began, or NaN
        [W m^-2 sr^-1].
    start : ndarray, shape (paths,)
        That triangle.
    met : ndarray, shape (paths, slots)
        Triangles that it meets, -1 for what is no triangle of these meshes.
    """
    hits = 2 + tracer.max_bounces * (1 + len(tracer.emitters.tables))
    slots = 1 + hits + (PASSED if tracer.emitters.passes else 0)
    with dr.suspend_grad():
        paths = launch.paths_from(sensor.sampler())
        store = Store(triangles, paths.lane, slots, number=(mi.UInt32, 0))
        met, rays = MetTriangles(mi.UInt32(0), store), ParallelRays.of(sensor) or sensor
        L, _, weight, facet = tracer.follow(paths, rays, lambda cell: Recorders([met]))
        start, L = triangles.at(facet.shape, facet.primitive), dr.select(weight > 0, L, 0)
        # One kernel traces the paths and fills the store
        dr.eval(L, start, store.arrays)
    (met,) = store.of_paths()
    # The number of the only triangle of a scene is a constant of the kernel
    start = np.broadcast_to(start.numpy().astype(np.int64) - 1, launch.paths)
    return L.numpy().astype(float), start, met.astype(np.int64) - 1

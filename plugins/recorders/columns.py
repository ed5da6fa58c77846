"""Recorder of derivatives of the radiance of paths in parameters.

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
of most of this noise.
"""

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from mi_lcair.plugins.columns.tables import CELLS, ColumnTables
from mi_lcair.plugins.recorders.recorder import (
    Emission,
    Recorder,
    Reflection,
    add_to,
    entries,
    zeros,
)


@dataclass
class Columns(Recorder):
    """Sums along each path from which its columns follow, see the top of this file.

    radiance: weighted radiance so far [W m^-2 sr^-1]. E, A, Z: the sums; their last entry takes
    what belongs to parameters without a column. cell: cell of the film in which the path begins.
    surface: the surfaces where the paths are, as far as they have columns.

    Its channels are column.N, for materials control.N, and `weighted`, the weighted radiance, of
    which the columns are derivatives.
    """

    tables: ColumnTables
    radiance: mi.Float
    E: dr.Local
    A: dr.Local
    Z: dr.Local
    cell: mi.UInt32

    needs_drawn_hit = True
    surface = ()

    @staticmethod
    def of(tables: ColumnTables, cell) -> "Columns":
        sums = (zeros(tables.size + 1) for _ in range(3))
        return Columns(tables, mi.Float(0), *sums, mi.UInt32(cell))

    def meet(self, bsdf, wi) -> None:
        self.surface = self.tables.vertices(bsdf, wi)

    def emission(self, emission: Emission) -> None:
        tables, radiance, weight = self.tables, emission.radiance, emission.weight
        if tables.weight is not None:
            factor = tables.weight_of(emission)
            radiance, weight = radiance * factor, weight * factor
        self.radiance += radiance
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
                for column, score in zip(vertex.columns(), vertex.relative(emission.drawn_to)):
                    add_to(self.E, column, radiance * score)

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
        for vertex in self.surface:
            scores, slopes = vertex.relative(reflection.to), vertex.HDR[1]
            for column, score, slope in zip(vertex.columns(), scores, slopes):
                score = dr.select(active, score, 0)
                add_to(self.A, column, score)
                add_to(self.E, column, -score * self.radiance)
                add_to(self.Z, column, dr.select(active, c * (slope - weight * score), 0))

    def samples(self, L) -> dict:
        E, A, Z = (entries(local) for local in (self.E, self.A, self.Z))
        materials = range(self.tables.materials)
        channels = {"weighted": self.radiance}
        channels |= {f"column.{k}": E[k] + A[k] * self.radiance for k in materials}
        channels |= {f"column.{k}": E[k] for k in range(self.tables.materials, self.tables.size)}
        return channels | {f"control.{k}": Z[k] for k in materials}

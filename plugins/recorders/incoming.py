"""Recorder of the mean incoming radiance of reflections, for the control variate of `Columns`."""

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from mi_lcair.plugins.columns.tables import ColumnTables
from mi_lcair.plugins.recorders.recorder import (
    Emission,
    Recorder,
    Reflection,
    add_to,
    entries,
    zeros,
)


@dataclass
class Incoming(Recorder):
    """Sums from which the mean incoming radiance of reflections follows.

    The reflections are counted separately for the first one of each path and, after that, for each
    surface. A drawn direction has no part in the incoming radiance of sampled directions. radiance:
    weighted radiance so far [W m^-2 sr^-1]. number: number of reflections. before: radiance before
    them, summed. throughput: throughput after them, summed.

    Its channels are reflected.N and throughput.N: N = 0 for the first reflection, then surfaces.
    """

    tables: ColumnTables
    radiance: mi.Float
    number: dr.Local
    before: dr.Local
    throughput: dr.Local

    @staticmethod
    def of(tables: ColumnTables) -> "Incoming":
        return Incoming(tables, mi.Float(0), *(zeros(tables.surfaces + 1) for _ in range(3)))

    def emission(self, emission: Emission) -> None:
        radiance, tables = emission.radiance, self.tables
        if tables.weight is not None:
            radiance *= tables.weight_of(emission)
        self.radiance += radiance

    def reflect(self, reflection: Reflection) -> None:
        place = self.tables.surface_number(reflection.bsdf)
        is_first = reflection.bounce == 0
        counts = reflection.active & (is_first | (place > 0))
        place = dr.select(is_first, 0, place)
        for sums, value in (
            (self.number, mi.Float(1)),
            (self.before, self.radiance),
            (self.throughput, reflection.throughput * reflection.weight),
        ):
            add_to(sums, place, dr.select(counts, value, 0))

    def samples(self, L) -> dict:
        number, before, throughput = map(entries, (self.number, self.before, self.throughput))
        channels = {}
        for k in range(len(number)):
            channels[f"reflected.{k}"] = number[k] * self.radiance - before[k]
            channels[f"throughput.{k}"] = throughput[k]
        return channels

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

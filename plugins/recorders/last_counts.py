"""Recorder of the radiance after the last numbers of reflections, for the geometric tail."""

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from mi_lcair.plugins.paths.tail import COUNTS, Tail, add_tail
from mi_lcair.plugins.recorders.recorder import Emission, Recorder, add_to, entries, zeros


@dataclass
class LastCounts(Recorder):
    """Radiance after N - 4, ..., N reflections, for N = `max_bounces` [W m^-2 sr^-1]."""

    max_bounces: mi.UInt32
    sums: dr.Local

    @staticmethod
    def of(max_bounces: int) -> "LastCounts":
        return LastCounts(dr.opaque(mi.UInt32, max_bounces), zeros(COUNTS))

    def emission(self, emission: Emission) -> None:
        place = mi.Int32(emission.bounce) + (COUNTS - 1) - mi.Int32(self.max_bounces)
        counts = (place >= 0) & ~emission.beyond
        radiance = dr.select(counts, emission.radiance, 0)
        add_to(self.sums, mi.UInt32(dr.maximum(place, 0)), radiance)

    def tail(self, of_model: mi.Float) -> tuple[mi.Float, Tail]:
        """The geometric tail of each path, and the sums that give its error; evaluates arrays."""
        last = entries(self.sums)
        dr.eval(last, of_model)
        return add_tail(last, of_model)

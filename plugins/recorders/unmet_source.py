"""Recorder of what a source would add that no path has hit, for the error of a radiance."""

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from mi_lcair.plugins.emission.emitter_table import EmitterTable
from mi_lcair.plugins.recorders.recorder import Recorder, Reflection


@dataclass
class UnmetSource(Recorder):
    """Largest contribution of a source that a path could have hit after a reflection.

    The scatter of the paths' radiance cannot see a source that none of them has hit. Where emitters
    are drawn, `EmitterTable.by_chance` bounds what one such hit would add.

    largest: that bound [W m^-2 sr^-1]. draws: number of directions drawn toward emitters, each
    times the throughput.
    """

    emitters: EmitterTable
    largest: mi.Float
    draws: mi.Float

    def reflect(self, reflection: Reflection) -> None:
        throughput = reflection.throughput * reflection.weight
        bound = self.emitters.by_chance(reflection.drawn, reflection.pdf, reflection.is_delta)
        receives = reflection.receives & (reflection.weight != 0)
        self.largest = dr.maximum(self.largest, dr.select(receives, throughput * bound, 0))
        self.draws += dr.select(receives, throughput, 0)

"""Recorder of the radiance by number of reflections."""

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from mi_lcair.plugins.recorders.recorder import Emission, Recorder, add_to, entries, zeros

BOUNCE_CHANNELS = 17  # bounce channels in images and tables; the last holds all counts from 16 on
MAX_BOUNCE_CHANNELS = 65  # the last one holds every bounce count from 64 on
# Numbers of bounce channels that are recorded. There are few, because each needs its own kernel.
SIZES = (6, 17, 33, MAX_BOUNCE_CHANNELS)


@dataclass
class ByBounce(Recorder):
    """Radiance by number of reflections, and what the closure adds [W m^-2 sr^-1].

    Its channels are bounce.N and closure. The last number holds more reflections too.
    """

    sums: dr.Local
    closure: mi.Float

    @staticmethod
    def up_to(max_bounces: int) -> "ByBounce":
        size = next(size for size in SIZES if size > min(max_bounces, SIZES[-1] - 1))
        return ByBounce(zeros(size), mi.Float(0))

    def emission(self, emission: Emission) -> None:
        radiance, beyond = emission.radiance, emission.beyond
        self.closure += dr.select(beyond, radiance, 0)
        place = dr.minimum(emission.bounce, len(self.sums) - 1)
        add_to(self.sums, place, dr.select(beyond, 0, radiance))

    def entries(self) -> list[mi.Float]:
        """Radiance after 0, 1, ... reflections of each path [W m^-2 sr^-1]."""
        return entries(self.sums)

    def samples(self, L) -> dict:
        channels = {f"bounce.{k}": value for k, value in enumerate(self.entries())}
        return channels | {"closure": self.closure}

"""Recorder of the number of rays of a path."""

from dataclasses import dataclass

import mitsuba as mi

from mi_lcair.plugins.recorders.recorder import Recorder


@dataclass
class Segments(Recorder):
    """Number of rays of each path, as the channel `segments`.

    Rays toward drawn emitters are not counted.
    """

    count: mi.Float

    @staticmethod
    def none() -> "Segments":
        return Segments(mi.Float(0))

    def turn(self) -> None:
        self.count += 1

    def samples(self, L) -> dict:
        return {"segments": self.count}

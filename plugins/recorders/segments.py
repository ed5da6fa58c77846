"""Recorder of the number of rays of a path."""

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from mi_lcair.plugins.recorders.recorder import Recorder


@dataclass
class Segments(Recorder):
    """Number of rays of each path, as the channel `segments`.

    Rays toward drawn emitters are not counted.
    """

    count: mi.Float

    def meet(self, bsdf, wi) -> None:
        self.count += 1

    def samples(self, L) -> dict:
        # The first ray of a path that is not followed was traced too
        return {"segments": dr.maximum(self.count, 1)}

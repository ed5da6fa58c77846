"""Recorder of what a source would add that no path has hit, for the error of a radiance."""

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.plugins.emission.emitter_table import EmitterTable
from mi_lcair.plugins.recorders.recorder import Recorder, Reflection

# Names of what is added up over paths, and of that of which the largest value counts
SUMMED = "draws", "squares", "potential", "potential_squares"
LARGEST = "largest", "darker"
BRIGHT = 0.5  # part of the brightest source's radiance from which on sources are alike


@dataclass
class UnmetSource(Recorder):
    """What a source would add that a path could have hit after a reflection.

    The scatter of the paths' radiance cannot see a source that none of them has hit. Where emitters
    are drawn, `EmitterTable.by_chance` bounds what one such hit would add.

    draws: number of reflections, at which directions toward emitters may be drawn, each times the
    throughput. squares: the same with the squared throughput. The others are None where nothing is
    drawn. potential, potential_squares: sums of the bounds of sources that are at least BRIGHT, and
    of their squares, in parts of the radiance of the brightest source. largest: largest bound [W
    m^-2 sr^-1]. darker: that of other sources.
    """

    emitters: EmitterTable
    draws: mi.Float
    squares: mi.Float
    potential: mi.Float | None
    potential_squares: mi.Float | None
    largest: mi.Float | None
    darker: mi.Float | None

    @staticmethod
    def of(emitters: EmitterTable) -> "UnmetSource":
        # Dr.Jit may fail on a loop with variables that never change
        drawn = [mi.Float(0) if emitters.draws else None for _ in range(4)]
        return UnmetSource(emitters, mi.Float(0), mi.Float(0), *drawn)

    def reflect(self, reflection: Reflection) -> None:
        receives = reflection.receives & (reflection.weight != 0)
        throughput = dr.select(receives, reflection.throughput * reflection.weight, 0)
        self.draws += throughput
        self.squares += dr.square(throughput)
        if reflection.drawn is not None:
            bound = self.emitters.by_chance(reflection.drawn, reflection.pdf, reflection.is_delta)
            bound = dr.select(throughput > 0, throughput * bound, 0)  # NaN beside no draw
            brightest = self.emitters.opaque_brightest
            is_bright = reflection.is_delta | (reflection.drawn.bound >= BRIGHT * brightest)
            part = dr.select(is_bright & (brightest > 0), bound / brightest, 0)
            self.potential += part
            self.potential_squares += dr.square(part)
            self.largest = dr.maximum(self.largest, bound)
            self.darker = dr.maximum(self.darker, dr.select(is_bright, 0, bound))

    def of_paths(self, weight) -> tuple[dict[str, mi.Float], dict[str, mi.Float]]:
        """What paths with these weights contribute by name: what is added up, and the rest."""
        noted = {name: value for name, value in vars(self).items() if name in SUMMED + LARGEST}
        noted = {
            name: value * (dr.square(weight) if "squares" in name else weight)
            for name, value in noted.items()
            if value is not None
        }
        summed = {name: noted.pop(name) for name in SUMMED if name in noted}
        return summed, noted


def in_all_windows(sums: dict[str, np.ndarray]) -> dict[str, float]:
    """What windows have noted, taken together; `sums` by name."""
    noted = {name: sums.get(name, np.zeros(1)) for name in SUMMED + LARGEST}
    return {name: np.sum(v) if name in SUMMED else np.max(v) for name, v in noted.items()}

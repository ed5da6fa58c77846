"""A launch: which paths are traced together, where they begin and what random numbers they use."""

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.plugins.derivatives import own_memory
from mi_lcair.plugins.paths.aim import Aim, place
from mi_lcair.plugins.samplers.lattice import VECTOR, Lattice, hashed


def numbers(sampler) -> str:
    """Which numbers paths use: "independent" for that sampler of Mitsuba's, otherwise "lattice"."""
    return "independent" if sampler.class_name() == "IndependentSampler" else "lattice"


@dataclass(frozen=True)
class Launch:
    """Paths that one kernel traces, in equal windows of a sensor's film.

    An image has a window for each pixel, a signature one for the whole film, a trend one for each
    view. Each window has some independent randomisations of the same number of points.

    columns, rows: number of windows along the sides of the film. first, windows, stride: numbers of
    the windows, counted row by row: `windows` windows from `first` on, every `stride`-th one.
    chosen: their numbers instead, in rising order. randomisations: number of randomisations of each
    window. first_point, points: the points of each randomisation. seed: seed of all random numbers.
    aim: density of the positions in each window; None for a constant one.

    The paths of a window follow each other, and within them those of a randomisation.
    """

    columns: int
    rows: int
    seed: int
    randomisations: int
    points: int
    first_point: int = 0
    first: int = 0
    windows: int = 1
    stride: int = 1
    chosen: tuple[int, ...] | None = None
    aim: Aim | None = None

    @property
    def paths(self) -> int:
        return self.windows * self.randomisations * self.points

    @property
    def window_numbers(self) -> np.ndarray:
        """Numbers of the windows, (windows,)."""
        if self.chosen is not None:
            return np.array(self.chosen)
        return self.first + self.stride * np.arange(self.windows)

    def paths_from(self, sampler) -> "Paths":
        """The paths of the launch. sampler: the sensor's, which chooses the random numbers."""
        opaque = lambda value: dr.opaque(mi.UInt32, value)
        is_lattice = numbers(sampler) == "lattice"
        lane, windows = dr.arange(mi.UInt32, self.paths), mi.UInt32(self.window_numbers)
        dr.eval(lane)
        own_memory([windows])
        return Paths(
            lane,
            windows,
            *map(opaque, (self.columns, self.rows, self.seed, self.randomisations, self.points)),
            opaque(self.first_point),
            mi.UInt32(VECTOR) if is_lattice else None,
            self.aim and self.aim.tables,
        )


@dataclass
class Paths:
    """The paths of a launch, as Dr.Jit arrays, so that one kernel serves all launches.

    lane: (paths,), number of each path. windows: (windows,), their numbers. vector: the lattice;
    None for independent numbers. aim: see `Aim.tables`. The others are numbers of `Launch`.
    """

    lane: mi.UInt32
    windows: mi.UInt32
    columns: mi.UInt32
    rows: mi.UInt32
    seed: mi.UInt32
    randomisations: mi.UInt32
    points: mi.UInt32
    first_point: mi.UInt32
    vector: mi.UInt32 | None
    aim: tuple | None

    def begin(self) -> tuple:
        """Sampler of each path, column and row of its window, its position there, its weight."""
        randomisation, point = self.lane // self.points, self.first_point + self.lane % self.points
        window = dr.gather(mi.UInt32, self.windows, randomisation // self.randomisations)
        if self.vector is None:
            first = dr.gather(mi.UInt32, self.windows, mi.UInt32(0))
            start = hashed(self.seed + hashed(first + hashed(self.first_point)))
            sampler = Random(start, self.lane)
        else:
            number = window * self.randomisations + randomisation % self.randomisations
            sampler = Lattice.at(number, point, self.seed, self.vector)
        position, weight = sampler.next_position(), mi.Float(1)
        if self.aim is not None:
            position, weight = place(*self.aim, position)
        return sampler, window % self.columns, window // self.columns, position, weight


class Random:
    """Independent random numbers of each path: those of Mitsuba's sampler `independent`."""

    DRJIT_STRUCT = {"stream": mi.PCG32}

    def __init__(self, seed=None, lane=None):
        if seed is not None:
            state, sequence = mi.sample_tea_32(seed, lane)
            self.stream = mi.PCG32(initstate=mi.UInt64(state), initseq=mi.UInt64(sequence))

    def next_1d(self, active=True):
        return self.stream.next_float32()

    def next_2d(self, active=True):
        x = self.next_1d(active)
        return mi.Point2f(x, self.next_1d(active))

    next_position = next_2d

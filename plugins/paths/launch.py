"""A launch: which paths are traced together, where they begin and what random numbers they use."""

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from mi_lcair.plugins.lattice_sampler import LatticeSampler, hashed
from mi_lcair.plugins.paths.aim import Aim


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
    randomisations: number of randomisations of each window. first_point, points: the points of each
    randomisation. seed: seed of all random numbers. aim: density of the positions in each window;
    None for a constant one.

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
    aim: Aim | None = None

    @property
    def paths(self) -> int:
        return self.windows * self.randomisations * self.points

    def begin(self, own) -> tuple[object, mi.Point2f, mi.Float]:
        """Sampler of the launch, where each path begins on the film, in 0..1, and its weight.

        own: the sensor's sampler, which chooses between independent and lattice numbers.
        """
        # Opaque numbers, so that one kernel serves all launches
        opaque = lambda value: dr.opaque(mi.UInt32, value)
        columns, rows, points, seed = map(opaque, (self.columns, self.rows, self.points, self.seed))
        lane = dr.arange(mi.UInt32, self.paths)
        randomisation, point = lane // points, opaque(self.first_point) + lane % points
        of_each = opaque(self.randomisations)
        window = opaque(self.first) + randomisation // of_each * opaque(self.stride)
        if numbers(own) == "independent":
            sampler = own.clone()
            start = hashed(seed + hashed(opaque(self.first) + hashed(opaque(self.first_point))))
            sampler.seed(start, self.paths)
        else:
            number = window * of_each + randomisation % of_each
            sampler = LatticeSampler.at(number, point, seed)
        corner = mi.Point2f(window % columns, window // columns)
        position, weight = sampler.next_2d(), mi.Float(1)
        if self.aim is not None:
            position, weight = self.aim.place(position)
        return sampler, (corner + position) / mi.Vector2f(columns, rows), weight

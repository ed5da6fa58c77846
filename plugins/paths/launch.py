"""A launch: which paths are traced together, where they begin and what random numbers they use."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.plugins.derivatives import children, own_memory
from mi_lcair.plugins.paths.aim import Aim, CellTable
from mi_lcair.plugins.paths.facet_starts import FacetStarts, FacetTable
from mi_lcair.plugins.samplers.lattice import VECTOR, Lattice, hashed

# Positions in the film of a sensor at which rays are taken. Those of a batch must lie inside the
# film, because the edge belongs to the next sensor.
NEAR, FAR = 0.25, 0.75
FACETS = 0x5BD1E995  # changes the seed of paths that begin on facets
# Parts of the radiance of a path: all, what the model shows without a reflection, and all but that
WHOLE, DIRECT, OTHER_THAN_DIRECT = "whole", "direct", "other than direct"


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
    listed: their numbers instead, in rising order. randomisations: number of randomisations of each
    window. first_point, points: the points of each randomisation. seed: seed of all random numbers.
    aim: density of the positions in each window; None for a constant one. part: what the paths
    bring; WHOLE, DIRECT or OTHER_THAN_DIRECT.

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
    listed: Sequence[int] | None = None
    aim: Aim | FacetStarts | None = None
    part: str = WHOLE

    @property
    def paths(self) -> int:
        return self.windows * self.randomisations * self.points

    @property
    def window_numbers(self) -> np.ndarray:
        """Numbers of the windows, (windows,)."""
        if self.listed is not None:
            return np.array(self.listed)
        return self.first + self.stride * np.arange(self.windows)

    def paths_from(self, sampler) -> "Paths":
        """The paths of the launch. sampler: the sensor's, which chooses the random numbers."""

        def opaque(value):
            return dr.opaque(mi.UInt32, value)

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
            self.part,
        )

    def split(self) -> "tuple[Launch, Launch]":
        """Paths that bring all but what the model shows without a reflection, and paths for that.

        The latter begin on facets, see `Aim.direct`. Their random numbers are others, and they may
        be fewer, but at least one in each randomisation.
        """
        starts, rest = self.aim.direct, replace(self.aim, direct=None)
        first, end = (n // starts.every for n in (self.first_point, self.first_point + self.points))
        those = {"first_point": first, "points": max(end - first, 1), "seed": self.seed ^ FACETS}
        return (
            replace(self, aim=rest, part=OTHER_THAN_DIRECT),
            replace(self, aim=starts, part=DIRECT, **those),
        )


@dataclass
class Paths:
    """The paths of a launch, as Dr.Jit arrays, so that one kernel serves all launches.

    lane: (paths,), number of each path. windows: (windows,), their numbers. vector: the lattice;
    None for independent numbers. aim: see `Aim.tables`. The others are those of `Launch`.
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
    aim: CellTable | FacetTable | None
    part: str = WHOLE

    def begin(self) -> tuple:
        """Sampler of each path, column and row of its window, its position there, its weight.

        Also the `FacetPoint` on which it begins, with None for the position; or None for paths that
        begin anywhere.
        """
        randomisation, point = self.lane // self.points, self.first_point + self.lane % self.points
        window = dr.gather(mi.UInt32, self.windows, randomisation // self.randomisations)
        if self.vector is None:
            first = dr.gather(mi.UInt32, self.windows, mi.UInt32(0))
            start = hashed(self.seed + hashed(first + hashed(self.first_point)))
            sampler = Random(start, self.lane)
        else:
            number = window * self.randomisations + randomisation % self.randomisations
            sampler = Lattice.at(number, point, self.seed, self.vector)
        weight, facet = mi.Float(1), None
        if isinstance(self.aim, FacetTable):
            # Evenly spaced numbers give each facet as many paths as it shall have, but for one
            position, (weight, facet) = None, self.aim.place(sampler.next_2d(), window)
        else:
            position = sampler.next_position()
            if self.aim is not None:
                position, weight = self.aim.place(position, window)
        return sampler, window % self.columns, window // self.columns, position, weight, facet


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


def views_of(sensor) -> list:
    """The sensors of a batch, or the sensor itself."""
    if sensor.class_name() != "BatchSensor":
        return [sensor]
    return [child for child in children(sensor) if isinstance(child, mi.Sensor)]


@dataclass
class ParallelRays:
    """The rays of an orthographic sensor, or of a batch of them next to each other in a film.

    A recorded launch cannot read a sensor. It gets these arrays instead, with one entry for each
    sensor, and one kernel traces the paths of any number of sensors.

    start: start of the ray at the position (NEAR, NEAR) of the sensor's film [m]. right, up: change
    of the start along the sides of the film [m]. direction: unit vector. length: length of the rays
    [m]. sensors: number of sensors.
    """

    start: mi.Point3f
    right: mi.Vector3f
    up: mi.Vector3f
    direction: mi.Vector3f
    length: mi.Float
    sensors: mi.UInt32

    @staticmethod
    def of(sensor) -> "ParallelRays | None":
        """The rays of a sensor; None if it is not orthographic."""
        kinds = views_of(sensor)
        if any(kind.class_name() != "OrthographicCamera" for kind in kinds):
            return None
        # An opaque number, so that one kernel serves any number of sensors
        count = dr.opaque(mi.UInt32, len(kinds))
        index = dr.arange(mi.UInt32, 3 * len(kinds))
        first, corner = 3 * dr.arange(mi.UInt32, len(kinds)), index % 3
        x = (mi.Float(index // 3) + dr.select(corner == 1, FAR, NEAR)) / mi.Float(count)
        position = mi.Point2f(x, dr.select(corner == 2, FAR, NEAR))
        ray, _ = sensor.sample_ray(0, 0, position, mi.Point2f(0.5))
        dr.eval(ray)
        start, at_right, at_top = (dr.gather(mi.Point3f, ray.o, first + k) for k in range(3))
        rays = ParallelRays(
            start,
            mi.Vector3f(at_right - start) / (FAR - NEAR),
            mi.Vector3f(at_top - start) / (FAR - NEAR),
            dr.gather(mi.Vector3f, ray.d, first),
            dr.gather(mi.Float, ray.maxt, first),
            count,
        )
        dr.make_opaque(rays)
        return rays

    def position(self, p: mi.Point3f, sensor: mi.UInt32) -> mi.Point2f:
        """Position in the film of a sensor at which its ray toward a point [m] begins."""
        right, up, direction = (
            dr.gather(mi.Vector3f, axis, sensor) for axis in (self.right, self.up, self.direction)
        )
        aside = p - dr.gather(mi.Point3f, self.start, sensor)
        # The sides of a window are not quite perpendicular to its rays, by rounding
        x, y = dr.cross(up, direction), dr.cross(direction, right)
        return NEAR + mi.Point2f(
            dr.dot(aside, x) / dr.dot(right, x), dr.dot(aside, y) / dr.dot(up, y)
        )

    def at(self, column, row, position, columns, rows) -> mi.Ray3f:
        """Rays at positions in the windows of the film.

        Parameters
        ----------
        column, row : mi.UInt32
            The window.
        position : mi.Point2f
            Position in the window, in 0..1.
        columns, rows : mi.UInt32
            Number of windows along the sides of the film.
        """
        of_sensor = columns // self.sensors
        sensor = column // of_sensor
        x = (mi.Float(column % of_sensor) + position.x) / mi.Float(of_sensor)
        y = (mi.Float(row) + position.y) / mi.Float(rows)

        def take(kind, values):
            return dr.gather(kind, values, sensor)

        start = (
            take(mi.Point3f, self.start)
            + (x - NEAR) * take(mi.Vector3f, self.right)
            + (y - NEAR) * take(mi.Vector3f, self.up)
        )
        direction = take(mi.Vector3f, self.direction)
        return mi.Ray3f(start, direction, take(mi.Float, self.length), 0, [])

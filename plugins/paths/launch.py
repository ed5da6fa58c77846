"""A launch: which paths are traced together, where they begin and what random numbers they use."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache, wraps
from math import sqrt

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.plugins.derivatives import attached, children, held, members, own_memory, variables
from mi_lcair.plugins.emission import triangles
from mi_lcair.plugins.emission.hot_parts import HotParts
from mi_lcair.plugins.paths.sheets import nearest_hit
from mi_lcair.plugins.samplers.lattice import VECTOR, Lattice, hashed

# Starts on facets: paths that begin where the sensor sees a drawn point of a facet
# ---------------------------------------------------------------------------------
# They follow the facets when these move. Two poses of a scene with the same random numbers are then
# compared point by point, and hardly any noise is left in their difference.


@dataclass
class StartTable:
    """The triangles on which paths may begin, as Dr.Jit arrays.

    ends: those of `Choice`, with a row for each window. rows: corner of each triangle and its two
    sides, as those of `TriangleTable` [m]. extent: diagonal of the box around all [m]. weight:
    weight of each triangle's paths in each window. shape, primitive: the triangle. windows: number
    of windows that have tables of their own; if it is 1, all share one. count: number of triangles.
    """

    ends: mi.UInt32
    rows: mi.Float
    extent: mi.Float
    weight: mi.Float
    shape: mi.UInt32
    primitive: mi.UInt32
    windows: mi.UInt32
    count: int

    def place(self, sample: mi.Point2f, window: mi.UInt32) -> tuple[mi.Float, "FacetPoint"]:
        """The weight of a path in a window, and the point that it has to hit first."""
        first = (window % self.windows) * self.count
        choice = triangles.Choice.of_ends(self.ends, self.count)
        index, sample = choice.pick_and_rest(sample, first=first)
        _, p, _ = triangles.point_on(self.rows, index, sample)
        shape, primitive = (
            dr.gather(mi.UInt32, numbers, index) for numbers in (self.shape, self.primitive)
        )
        weight = dr.gather(mi.Float, self.weight, first + index)
        return weight, FacetPoint(p, shape, primitive, self.extent)


@dataclass
class FacetPoint:
    """The point of a triangle on which a path begins.

    p: the point [m]. shape: number of the pointer to its shape. primitive: the triangle. extent:
    see `StartTable`.
    """

    p: mi.Point3f
    shape: mi.UInt32
    primitive: mi.UInt32
    extent: mi.Float

    def first_hit(self, scene, sheets, ray) -> tuple[mi.PreliminaryIntersection3f, mi.Bool]:
        """What a sensor's ray toward the point hits first, and whether that is the triangle.

        The start of the ray is known to a rounding of its coordinates, which may be more than the
        facet of a distant sensor is wide. The ray is therefore traced from the near side of the
        model, and another one from there back to the sensor.
        """
        distance = dr.dot(self.p - ray.o, ray.d)
        near = dr.minimum(distance, self.extent)
        start, before = self.p - near * ray.d, distance - near
        hit = nearest_hit(scene, sheets, mi.Ray3f(start, ray.d, ray.maxt - before, 0, []))
        hidden = scene.ray_test(mi.Ray3f(start, -ray.d, before, 0, []), before > 0)
        same = dr.reinterpret_array(mi.UInt32, hit.shape) == self.shape
        same &= hit.is_valid() & (hit.prim_index == self.primitive)
        hit.t += before
        return hit, same & ~hidden


@dataclass(frozen=True)
class FacetStarts:
    """A density of starts over the facets of a scene in one pose; in place of an `Aim`.

    tables: for `Paths`. largest_weight, largest_on_model: largest weight of a path of each window,
    (windows,), or (1,) if all have the same density. largest_direct: the largest of weight times
    radiance that is seen without a reflection, the same shape [W m^-2 sr^-1]. every: beside other
    paths, the number of these for each that begins on a facet. direct: see `Aim`.
    """

    tables: StartTable
    largest_weight: np.ndarray
    largest_on_model: np.ndarray
    largest_direct: np.ndarray
    every: int = 1
    direct: "FacetStarts | None" = None
    hot = None  # no path is reflected

    @staticmethod
    def at(meshes, corners, area, choice: triangles.Choice, direct=0.0) -> "FacetStarts":
        """Starts on the n triangles of meshes.

        Parameters
        ----------
        meshes : list of mi.Shape
        corners : ndarray, shape (n, 3, 3)
            Corners of the triangles [m].
        area : ndarray, shape (..., n)
            Their visible areas in parts of the window's area.
        choice : Choice
            Draws a triangle; with a row for each window.
        direct : ndarray, shape (n,), or float
            Upper bound of their radiance without reflections [W m^-2 sr^-1].
        """
        counts = [len(triangles.triangle_vertices(mesh)) for mesh in meshes]
        ids = [triangles.pointer_id(mi.ShapePtr(mesh)) for mesh in meshes]
        rows = np.zeros((choice.count, 3, 4))
        rows[..., :3] = corners
        rows[:, 1:] -= rows[:, :1]
        extent = float(np.linalg.norm(np.ptp(corners.reshape(-1, 3), axis=0)))
        drawn = choice.probability > 0
        weight = np.divide(area, choice.probability, out=np.zeros_like(area), where=drawn)
        weight = np.atleast_2d(weight)
        table = StartTable(
            mi.UInt32(choice.ends),
            mi.Float(rows.ravel()),
            dr.opaque(mi.Float, extent),
            mi.Float(weight.ravel()),
            mi.UInt32(np.repeat(ids, counts).astype(np.uint32)),
            mi.UInt32(np.concatenate([np.arange(n) for n in counts]).astype(np.uint32)),
            dr.opaque(mi.UInt32, len(weight)),
            choice.count,
        )
        own_memory([table.rows, table.weight, table.shape, table.primitive])
        largest = weight.max(axis=1)
        return FacetStarts(table, largest, largest, (weight * direct).max(axis=1))


# Aim: a density of the positions in a window at which paths begin
# ----------------------------------------------------------------

CELLS = 256  # cells along each side of a single window; a power of two
# Shares of the paths that begin anywhere in the window, and anywhere where the model may be. They
# bound the weights of the paths.
ANYWHERE, ON_MODEL = 0.1, 0.3


@dataclass
class CellTable:
    """Cumulative probabilities of the cells of windows, as Dr.Jit arrays.

    rows: those of the rows of each window. columns: those of the columns, for each row separately.
    windows: number of windows that have tables of their own; if it is 1, all share one. cells:
    number of cells along each side, a power of two.
    """

    rows: mi.Float
    columns: mi.Float
    windows: mi.UInt32
    cells: int

    def place(self, sample: mi.Point2f, window: mi.UInt32) -> tuple[mi.Point2f, mi.Float]:
        """A position in a window, in 0..1, and the weight of a path that begins there.

        The inverse of the cumulative density keeps the order of the numbers, and so the uniformity
        of a lattice. sample: uniform numbers. window: number of the window.
        """
        first = (window % self.windows) * self.cells
        row, y, of_row = pick(self.rows, first, sample.y, self.cells)
        column, x, of_column = pick(self.columns, (first + row) * self.cells, sample.x, self.cells)
        position = (mi.Point2f(column, row) + mi.Point2f(x, y)) / self.cells
        return position, 1 / (of_row * of_column * self.cells**2)


@dataclass(frozen=True)
class Aim:
    """A density over the cells of windows, constant in each cell.

    tables: for `Paths`. largest_weight: largest weight of a path of each window, (windows,), or
    (1,) if all have the same density. largest_on_model: the same for paths that begin where the
    model may be. may_be_model: whether the model can be in a cell, (windows, cells, cells).
    anywhere: share of the paths that begin anywhere in the window. direct: where paths begin that
    bring what the model shows without a reflection; None: all paths bring it. hot: parts toward
    which reflected rays are guided, or None.
    """

    tables: CellTable
    largest_weight: np.ndarray
    largest_on_model: np.ndarray
    may_be_model: np.ndarray
    anywhere: float
    direct: FacetStarts | None = None
    hot: HotParts | None = None

    @staticmethod
    def at(
        importance: np.ndarray,
        may_be_model: np.ndarray,
        on_model: float = ON_MODEL,
        anywhere: float = ANYWHERE,
    ) -> "Aim":
        """Aim at the important cells of one window, or of several.

        importance: numbers that are not negative, (..., cells, cells). may_be_model: whether the
        model can be in a cell, in the same shape. on_model, anywhere: share of the paths that begin
        anywhere where the model may be, and anywhere in the window.
        """
        cells = importance.shape[-1]
        may_be_model = may_be_model.reshape(-1, cells, cells)
        parts = [
            np.ones(may_be_model.shape),
            may_be_model.astype(float),
            importance.reshape(may_be_model.shape) * may_be_model,
        ]
        shares = [anywhere, on_model, 1 - anywhere - on_model]
        density = sum(share * shared_out(part) for share, part in zip(shares, parts))
        density = shared_out(density)
        of_rows = density.sum(axis=-1)
        # Where no path begins, there is no weight
        columns = divided(np.cumsum(density, axis=-1), of_rows[..., None])
        weight = divided(np.full_like(density, cells**-2.0), density)
        tables = CellTable(
            mi.Float(np.cumsum(of_rows, axis=-1).ravel()),
            mi.Float(columns.ravel()),
            dr.opaque(mi.UInt32, len(density)),
            cells,
        )
        own_memory([tables.rows, tables.columns])
        on_model = np.where(may_be_model, weight, 0.0)
        largest = weight.max(axis=(1, 2)), on_model.max(axis=(1, 2))
        return Aim(tables, *largest, may_be_model, anywhere)

    @staticmethod
    @cache
    def anywhere(cells: int = CELLS) -> "Aim":
        """The constant density."""
        return Aim.at(np.ones((cells, cells)), np.ones((cells, cells), bool))


def shared_out(part: np.ndarray) -> np.ndarray:
    """Numbers for the cells of windows, divided by their sum in each window; 0 if that is 0."""
    return divided(part, part.sum(axis=(1, 2), keepdims=True))


def divided(numbers: np.ndarray, by: np.ndarray) -> np.ndarray:
    """Quotients of numbers; 0 where the divisor is 0."""
    return np.divide(numbers, by, out=np.zeros_like(numbers), where=by > 0)


def pick(cumulative: mi.Float, first: mi.UInt32, number: mi.Float, cells: int) -> tuple:
    """The entry that a uniform number picks from `cells` cumulative probabilities.

    Returns the entry, the position of the number within it in 0..1, and its probability. `first` is
    the index at which the probabilities begin.
    """
    entry = mi.UInt32(0)
    step = cells // 2
    while step:
        below = dr.gather(mi.Float, cumulative, first + entry + (step - 1)) <= number
        entry = dr.select(below, entry + step, entry)
        step //= 2
    start = dr.gather(mi.Float, cumulative, first + entry - 1, entry > 0)
    probability = dr.gather(mi.Float, cumulative, first + entry) - start
    return entry, dr.clip((number - start) / probability, 0, 1), probability


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
            self.aim and self.aim.hot,
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
    None for independent numbers. aim: see `Aim.tables`. hot: see `Aim`. The others are those of
    `Launch`.
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
    aim: CellTable | StartTable | None
    part: str = WHOLE
    hot: HotParts | None = None

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
        if isinstance(self.aim, StartTable):
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


MOST_CAMERAS = 64  # states of cameras of which something is kept


def by_camera(function):
    """Decorator: what a function gives of an orthographic sensor is kept while that is the same.

    The keys are variables of Dr.Jit, which are kept with the results: otherwise their numbers
    would be given to others.
    """
    known = {}

    @wraps(function)
    def of_camera(sensor):
        if sensor.class_name() != "OrthographicCamera":
            return function(sensor)
        state = members(sensor)
        of_place = variables(state["to_world"].matrix)
        if attached(of_place):
            return function(sensor)
        numbers = [value for value in state.values() if isinstance(value, float)]
        of_film = [tuple(value) for value in members(state["film"]).values()]
        key = type(sensor), *numbers, *of_film, *(variable.index for variable in of_place)
        if key not in known:
            if len(known) >= MOST_CAMERAS:
                known.clear()
            known[key] = function(sensor), held(of_place)
        return known[key][0]

    return of_camera


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
    @by_camera
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


# Rounding in Float32: where a ray starts beside a surface, and the error of a radiance
# -------------------------------------------------------------------------------------
# A ray starts so far from a surface that it does not hit the surface itself. More samples do not
# reduce the error of a radiance.

UNIT = 2.0**-24  # the largest relative error of one rounding
OPERATIONS = 8  # roundings at each reflection of a path: in weights, in products and in a sum
# Distances in roundings: of the coordinates of a hit, which follow from those of three corners, and
# of lengths along the surface, which enter the distance of the next hit.
OF_POSITION, OF_SIZE = 3, 64


class Offsets:
    """Offsets of the starts of rays from the surfaces of a scene.

    of_size: part of the offset that depends on the size of a shape's triangles, by the pointer to
    the shape [m].
    """

    def __init__(self, scene):
        shapes = list(scene.shapes())
        ids = [triangles.pointer_id(mi.ShapePtr(shape)) for shape in shapes]
        of_size = np.zeros(max(ids, default=0) + 1)
        of_size[ids] = [OF_SIZE * UNIT * extent(shape) for shape in shapes]
        self.of_size = mi.Float(of_size)
        dr.make_opaque(self.of_size)

    def at(self, si) -> mi.Float:
        """Offset at a hit [m]."""
        of_size = dr.gather(mi.Float, self.of_size, dr.reinterpret_array(mi.UInt32, si.shape))
        return OF_POSITION * UNIT * dr.max(dr.abs(si.p)) + of_size

    def leave(self, si, d) -> mi.Point3f:
        """Start of a ray from the hit `si` in the direction `d`, just off the surface [m].

        Mitsuba's offset, (1 + |p|) 9e-5 m, is too large for a small part. Float32 needs an offset
        of only a few rounding errors of the coordinates and of the triangle. The start of a
        reflected ray is also moved toward the observer by the same distance. A hit on the edge
        between two walls lies on both walls, and the offset from one wall would leave the start on
        the other.
        """
        mitsuba = (1 + dr.max(dr.abs(si.p))) * mi.math.RayEpsilon
        offset = dr.minimum(mitsuba, self.at(si))
        cos = dr.dot(si.n, d)
        observer = si.to_world(si.wi)
        back = dr.select(cos * dr.dot(si.n, observer) > 0, dr.minimum(offset, 0.5 * si.t), 0)
        return dr.fma(observer, back, dr.fma(si.n, dr.mulsign(offset, cos), si.p))


def extent(shape) -> float:
    """Longest side of a shape's triangles, or a part of the diagonal of another shape's box [m].

    A hit on a sphere is computed from its radius, and has a smaller error than one on a triangle.
    An offset that is larger by d lets the part 2 d / radius of its rays, which graze it, pass by.
    """
    if not triangles.is_faceted(shape):
        box, part = shape.bbox(), 16 if shape.class_name() == "Sphere" else 4
        return float(np.linalg.norm(np.array(box.max) - np.array(box.min))) / part
    a, b, c = triangles.triangle_corners(shape)
    return max(
        float(np.linalg.norm(p - q, axis=1).max(initial=0.0)) for p, q in ((a, b), (b, c), (c, a))
    )


def rounding_error(reflections: int) -> float:
    """Relative rms error of a radiance after this number of reflections.

    The error of each rounding is assumed to be uniform up to UNIT and independent of the others. In
    an isothermal room all paths are alike and round in the same way. The mean over many paths then
    has the same error as one path.
    """
    return UNIT * sqrt(OPERATIONS * (reflections + 1) / 3)

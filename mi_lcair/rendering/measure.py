"""The loop that traces paths: measure(scene, windows, sampling, measurands) gives totals.

Everything that renders chooses windows, measurands and a criterion, and calculates with the totals.
"""

from dataclasses import replace
from functools import reduce

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.plugins.emission.emitter_table import hulls
from mi_lcair.plugins.emission.hot_parts import HotParts
from mi_lcair.plugins.emission.panels import Openings
from mi_lcair.plugins.integrators.bounce_path import AUTO
from mi_lcair.plugins.paths.launch import (
    ANYWHERE,
    CELLS,
    ON_MODEL,
    OTHER_THAN_DIRECT,
    WHOLE,
    Aim,
    Launch,
    ParallelRays,
    shared_out,
    views_of,
)
from mi_lcair.rendering.facets import starts_on_facets
from mi_lcair.rendering.measurands import (
    Criterion,
    Measurands,
    channel_count,
    check_memory,
    source_count,
)
from mi_lcair.rendering.pixels import Allocation, PixelCriterion, allocate, may_be_sent, on_workers
from mi_lcair.rendering.reflections import words_on_paths
from mi_lcair.rendering.sampling import TWO_CHOICES, Sampling
from mi_lcair.rendering.scene import Scene, changed
from mi_lcair.rendering.statistics import Totals, check_valid, student_factor
from mi_lcair.rendering.views import model_shapes
from mi_lcair.rendering.window import Windows, window_axes
from mi_lcair.tasks import has_workers

# Where in a window to begin paths, so that the mean radiance of the model has little noise
# -----------------------------------------------------------------------------------------

POINTS = 2  # paths of the pilot in each cell
CELLS_OF_MANY = 128  # cells along each side of one of many windows, which get fewer paths each
# Share of the paths that begin anywhere on the model, in one of many windows and where other paths
# begin on facets. It bounds the weight of a path that hits a source that no other path has hit.
# This weight often decides how many paths are needed.
ON_MODEL_OF_MANY = 0.7
MOST_PATHS = 2**21  # of a launch of the pilot
EDGE = 1e-3  # cells by which a rectangle is enlarged, for rounding of positions


def aim_at_model(
    scene, tracer, sensor, seed: int, measurands: Measurands, over: Aim | None = None
) -> Aim:
    """An aim at the model's facets in each view, and more at those that radiate more.

    A pilot with a few paths in each cell of the window gives the mean radiance of the model there,
    that of its brightest path, and the share of the cell that the model covers. A third of the
    density follows each of them. Averages over neighbouring cells are used, because a few paths may
    miss a thin part. Whatever the pilot misses adds noise, but no error: some paths begin anywhere.
    In a view where it meets no radiance, they begin evenly where the model may be, so that none has
    a large weight.

    Parameters
    ----------
    scene : Scene
    tracer : PathTracer
    sensor : mitsuba.Sensor
        An orthographic sensor, or a batch of them.
    seed : int
    measurands : Measurands
        The same as later, so that one kernel serves both.
    over : Aim or None
        That of `aim_over_model`, if it is known. Its `direct` is that of the aim.
    """
    over = over or aim_over_model(scene, sensor)
    cells = CellSums(tracer, sensor, seed, measurands, over)
    importance = np.zeros(over.may_be_model.shape)
    cells.trace(cells.of_model, POINTS)
    for values in cells.noted[:3]:
        importance += shared_out(blurred(cells.of_views(values)))
    importance[~cells.of_views(cells.noted[2]).any(axis=(1, 2))] = 0  # of the radiance
    on_model = ON_MODEL if len(importance) == 1 and over.direct is None else ON_MODEL_OF_MANY
    on_model += ANYWHERE - over.anywhere
    aim = Aim.at(importance, over.may_be_model, on_model, over.anywhere)
    return replace(aim, direct=over.direct)


# Paths of the second pilot in each of the most important cells of a view, and their number
POINTS_OF_IMPORTANT, IMPORTANT = 32, 512
ON_MODEL_GUIDED = 0.5  # as ON_MODEL_OF_MANY, where reflected rays are guided


def aim_at_images(
    scene, tracer, sensor, seed: int, measurands: Measurands, over: Aim
) -> Aim | None:
    """An aim at where the model shows bright parts in its reflections, with guided rays.

    The density follows the rms radiance of the cells, which gives a sum the least variance. It is
    known well only where bright paths are met. A first pilot therefore also uses the chance of each
    path to meet a hot part, which is known where none has met it. A second pilot has many paths in
    the cells that the first one finds important. The arguments are those of `aim_at_model`. None
    without `HotParts`, or where rays cannot be guided.
    """
    hot = HotParts.of(tracer.emitters) if tracer.paths.may_be_guided else None
    if hot is None:
        return None
    cells = CellSums(tracer, sensor, seed, measurands, over, hot)
    cells.trace(cells.of_model, POINTS)
    rms, of_chance = cells.rms(tracer.emitters.brightest)
    first = blurred(rms) + 0.5 * (of_chance + blurred(of_chance))
    by_cell = shared_out(first).swapaxes(0, 1).ravel()
    some = np.argsort(-by_cell)[: IMPORTANT * len(rms)]
    some = np.sort(some[by_cell[some] > 0])
    cells.trace(some, POINTS_OF_IMPORTANT, first_point=POINTS)
    is_known = np.zeros(by_cell.shape, bool)
    is_known[some] = True
    rms, of_chance = cells.rms(tracer.emitters.brightest)
    well_known = rms + 0.3 * blurred(rms) + 0.1 * of_chance
    importance = np.where(cells.of_views(is_known), well_known, first)
    on_model = ON_MODEL_GUIDED + ANYWHERE - over.anywhere
    aim = Aim.at(importance, over.may_be_model, on_model, over.anywhere)
    return replace(aim, direct=over.direct, hot=hot)


class CellSums:
    """Pilots with a window for each cell of the windows, and what they have noted.

    A row of the film is one of all windows. of_model: numbers of the cells where the model may be.
    noted: of each cell the share that the model covers, the radiance of its brightest path and the
    mean radiance [W m^-2 sr^-1], and the mean of `chance_squares` of `UnmetSource`.
    """

    def __init__(self, tracer, sensor, seed, measurands, over: Aim, hot: HotParts | None = None):
        """over: an aim over the model; the others: see `aim_at_model`."""
        self.tracer, self.sensor, self.seed = tracer, sensor, seed
        self.recorded, self.shape = measurands.with_columns(None), over.may_be_model.shape
        self.hit = "hit" if measurands.channels.split == "model" else "target.hit"
        self.part = WHOLE if over.direct is None else OTHER_THAN_DIRECT
        self.aim = replace(Aim.anywhere(self.shape[-1]), hot=hot)
        self.of_model = np.flatnonzero(over.may_be_model.swapaxes(0, 1))
        self.noted = np.zeros((4, over.may_be_model.size))

    def trace(self, cells: np.ndarray, points: int, first_point: int = 0) -> None:
        """Trace paths in some cells, and note their results in place of earlier ones."""
        rows = self.shape[-1]
        for first in range(0, len(cells), MOST_PATHS // points):
            some = cells[first : first + MOST_PATHS // points].astype(np.uint32)
            of_cells = {"windows": len(some), "listed": some, "aim": self.aim, "part": self.part}
            of_cells["first_point"] = first_point
            launch = Launch(rows * self.shape[0], rows, self.seed, 1, points, **of_cells)
            sums = self.recorded.trace(self.tracer, self.sensor, launch)
            chances = sums.unmet.get("chance_squares", np.zeros(len(some)))
            channels = sums.channels[self.hit], sums.channels["target"]
            hit, mean = (channel.ravel() / points for channel in channels)
            self.noted[:, some] = hit, sums.highest["target"], mean, chances / points

    def of_views(self, values: np.ndarray) -> np.ndarray:
        """Values of all cells, (windows, cells, cells)."""
        return values.reshape(self.shape[-1], *self.shape[:2]).swapaxes(0, 1)

    def rms(self, brightest: float) -> tuple[np.ndarray, np.ndarray]:
        """Rms radiances of the cells, about, from the paths and from chances to meet hot parts."""
        _, highest, mean, chances = map(self.of_views, self.noted)
        return np.sqrt(highest * mean), brightest * np.sqrt(chances)


def aim_over_model(scene, sensor, model_alone: bool = False) -> Aim:
    """An even aim at all cells of each view's window in which the model may be.

    model_alone: whether paths that do not begin there bring nothing, so that none are needed.
    """
    model, cells = [hulls(shape) for shape in model_shapes(scene)], cells_of(sensor)
    may_be = cells_of_model(model, views_of(sensor), cells)
    anywhere = 0.0 if model_alone and may_be.any(axis=(1, 2)).all() else ANYWHERE
    return Aim.at(np.zeros(may_be.shape), may_be, 1 - anywhere, anywhere)


def cells_of(sensor) -> int:
    """Number of cells along each side of a window."""
    return CELLS if len(views_of(sensor)) == 1 else CELLS_OF_MANY


def pilot_paths(sensor) -> int:
    """Number of paths of the pilot of `aim_at_model` in each window."""
    return POINTS * cells_of(sensor) ** 2


def cells_of_model(model: list[np.ndarray], views: list, cells: int) -> np.ndarray:
    """Whether the model can be in a cell of orthographic sensors' windows, (views, cells, cells).

    It is so in all cells that the bounding rectangle of a projected triangle touches. A triangle
    that is long and lies across the rows is therefore counted in more cells than it covers. model:
    `hulls` of its shapes.
    """
    centre = model[0][0, 0]  # near which single precision is enough
    corner, axes = (np.array(part) for part in zip(*map(window_axes, views)))
    axes *= cells
    begin = mi.Point2f(np.einsum("va,vak->kv", corner - centre, axes))
    axes = [mi.Vector3f(axes[:, :, k].T) for k in range(2)]
    # Number of rectangles over each cell: each adds 1 at its first corner and, for the cumulative
    # sums below to end there, subtracts 1 beyond its last row and column
    size, change = cells + 1, dr.zeros(mi.Int32, len(views) * (cells + 1) ** 2)
    for points in model:
        count = dr.opaque(mi.UInt32, len(points))
        lane = dr.arange(mi.UInt32, len(views) * len(points))
        view, triangle, places = lane // count, lane % count, []
        right, up = (dr.gather(mi.Vector3f, axis, view) for axis in axes)
        for corners in np.moveaxis(points - centre, 1, 0):
            p = dr.gather(mi.Vector3f, mi.Vector3f(corners.T), triangle)
            places.append(mi.Point2f(dr.dot(right, p), dr.dot(up, p)))
        first = dr.gather(mi.Point2f, begin, view)
        low = dr.floor(reduce(dr.minimum, places) - first - EDGE)
        high = dr.floor(reduce(dr.maximum, places) - first + EDGE)
        seen = dr.all((high >= 0) & (low < cells))
        start, end = (mi.Point2u(dr.clip(bound, 0, cells - 1)) for bound in (low, high))
        end += 1
        for x, y, sign in ((start, start, 1), (end, start, -1), (start, end, -1), (end, end, 1)):
            cell = (view * size + y.y) * size + x.x
            dr.scatter_add(change, mi.Int32(sign), cell, seen)
    rectangles = change.numpy().reshape(len(views), size, size)
    return rectangles.cumsum(axis=1).cumsum(axis=2)[:, :cells, :cells] > 0


def blurred(cells: np.ndarray) -> np.ndarray:
    """Averages over each cell and its eight neighbours, (windows, cells, cells)."""
    padded = np.pad(cells, ((0, 0), (1, 1), (1, 1)), mode="edge")
    size = cells.shape[-1]
    return sum(padded[:, i : i + size, j : j + size] for i in range(3) for j in range(3)) / 9


# How paths are drawn, decided by pilots where the scene leaves it open
# ---------------------------------------------------------------------
# Paths may draw emitters (`emitter_sampling`), or keep away from openings (`opening_sampling`).

# Cost of a reflection at which directions are drawn, in rays. For emitters it was measured between
# 0.6 and 2.7 in the bundled scenes. For openings it is 1.3 to 2.5, and paths that do not leave have
# up to twice as many reflections.
DRAWN_RAYS = {"emitter_sampling": 2, "opening_sampling": 4}
# Ratio of the error to the allowed error, after the first paths, from which on the paths of the
# pilots are few compared with those that are still needed
WORTH_ASKING = 3
# Cost of a ray to a facet, as a part of that of a path. Measured for an airliner.
FACET_RAY = 0.5
# Reflected rays are guided where an emitter is HOT times as bright as the model on average, and
# where so many paths are needed that a comparison pays. Few paths tell little about rare bright
# ones, so that MORE times as many are compared. The cost is that of a path, relative to another.
HOT, LEAST_GUIDED, MORE, COST_OF_GUIDED = 100.0, 2**16, 4, 1.3
PATHS_OF_A_START = 1, 8  # choices of the number of paths for each one that begins on a facet
# Randomisations of the pilots of one window. With 32, two equal variances differ by less than 1.8.
RANDOMISATIONS = 32
MOST_EXCESS = 1e60  # ratio of an error to the allowed one, in place of infinity


def cost(segments: float, drawn_rays: float = 0) -> float:
    """Cost of a path, in rays.

    It is counted and not timed, so that the load of the machine does not decide which settings are
    chosen.

    Parameters
    ----------
    segments : float
        Mean number of rays of a path.
    drawn_rays : float
        Cost of what is drawn at each reflection, in rays.
    """
    return segments + drawn_rays * max(segments - 1, 0)


def open_settings(scene, measurands, criterion) -> list[str]:
    """The settings about which a pilot decides.

    There are none where the scene says them, and for a fixed number of paths, derivatives and
    facets.
    """
    integrator = scene.mi.integrator()
    special = measurands.facets, measurands.channels.tables, measurands.reduced
    is_plain = not measurands.explored and all(entry is None for entry in special)
    if criterion is None or not is_plain or integrator.max_bounces == 0:
        return []
    return [name for name in DRAWN_RAYS if vars(integrator)[name] == AUTO]


def cheapest(scene, settings: list, windows, sampling, measurands, criterion) -> dict[str, bool]:
    """Values of open settings, of which at most one is True, that meet a criterion soonest.

    The cost is that of a path times the number of paths that a pilot finds to be needed. settings:
    from `open_settings`. The other arguments are those of `measure`.
    """
    drawn = [
        name for name in settings if name != "opening_sampling" or Openings.of(scene.mi) is not None
    ]
    # About the same paths are reflected, so that one count of their rays serves all
    counting = replace(measurands, channels=replace(measurands.channels, counts_segments=True))
    with changed(scene, **dict.fromkeys(settings, False)):
        needed, total = pilot(scene, windows, sampling, counting, criterion)
        segments = float(total.mean("segments").mean())
        costs = {None: cost(segments) * needed}
        for name in drawn:
            with changed(scene, **{name: True}):
                needed, _ = pilot(scene, windows, sampling, measurands, criterion)
            costs[name] = cost(segments, DRAWN_RAYS[name]) * needed
    best = min(costs, key=costs.get)
    return {name: name == best for name in settings}


def best_aim(scene, tracer, windows, sampling, measurands, criterion) -> Aim:
    """An aim at the model, with paths for its own emission that begin on facets, if these pay.

    That part has hardly any noise then. Where emission and reflections add up to a constant, as in
    a closed isothermal scene, paths that bring both have none. Important parts of the windows are
    looked for if more paths are needed than that takes, and images of hot parts if these pay.
    Without a model, paths begin anywhere. The arguments are those of `measure`.
    """
    if not model_shapes(scene):
        return Aim.anywhere()

    def tried(aim: Aim, *times: int) -> tuple[float, Totals]:
        return pilot(scene, windows, sampling, measurands, criterion, aim, *times)

    model_alone = measurands.channels.split == "model"
    best, starts = aim_over_model(scene, windows.sensor, model_alone), None
    paths, _ = tried(best)
    if windows.may_follow_facets and tracer.closure == "none":
        starts = starts_on_facets(scene, windows.sensor, tracer.emitters.brightest)
    for every in PATHS_OF_A_START if starts is not None else ():
        split = replace(best, direct=replace(starts, every=every))
        paths_of_split = tried(split)[0] * (1 + FACET_RAY / every)
        if paths_of_split < paths:
            best, paths = split, paths_of_split
    if paths < pilot_paths(windows.sensor):
        return best
    arguments = scene, tracer, windows.sensor, sampling.seed, measurands
    plain = aim_at_model(*arguments, best)
    if not windows.may_follow_facets:
        return plain
    paths, total = tried(plain, MORE)
    hit = "hit" if measurands.channels.split == "model" else "target.hit"
    radiance, covered = total.mean("target").sum(), total.mean(hit).sum()
    if paths < LEAST_GUIDED or tracer.emitters.brightest * covered < HOT * radiance:
        return plain
    if starts is not None and best.direct is None:
        best = replace(best, direct=replace(starts, every=PATHS_OF_A_START[-1]))
    guided = aim_at_images(*arguments, best)
    pays = guided is not None and COST_OF_GUIDED * tried(guided, MORE)[0] < paths
    return guided if pays else plain


def pilot(scene, windows, sampling, measurands, criterion, aim=None, times: int = 1) -> tuple:
    """Number of paths that a window needs, and the totals of the first paths, or of more."""
    if not windows.are_pixels:
        windows = replace(windows, randomisations=RANDOMISATIONS)
    points = min(times * windows.first_points(), windows.points(sampling.limit))
    active, rays = np.arange(windows.count), ParallelRays.of(windows.sensor)
    binning = measurands.binning(sampling.tolerance)
    with scene.prepared(measurands.by_spectrum, binning=binning) as tracer:
        criterion.check(tracer, scene.name)
        total = windows.totals(tracer, aim)
        most_rows = tracer.most_rows(measurands.channels)
        for launch in windows.launches(active, 0, points, sampling.seed, total.aim, most_rows):
            total.add(launch, measurands.trace(tracer, windows.sensor, launch, rays))
    return needed_paths(total, criterion.excess(total)), total


def needed_paths(total: Totals, excess: float | np.ndarray) -> float:
    """Mean number of paths of a window after which the error is the allowed one.

    The part of the interval that comes from scatter falls as the root of this number, and the rest
    as its inverse.

    excess: ratio of the error to the allowed error, of each window or of all.
    """
    scatter = scatter_share(total)
    square = np.minimum(excess, MOST_EXCESS) ** 2
    of_scatter, of_rest = square * scatter, square * (1 - scatter)
    # More paths know the bound of missed sources better
    now, later = (
        total.largest_unmet(target_of(total), times=times)
        for times in (1.0, np.mean(solution(of_scatter, of_rest)))
    )
    of_rest = of_rest * np.divide(later, now, out=np.ones_like(now), where=now > 0) ** 2
    return float(np.mean(solution(of_scatter, of_rest) * total.traced))


def solution(of_scatter, of_rest):
    """Positive root of x^2 = of_scatter x + of_rest."""
    return (of_scatter + np.sqrt(of_scatter**2 + 4 * of_rest)) / 2


def target_of(total: Totals) -> str | None:
    """Name of the channel of the target; None, the whole, without one."""
    return "target" if "target" in total.sums else None


def scatter_share(total: Totals) -> float | np.ndarray:
    """Part of the squared interval of each window that comes from scatter."""
    if not total.by_randomisation:
        return 1.0
    random = student_factor(total.randomisations - 1) * total.scatter_error(target_of(total))
    whole = total.half_width(target_of(total))
    return np.divide(random, whole, out=np.ones_like(whole), where=whole > 0) ** 2


# Ratio of the error to the allowed error, after the first paths, from which on the paths are aimed
# at the model. The pilots for that take up to 2^17 paths.
WORTH_AIMING = 8
# Points of each randomisation that a pass adds to a window, at least. Passes of few points would
# send the sums of a window from workers more often.
LEAST_OF_PASS = 256


def measure(
    scene: Scene,
    windows: Windows,
    sampling: Sampling,
    measurands: Measurands,
    criterion: Criterion | None = None,
    aim: Aim | None = None,
) -> Totals:
    """Trace paths through windows of a sensor until their means are known well enough.

    Parameters
    ----------
    scene : Scene
    windows : Windows
    sampling : Sampling
        Without a criterion, it sets the number of paths. Otherwise it limits their number.
    measurands : Measurands
    criterion : Criterion or None
        Paths are added to a window until its error is allowed.
    aim : Aim or None
        Where the paths begin, such as `aim` of earlier totals. None: anywhere, or at the model if
        that pays.

    Returns
    -------
    Totals
        Sums by window and randomisation.

    Raises
    ------
    InputError
        If memory does not suffice, if the criterion cannot be met, or if too many samples are NaN
        or infinite.
    """
    if criterion is None:
        sampling = sampling.settled(windows.sensor)
    elif sampling.spp is not None:
        raise InputError(TWO_CHOICES)
    windows.check(sampling)
    binning = measurands.binning(sampling.tolerance)
    with scene.prepared(measurands.by_spectrum, measurands.explored, binning) as tracer:
        kept = windows.count * (windows.randomisations if windows.by_randomisation else 1)
        if measurands.reduced:
            check_memory(kept, sources=source_count(tracer, measurands.channels))
        else:
            check_memory(kept, channel_count(tracer, measurands.channels))
        if criterion is not None:
            criterion.check(tracer, scene.name)
        result = _until_met(scene, tracer, windows, sampling, measurands, criterion, aim)
        bins = tracer.bins
    if isinstance(result, Totals):
        result.bins, result.followed = bins, words_on_paths(scene.mi.integrator())
        return result
    with changed(scene, **result):
        return measure(scene, windows, sampling, measurands, criterion, aim)


def _until_met(
    scene, tracer, windows: Windows, sampling, measurands, criterion, aim
) -> Totals | dict[str, bool]:
    """The loop of `measure`: passes through all windows that need more paths.

    A pilot decides after the first paths on settings that the scene leaves open. If it finds that
    one of them pays, their values are returned, with which to begin again.
    """
    # The results by facet and a sensor of several views need a constant density
    may_aim = aim is None and measurands.facets is None and windows.may_be_aimed
    total, rays = windows.totals(tracer, aim), ParallelRays.of(windows.sensor)
    if criterion is None:
        goal = limit = -(-windows.paths(sampling) // windows.randomisations)
    else:
        settings = open_settings(scene, measurands, criterion)
        limit = windows.points(sampling.limit)
        goal = min(windows.first_points(), limit)
    done, scale = 0, windows.randomisations * windows.parts
    allocation: Allocation | None = None  # None: all windows have as many points
    may_share = isinstance(criterion, PixelCriterion) and tracer.closure != "tail"
    # The windows that need more paths, with the ratios and the points of the last estimate
    active, last, before = np.arange(windows.count), np.zeros(windows.count), 0
    most_rows = tracer.most_rows(measurands.channels)
    while done < goal:
        points = min(goal - done, max(windows.points_of_pass(len(active)), LEAST_OF_PASS))
        spans = [(active, done, points)]
        if allocation is not None:
            spans = allocation.spans(active, done, done + points)
        launches = [
            launch
            for some, first, more in spans
            for launch in windows.launches(some, first, more, sampling.seed, total.aim, most_rows)
        ]
        if windows.are_pixels and has_workers() and may_be_sent(scene, windows, measurands):
            sums = on_workers(scene, windows, measurands, sampling.tolerance, launches)
        else:
            sums = (measurands.trace(tracer, windows.sensor, of, rays) for of in launches)
        for number, (launch, of_launch) in enumerate(zip(launches, sums)):
            total.add(launch, of_launch)
            if sampling.progress and number:
                part = done + points * number / len(launches)
                sampling.progress(int(part * scale), goal * scale)
        done += points
        check_valid(total.invalid, int(total.traced.sum()), scene.name)
        if criterion is not None and done >= goal:
            needed = total.excess = np.broadcast_to(criterion.excess(total), windows.count)
            aims = may_aim and needed.max() > WORTH_AIMING
            if aims:
                aim = best_aim(scene, tracer, windows, sampling, measurands, criterion)
            # Where rays are guided, no other setting pays
            asks = settings and needed.max() > WORTH_ASKING and not (aims and aim.hot)
            if asks:
                best = cheapest(scene, settings, windows, sampling, measurands, criterion)
                if any(best.values()):
                    return best
            settings = []
            if not windows.are_pixels:
                # The error of a lattice falls at most as 1 / points. A smaller estimate is luck,
                # and to end there would state too small an error too often.
                needed = np.maximum(needed, last * before / done)
            last, before = np.minimum(needed, MOST_EXCESS) * np.sqrt(scatter_share(total)), done
            more = active[needed[active] > 1]
            if len(more):
                active, goal = more, min(limit, windows.next_points(done, needed[more].min()))
                if may_share:
                    shared, needed_points = allocate(total, criterion, windows.size, done, limit)
                    goal = int(min(goal, np.ceil(needed_points)))
                    if shared is not None:
                        # From here on numbers of points are means. They begin with the pilot's.
                        allocation, may_share, done = shared, False, 0
            if aims:
                # Begin again in all windows, with the same number of paths
                total, may_aim = windows.totals(tracer, aim), False
                active, last = np.arange(windows.count), np.zeros(windows.count)
                goal, done = done, 0
        if sampling.progress:
            sampling.progress(done * scale, goal * scale)
    return total

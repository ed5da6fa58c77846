"""Where in a window to begin paths, so that the mean radiance of the model has little noise."""

from dataclasses import replace
from functools import reduce

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.plugins.emission.emitter_table import hulls
from mi_lcair.plugins.paths.aim import ANYWHERE, CELLS, ON_MODEL, Aim, shared_out
from mi_lcair.plugins.paths.launch import OTHER_THAN_DIRECT, WHOLE, Launch, views_of
from mi_lcair.rendering.measurands import Measurands
from mi_lcair.rendering.views import model_shapes
from mi_lcair.rendering.window import window_axes

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
    views, cells = views_of(sensor), cells_of(sensor)
    columns, recorded = cells * len(views), measurands.with_columns(None)
    hit = "hit" if measurands.channels.split == "model" else "target.hit"
    part = WHOLE if over.direct is None else OTHER_THAN_DIRECT
    # A row of the film is one of all windows
    seen = np.flatnonzero(over.may_be_model.swapaxes(0, 1)).astype(np.uint32)
    noted = np.zeros((3, cells * columns))
    for first in range(0, len(seen), MOST_PATHS // POINTS):
        some = seen[first : first + MOST_PATHS // POINTS]
        of_cells = {"windows": len(some), "listed": some, "aim": Aim.anywhere(cells), "part": part}
        sums = recorded.trace(tracer, sensor, Launch(columns, cells, seed, 1, POINTS, **of_cells))
        values = sums.channels[hit], sums.highest["target"], sums.channels["target"]
        noted[:, some] = [np.ravel(of_some) for of_some in values]
    importance = np.zeros((len(views), cells, cells))
    for values in noted.reshape(3, cells, len(views), cells).swapaxes(1, 2):
        importance += shared_out(blurred(values))
    importance[~values.any(axis=(1, 2))] = 0  # of the radiance
    on_model = ON_MODEL if len(views) == 1 and over.direct is None else ON_MODEL_OF_MANY
    on_model += ANYWHERE - over.anywhere
    aim = Aim.at(importance, over.may_be_model, on_model, over.anywhere)
    return replace(aim, direct=over.direct)


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

"""Where in a window to begin paths, so that the mean radiance of the model has little noise."""

from dataclasses import replace

import numpy as np

from mi_lcair.plugins.emission.emitter_table import hulls
from mi_lcair.plugins.paths.aim import ANYWHERE, CELLS, ON_MODEL, Aim, shared_out
from mi_lcair.plugins.paths.facet_starts import FacetStarts
from mi_lcair.plugins.paths.launch import OTHER_THAN_DIRECT, WHOLE, Launch, views_of
from mi_lcair.rendering.measurands import Measurands
from mi_lcair.rendering.views import model_shapes
from mi_lcair.rendering.window import window

POINTS = 2  # paths of the pilot in each cell
CELLS_OF_MANY = 128  # cells along each side of one of many windows, which get fewer paths each
# Share of the paths that begin anywhere on the model in one of many windows, and beside paths that
# begin on facets. It bounds the weight of a path that meets what no other has met, which often
# decides on the number of paths.
ON_MODEL_OF_MANY = 0.7
MOST_PATHS = 2**21  # of a launch of the pilot
EDGE = 1e-3  # cells by which a rectangle is enlarged, for rounding of positions


def aim_at_model(
    scene, tracer, sensor, seed: int, measurands: Measurands, direct: FacetStarts | None = None
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
    direct : FacetStarts or None
        Where paths begin that bring what the model shows without a reflection; `direct` of the aim.
    """
    views, cells = views_of(sensor), cells_of(sensor)
    columns, recorded = cells * len(views), measurands.with_columns(None)
    hit = "hit" if measurands.channels.split == "model" else "target.hit"
    rows_at_once, parts = max(1, MOST_PATHS // (columns * POINTS)), []
    for row in range(0, cells, rows_at_once):
        some = {"first": row * columns, "windows": min(rows_at_once, cells - row) * columns}
        some["part"] = WHOLE if direct is None else OTHER_THAN_DIRECT
        launch = Launch(columns, cells, seed, 1, POINTS, **some, aim=Aim.anywhere(cells))
        sums = recorded.trace(tracer, sensor, launch)
        of_rows = sums.channels[hit], sums.highest["target"], sums.channels["target"]
        parts.append([np.ravel(values) for values in of_rows])
    importance = np.zeros((len(views), cells, cells))
    for values in map(np.concatenate, zip(*parts)):
        of_cells = values.reshape(cells, len(views), cells).swapaxes(0, 1)
        importance += shared_out(blurred(of_cells))
    importance[~of_cells.any(axis=(1, 2))] = 0  # of the radiance
    on_model = ON_MODEL if len(views) == 1 and direct is None else ON_MODEL_OF_MANY
    return replace(Aim.at(importance, may_be_model(scene, sensor), on_model), direct=direct)


def aim_over_model(scene, sensor) -> Aim:
    """An even aim at all cells of each view's window in which the model may be."""
    cells = may_be_model(scene, sensor)
    return Aim.at(np.zeros(cells.shape), cells, 1 - ANYWHERE)


def cells_of(sensor) -> int:
    """Number of cells along each side of a window."""
    return CELLS if len(views_of(sensor)) == 1 else CELLS_OF_MANY


def pilot_paths(sensor) -> int:
    """Number of paths of the pilot of `aim_at_model` in each window."""
    return POINTS * cells_of(sensor) ** 2


def may_be_model(scene, sensor) -> np.ndarray:
    """Whether a scene's model may be in a cell, (views, cells, cells)."""
    model = [hulls(shape) for shape in model_shapes(scene)]
    return np.array([cells_of_model(model, view, cells_of(sensor)) for view in views_of(sensor)])


def cells_of_model(model: list[np.ndarray], sensor, cells: int) -> np.ndarray:
    """Whether the model can be in a cell of an orthographic sensor's window, (cells, cells).

    It is so in all cells that the bounding rectangle of a projected triangle touches. A triangle
    that is long and lies across the rows is therefore counted in more cells than it covers. model:
    `hulls` of its shapes.
    """
    corner, right, up, _ = window(sensor)
    axes = np.stack([right / (right @ right), up / (up @ up)], axis=1) * cells
    # Number of rectangles over each cell: each adds 1 at its first corner and, for the cumulative
    # sums below to end there, subtracts 1 beyond its last row and column
    size = cells + 1
    change = np.zeros(size**2)
    for points in model:
        position = points @ axes - corner @ axes  # (triangles, points, 2)
        low, high = np.floor(position.min(axis=1) - EDGE), np.floor(position.max(axis=1) + EDGE)
        seen = np.all((high >= 0) & (low < cells), axis=1)
        (x0, y0), (x1, y1) = (
            np.clip(bound[seen].T, 0, cells - 1).astype(int) for bound in (low, high)
        )
        for y, x, sign in ((y0, x0, 1), (y0, x1 + 1, -1), (y1 + 1, x0, -1), (y1 + 1, x1 + 1, 1)):
            change += sign * np.bincount(y * size + x, minlength=size**2)
    return change.reshape(size, size).cumsum(axis=0).cumsum(axis=1)[:cells, :cells] > 0.5


def blurred(cells: np.ndarray) -> np.ndarray:
    """Averages over each cell and its eight neighbours, (windows, cells, cells)."""
    padded = np.pad(cells, ((0, 0), (1, 1), (1, 1)), mode="edge")
    size = cells.shape[-1]
    return sum(padded[:, i : i + size, j : j + size] for i in range(3) for j in range(3)) / 9

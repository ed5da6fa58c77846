"""Where in a window to begin paths, so that the mean radiance of the model has little noise."""

import numpy as np

from mi_lcair.plugins.emission.emitter_table import hulls
from mi_lcair.plugins.emitters.thermal_emitter import facet_type_of
from mi_lcair.plugins.paths.aim import CELLS, Aim
from mi_lcair.plugins.paths.launch import Launch
from mi_lcair.rendering.measurands import Measurands
from mi_lcair.rendering.window import window

POINTS = 4  # paths of the pilot in each cell
EDGE = 1e-3  # cells by which a rectangle is enlarged, for rounding of positions


def aim_at_model(scene, tracer, sensor, seed: int, measurands: Measurands) -> Aim:
    """An aim at the model's facets, and more at those that radiate more.

    A pilot with a few paths in each cell of the window gives the mean radiance of the model there
    and the share of the cell that it covers. Half of the density follows each of them. Averages
    over neighbouring cells are used, because a few paths may miss a thin part. Whatever the pilot
    misses adds noise, but no error: some paths begin anywhere.

    Parameters
    ----------
    scene : Scene
    tracer : PathTracer
    sensor : mitsuba.Sensor
        An orthographic sensor.
    seed : int
    measurands : Measurands
        The same as later, so that one kernel serves both.
    """
    launch = Launch(
        columns=CELLS,
        rows=CELLS,
        seed=seed,
        randomisations=1,
        points=POINTS,
        windows=CELLS**2,
        aim=Aim.anywhere(),
    )
    channels = measurands.with_columns(None).trace(tracer, sensor, launch).channels
    hit = channels["hit" if measurands.channels.split == "model" else "target.hit"]
    importance = np.zeros((CELLS, CELLS))
    for values in (hit, channels["target"]):
        of_cells = values.reshape(CELLS, CELLS)
        if of_cells.sum() > 0:
            importance += blurred(of_cells) / of_cells.sum()
    return Aim.at(importance, cells_of_model(scene, sensor))


def cells_of_model(scene, sensor) -> np.ndarray:
    """Whether the model can be in a cell of an orthographic sensor's window, (CELLS, CELLS).

    It is so in all cells that the bounding rectangle of a projected triangle touches. A triangle
    that is long and lies across the rows is therefore counted in more cells than it covers.
    """
    corner, right, up, _ = window(sensor)
    axes = np.stack([right / (right @ right), up / (up @ up)], axis=1)
    # Number of rectangles over each cell: each adds 1 at its first corner and, for the cumulative
    # sums below to end there, subtracts 1 beyond its last row and column
    change = np.zeros((CELLS + 1, CELLS + 1))
    for shape in scene.mi.shapes():
        if facet_type_of(shape.emitter()) != "model":
            continue
        position = (hulls(shape) - corner) @ axes * CELLS  # (triangles, points, 2)
        low, high = np.floor(position.min(axis=1) - EDGE), np.floor(position.max(axis=1) + EDGE)
        seen = np.all((high >= 0) & (low < CELLS), axis=1)
        (x0, y0), (x1, y1) = (
            np.clip(bound[seen].T, 0, CELLS - 1).astype(int) for bound in (low, high)
        )
        for y, x, sign in ((y0, x0, 1), (y0, x1 + 1, -1), (y1 + 1, x0, -1), (y1 + 1, x1 + 1, 1)):
            np.add.at(change, (y, x), sign)
    return change.cumsum(axis=0).cumsum(axis=1)[:CELLS, :CELLS] > 0.5


def blurred(cells: np.ndarray) -> np.ndarray:
    """Averages over each cell and its eight neighbours."""
    padded = np.pad(cells, 1, mode="edge")
    size = len(cells)
    return sum(padded[i : i + size, j : j + size] for i in range(3) for j in range(3)) / 9

"""Aim: a density of the positions in a window at which paths begin."""

from dataclasses import dataclass
from functools import cache

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.plugins.derivatives import own_memory
from mi_lcair.plugins.paths.facet_starts import FacetStarts

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
    bring what the model shows without a reflection; None: all paths bring it.
    """

    tables: CellTable
    largest_weight: np.ndarray
    largest_on_model: np.ndarray
    may_be_model: np.ndarray
    anywhere: float
    direct: FacetStarts | None = None

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

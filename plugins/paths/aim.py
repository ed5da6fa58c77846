"""Aim: a density of the positions in a window at which paths begin."""

from dataclasses import dataclass
from functools import cache

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.plugins.derivatives import own_memory

CELLS = 256  # cells along each side of the window; a power of two
# Shares of the paths that begin anywhere in the window, and anywhere where the model may be. They
# bound the weights of the paths.
ANYWHERE, ON_MODEL = 0.1, 0.3


@dataclass(frozen=True)
class Aim:
    """A density over the cells of a window, constant in each cell.

    rows: cumulative probability of the rows, (CELLS,). columns: that of the columns, for each row
    separately, (CELLS * CELLS,). largest_weight: largest weight of a path. largest_on_model: the
    same for paths that begin where the model may be.
    """

    rows: mi.Float
    columns: mi.Float
    largest_weight: float
    largest_on_model: float

    @staticmethod
    def at(importance: np.ndarray, may_be_model: np.ndarray) -> "Aim":
        """Aim at the important cells of a window.

        importance: numbers that are not negative, (CELLS, CELLS). may_be_model: whether the model
        can be in a cell, (CELLS, CELLS).
        """
        parts = [np.ones((CELLS, CELLS)), may_be_model.astype(float), importance * may_be_model]
        shares = [ANYWHERE, ON_MODEL, 1 - ANYWHERE - ON_MODEL]
        density = sum(share * part / part.sum() for share, part in zip(shares, parts) if part.any())
        density /= density.sum()
        of_rows = density.sum(axis=1)
        columns = np.cumsum(density, axis=1) / of_rows[:, None]
        weight = CELLS**-2.0 / density
        tables = mi.Float(np.cumsum(of_rows)), mi.Float(columns.ravel())
        own_memory(tables)
        return Aim(
            *tables,
            float(weight.max()),
            float(weight[may_be_model].max(initial=0.0)),
        )

    @staticmethod
    @cache
    def anywhere() -> "Aim":
        """The constant density."""
        return Aim.at(np.ones((CELLS, CELLS)), np.ones((CELLS, CELLS), bool))

    @property
    def tables(self) -> tuple[mi.Float, mi.Float]:
        """`rows` and `columns`, for `place`."""
        return self.rows, self.columns


def place(rows: mi.Float, columns: mi.Float, sample: mi.Point2f) -> tuple[mi.Point2f, mi.Float]:
    """A position in the window, in 0..1, and the weight of a path that begins there.

    The inverse of the cumulative density keeps the order of the numbers, and so the uniformity of a
    lattice. rows, columns: as for `Aim`. sample: uniform numbers.
    """
    row, y, of_row = pick(rows, mi.UInt32(0), sample.y)
    column, x, of_column = pick(columns, row * CELLS, sample.x)
    position = (mi.Point2f(column, row) + mi.Point2f(x, y)) / CELLS
    return position, 1 / (of_row * of_column * CELLS**2)


def pick(cumulative: mi.Float, first: mi.UInt32, number: mi.Float) -> tuple:
    """The entry that a uniform number picks from CELLS cumulative probabilities.

    Returns the entry, the position of the number within it in 0..1, and its probability. `first` is
    the index at which the probabilities begin.
    """
    entry = mi.UInt32(0)
    step = CELLS // 2
    while step:
        below = dr.gather(mi.Float, cumulative, first + entry + (step - 1)) <= number
        entry = dr.select(below, entry + step, entry)
        step //= 2
    start = dr.gather(mi.Float, cumulative, first + entry - 1, entry > 0)
    probability = dr.gather(mi.Float, cumulative, first + entry) - start
    return entry, dr.clip((number - start) / probability, 0, 1), probability

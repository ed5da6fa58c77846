"""Blocks of bins: four neighbouring bins of wavelength, which paths read and multiply at once.

Tables have their bins last, so that one gather finds the numbers of a block.
"""

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.plugins.derivatives import own_memory

SIZE = 4  # bins of a block, the entries of mi.Vector4f


def blocks_of(count: int) -> int:
    """Number of blocks that hold a number of bins."""
    return -(-count // SIZE)


def in_blocks(values, beyond: str = "edge") -> mi.Float:
    """Table of values (..., bins) whose last block is filled with the last bin, or "constant" 0."""
    values = np.asarray(values, dtype=float)
    missing = -values.shape[-1] % SIZE
    array = mi.Float(np.pad(values, [(0, 0)] * (values.ndim - 1) + [(0, missing)], beyond).ravel())
    own_memory([array])
    return array


def gathered(table: mi.Float, index) -> mi.Vector4f:
    """A block of a table, by its number in it."""
    return dr.gather(mi.Vector4f, table, index)


def interpolated(table: mi.Float, place: tuple, blocks: int, block) -> mi.Vector4f:
    """A block of a table (rows, nodes, bins) at a place from `between_nodes`."""
    node, way = place
    index = node * blocks + block
    return dr.lerp(gathered(table, index), gathered(table, index + blocks), way)

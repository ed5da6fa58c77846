"""Tables by blocks of bins against NumPy's interpolation."""

import mitsuba as mi
import numpy as np
import pytest

from mi_lcair.plugins.bins import blocks
from mi_lcair.plugins.bsdfs.uniform_table import between_nodes


@pytest.mark.parametrize("count", [1, 4, 7])
def test_interpolation_in_rows(count):
    random, rows, steps = np.random.default_rng(count), 3, 6
    values = random.uniform(size=(rows, steps + 1, count))
    table, number = blocks.in_blocks(values), blocks.blocks_of(count)
    row, x = random.integers(0, rows, 50), np.append(random.uniform(size=48), [0, 1])
    place = between_nodes(mi.UInt32(row), mi.Float(x), steps)
    found = [blocks.interpolated(table, place, number, mi.UInt32(k)) for k in range(number)]
    nodes = np.linspace(0, 1, steps + 1)
    expected = [
        [np.interp(a, nodes, values[r, :, k]) for r, a in zip(row, x)] for k in range(count)
    ]
    # The last block is filled with the last bin
    expected += [expected[-1]] * (number * blocks.SIZE - count)
    assert np.concatenate(found) == pytest.approx(np.array(expected), abs=1e-6)


def test_shares_beyond_the_last_bin_are_zero():
    assert blocks.in_blocks([[1, 2], [3, 4]], "constant").numpy().tolist() == [
        1,
        2,
        0,
        0,
        3,
        4,
        0,
        0,
    ]

"""Tables over 0..1 with evenly spaced nodes: linear interpolation and cubic refinement."""

import drjit as dr
import mitsuba as mi


def interpolate(table, x):
    """Linear interpolation at `x` in a table with evenly spaced nodes over 0 <= x <= 1."""
    return interpolate_row(table, mi.UInt32(0), dr.width(table) - 1, x)


def interpolate_row(tables, row, steps: int, x):
    """Linear interpolation at `x` in one of several tables, which follow each other.

    row: number of the table. steps: steps of each table.
    """
    node, way = between_nodes(row, x, steps)
    return dr.lerp(dr.gather(mi.Float, tables, node), dr.gather(mi.Float, tables, node + 1), way)


def between_nodes(row, x, steps: int) -> tuple[mi.UInt32, mi.Float]:
    """The node at or before `x` among the even nodes over 0..1 of a row, and the way to the next.

    Nodes are counted over all rows, of which each has steps + 1.
    """
    x = x * steps
    index = dr.minimum(mi.UInt32(x), steps - 1)
    return row * (steps + 1) + index, x - mi.Float(index)


def gather(table, index):
    """Entries of a table, with derivatives that hold if the table is itself a result of `gather`.

    In its default mode Dr.Jit 1.5 sums the gradients of a gather in one copy of the table for each
    thread. Where the table was gathered too, that sum is now and then lost (LLVM).
    """
    return dr.gather(type(table), table, index, mode=dr.ReduceMode.Local)


def refine(table, factor: int):
    """The table with each step divided into `factor` steps; derivatives are kept.

    New nodes lie on the cubic through the four old nodes nearest to them. At the ends the cubic of
    the neighbouring step is used. The table must have at least four nodes.
    """
    Float, steps = type(table), dr.width(table) - 1
    node = dr.arange(mi.UInt32, steps * factor + 1)
    first = dr.clip(mi.Int32(node // factor) - 1, 0, steps - 3)
    x = Float(node) / factor - Float(first)
    # Lagrange's weights for nodes at 0, 1, 2 and 3
    weights = (
        (x - 1) * (x - 2) * (3 - x) / 6,
        x * (x - 2) * (x - 3) / 2,
        x * (x - 1) * (3 - x) / 2,
        x * (x - 1) * (x - 2) / 6,
    )

    def neighbour(k):
        return gather(table, mi.UInt32(first + k))

    return sum(weight * neighbour(k) for k, weight in enumerate(weights))

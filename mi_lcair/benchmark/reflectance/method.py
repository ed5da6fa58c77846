"""The interface of a method, and the lanes on which it works."""

from collections.abc import Callable
from dataclasses import dataclass

import drjit as dr
from drjit.llvm import Float64, UInt32


@dataclass(frozen=True)
class Method:
    """A way to estimate a DHR.

    name, section: what a chart calls it, and where the thesis describes it ("" where it does not).
    efforts: those worth charting, rising. samples(effort): evaluations of the BRDF. run(problem,
    effort, repetitions, seed): that many independent estimates, a Float64 array, in one vectorised
    launch.
    """

    name: str
    section: str
    efforts: tuple[int, ...]
    samples: Callable[[int], int]
    run: Callable[..., Float64]


def lanes(samples: int, repetitions: int) -> tuple[UInt32, UInt32]:
    """Which repetition and which of its samples each lane works on, one repetition after the other."""
    lane = dr.arange(UInt32, samples * repetitions)
    count = dr.opaque(UInt32, samples)  # a literal would be compiled anew for each effort
    repetition = lane // count
    return repetition, lane - repetition * count


def mean(values: Float64, samples: int) -> Float64:
    """The mean over the samples of each repetition."""
    return dr.block_sum(values, samples) / samples


def grid(sample: UInt32, rows: int, columns: int) -> tuple[Float64, Float64]:
    """Midpoints of a rows x columns grid over the unit square: (row, column) coordinates of each
    sample.
    """
    rows, columns = dr.opaque(UInt32, rows), dr.opaque(UInt32, columns)
    row = sample // columns
    return (Float64(row) + 0.5) / Float64(rows), (Float64(sample - row * columns) + 0.5) / Float64(
        columns
    )

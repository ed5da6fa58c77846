"""Interface of the methods, and the arrangement of their samples in arrays."""

from collections.abc import Callable
from dataclasses import dataclass

import drjit as dr
from drjit.llvm import Float64, UInt32

RANDOM_EFFORTS = (250, 1000, 4000, 16000, 64000, 250000, 1000000)  # of the thesis's random methods


@dataclass(frozen=True)
class ReflectanceMethod:
    """A method that estimates a directional-hemispherical reflectance (DHR).

    Attributes
    ----------
    name
        Name in the charts.
    section
        Section of the thesis that describes it, or "" for a method of this project.
    efforts
        Efforts that are charted, in ascending order.
    run
        run(problem, effort, repetitions, seed) returns that many independent estimates, a Float64
        array. They are computed in one vectorised launch.
    samples
        samples(effort) returns the number of evaluations of the BRDF; by default the effort.
    """

    name: str
    section: str
    efforts: tuple[int, ...]
    run: Callable[..., Float64]
    samples: Callable[[int], int] = int


def lanes(samples: int, repetitions: int) -> tuple[UInt32, UInt32]:
    """Return for each lane of an array its repetition and the number of its sample.

    All samples of one repetition come before those of the next.
    """
    lane = dr.arange(UInt32, samples * repetitions)
    count = dr.opaque(UInt32, samples)  # a literal would be compiled anew for each effort
    repetition = lane // count
    return repetition, lane - repetition * count


def mean(values: Float64, samples: int) -> Float64:
    """Return the mean over the samples of each repetition."""
    return dr.block_sum(values, samples) / samples


def grid(sample: UInt32, rows: int, columns: int) -> tuple[Float64, Float64]:
    """Return the midpoints of a rows x columns grid over the unit square.

    They are the coordinates of each sample along rows and along columns.
    """
    rows, columns = dr.opaque(UInt32, rows), dr.opaque(UInt32, columns)
    row = sample // columns
    return (Float64(row) + 0.5) / Float64(rows), (Float64(sample - row * columns) + 0.5) / Float64(
        columns
    )

"""Sums over the paths of a launch, for each window and randomisation."""

from dataclasses import dataclass, replace
from functools import reduce
from math import gcd

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.plugins.paths.launch import Launch
from mi_lcair.plugins.paths.tail import Tail
from mi_lcair.plugins.recorders.unmet_source import UnmetSource

# Consecutive values summed in Float32, before sums in Float64. A Float32 sum of 16,000 equal
# numbers has an error of 1e-5.
SUMMED_IN_FLOAT32 = 8
FEW_BLOCKS = 4  # NumPy sums so short a last axis several times slower than it adds arrays
EXTREMES = ("target",)  # channels of which the darkest and the brightest path are known


@dataclass(frozen=True)
class Sums:
    """Sums over the points of each randomisation, (windows, randomisations), NumPy Float64.

    All but `valid` are weighted sums. NaN and infinite samples are left out. valid: number of the
    other samples. radiance: their sum [W m^-2 sr^-1]. channels: sums of the channels by name, see
    `Channels`. lowest, highest: the darkest and the brightest path of each window, (windows,)
    [W m^-2 sr^-1], for `radiance` and for the channels in EXTREMES. chance: largest contribution of
    a source that a path of the window could have hit but did not hit, (windows,) [W m^-2 sr^-1].
    draws: number of directions drawn toward emitters, times the throughput, (windows,). tail: sums
    for closure = tail; None for another closure.
    """

    valid: np.ndarray
    radiance: np.ndarray
    channels: dict[str, np.ndarray]
    lowest: dict[str, np.ndarray]
    highest: dict[str, np.ndarray]
    chance: np.ndarray
    draws: np.ndarray
    tail: Tail | None

    @staticmethod
    def of(blocks: "BlockSums", tail: Tail | None, launch: Launch) -> "Sums":
        """The sums of a launch, from those over its blocks of `block_size` paths."""

        def total(values):
            of_blocks = values.numpy().reshape(launch.windows, launch.randomisations, -1)
            if of_blocks.shape[-1] <= FEW_BLOCKS:
                return reduce(np.add, np.moveaxis(of_blocks, -1, 0).astype(np.float64))
            return of_blocks.sum(axis=-1, dtype=np.float64)

        def of_windows(values) -> np.ndarray:
            if values is None:
                return np.zeros((launch.windows, 1))
            # In the order in which NumPy finds the extremes of many short rows fast
            return np.asfortranarray(values.numpy().reshape(launch.windows, -1), dtype=float)

        return Sums(
            valid=total(blocks.valid),
            radiance=total(blocks.radiance),
            channels={name: total(values) for name, values in blocks.channels.items()},
            lowest={name: of_windows(v).min(axis=1) for name, v in blocks.lowest.items()},
            highest={name: of_windows(v).max(axis=1) for name, v in blocks.highest.items()},
            chance=of_windows(blocks.chance).max(axis=1),
            draws=of_windows(blocks.draws).sum(axis=1),
            tail=tail,
        )

    def without(self, names) -> "Sums":
        """These sums without the channels of these names, and without their parts on the model."""
        unwanted = {prefix + name for name in names for prefix in ("", "target.")}
        kept = {name: value for name, value in self.channels.items() if name not in unwanted}
        return replace(self, channels=kept)


def block_size(launch: Launch) -> int:
    """Number of consecutive points that are summed in Float32."""
    return gcd(launch.points, SUMMED_IN_FLOAT32)


@dataclass
class BlockSums:
    """Sums over blocks of consecutive paths, as Dr.Jit arrays; the fields are those of `Sums`."""

    valid: mi.Float
    radiance: mi.Float
    channels: dict[str, mi.Float]
    lowest: dict[str, mi.Float]
    highest: dict[str, mi.Float]
    chance: mi.Float | None
    draws: mi.Float | None

    @staticmethod
    def of(L, channels: dict, weight, unmet: UnmetSource | None, size: int) -> "BlockSums":
        """Sums of samples.

        Parameters
        ----------
        L : mi.Float
            Radiance of each path [W m^-2 sr^-1].
        channels : dict of str to mi.Float
        weight : mi.Float
            Weight of each path, see `Aim`.
        unmet : UnmetSource or None
            What a source would add that the path did not hit; None for 0.
        size : int
            Paths in a block.
        """
        finite = dr.isfinite(L)
        radiance = dr.select(finite, L * weight, 0)
        weighted = {name: dr.select(finite, value * weight, 0) for name, value in channels.items()}
        extremes = {"radiance": radiance}
        extremes |= {name: weighted[name] for name in EXTREMES if name in weighted}
        samples = BlockSums(
            dr.select(finite, mi.Float(1), 0),
            radiance,
            weighted,
            extremes,
            extremes,
            None if unmet is None else unmet.largest * weight,
            None if unmet is None else unmet.draws * weight,
        )
        # One kernel for all arrays, which would otherwise trace the paths again and again
        dr.eval(samples)

        def extreme(values: dict, kind) -> dict:
            return {name: dr.block_reduce(kind, array, size) for name, array in values.items()}

        chance, draws = samples.chance, samples.draws
        sums = BlockSums(
            dr.block_sum(samples.valid, size),
            dr.block_sum(samples.radiance, size),
            {name: dr.block_sum(value, size) for name, value in samples.channels.items()},
            extreme(samples.lowest, dr.ReduceOp.Min),
            extreme(samples.highest, dr.ReduceOp.Max),
            None if chance is None else dr.block_reduce(dr.ReduceOp.Max, chance, size),
            None if draws is None else dr.block_sum(draws, size),
        )
        dr.eval(sums)
        return sums

"""Sums over the paths of a launch, for each window and randomisation."""

from dataclasses import dataclass, replace
from functools import reduce
from math import gcd

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.plugins.paths.launch import Launch
from mi_lcair.plugins.paths.tail import Tail
from mi_lcair.plugins.recorders.unmet_source import LARGEST, SUMMED, UnmetSource

# Consecutive values summed in Float32, before sums in Float64. A Float32 sum of 16,000 equal
# numbers has an error of 1e-5.
SUMMED_IN_FLOAT32 = 8
FEW_BLOCKS = 4  # NumPy sums so short a last axis several times slower than it adds arrays
NO_RADIANCE = "range", "hit", "segments"  # channels that are not parts of the radiance
EXTREMES = ("radiance", "target")  # what of which the darkest and the brightest path are known


@dataclass(frozen=True)
class Sums:
    """Sums over the points of each randomisation, (windows, randomisations), NumPy Float64.

    All but `valid` are weighted sums. NaN and infinite samples are left out. valid: number of the
    other samples. radiance: their sum [W m^-2 sr^-1]. channels: sums of the channels by name, see
    `Channels`. lowest, highest: the darkest and the brightest path of each window, (windows,)
    [W m^-2 sr^-1], for `radiance` and for the channels in EXTREMES. unmet: what sources would add
    that a path could have hit but did not hit, (windows,), by the names of `UnmetSource`. tail:
    sums for closure = tail; None for another closure.
    """

    valid: np.ndarray
    radiance: np.ndarray
    channels: dict[str, np.ndarray]
    lowest: dict[str, np.ndarray]
    highest: dict[str, np.ndarray]
    unmet: dict[str, np.ndarray]
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
            # In the order in which NumPy finds the extremes of many short rows fast
            return np.asfortranarray(values.numpy().reshape(launch.windows, -1), dtype=float)

        channels = {name: total(values) for name, values in blocks.sums.items()}
        highest = {name: of_windows(v).max(axis=1) for name, v in blocks.highest.items()}
        unmet = {name: channels.pop(name).sum(axis=1) for name in SUMMED if name in channels}
        unmet |= {name: highest.pop(name) for name in LARGEST if name in highest}
        return Sums(
            valid=channels.pop("valid"),
            radiance=channels.pop("radiance"),
            channels=channels,
            lowest={name: of_windows(v).min(axis=1) for name, v in blocks.lowest.items()},
            highest=highest,
            unmet=unmet,
            tail=tail,
        )

    def plus(self, direct: "Sums", times: float) -> "Sums":
        """These sums, and those of other paths that bring another part of the radiance.

        What is no radiance is that of these paths. times: their number for each of the others.
        """

        def both(ours: dict, theirs: dict) -> dict:
            return {name: values + times * theirs[name] for name, values in ours.items()}

        channels = {
            name: values
            for name, values in self.channels.items()
            if name.removeprefix("target.") not in NO_RADIANCE
        }
        return replace(
            self,
            valid=np.minimum(self.valid, times * direct.valid),
            radiance=self.radiance + times * direct.radiance,
            channels=self.channels | both(channels, direct.channels),
            lowest=both(self.lowest, direct.lowest),
            highest=both(self.highest, direct.highest),
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
    """Sums and extremes over blocks of consecutive paths, as Dr.Jit arrays.

    sums: `valid` and `radiance` of `Sums`, its channels, and what of `unmet` is added up, by name.
    lowest, highest: those of `Sums`, and the rest of `unmet`.
    """

    sums: dict[str, mi.Float]
    lowest: dict[str, mi.Float]
    highest: dict[str, mi.Float]

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
        finite, values = dr.isfinite(L), {"radiance": L} | channels
        values = {name: dr.select(finite, value * weight, 0) for name, value in values.items()}
        lowest = {name: values[name] for name in EXTREMES if name in values}
        highest = dict(lowest)
        values["valid"] = dr.select(finite, mi.Float(1), 0)
        if unmet is not None:
            summed, largest = unmet.of_paths(weight)
            values, highest = values | summed, highest | largest
        # One kernel for all arrays, which would otherwise trace the paths again and again
        dr.eval(values, highest)

        def reduced(kind, values: dict) -> dict:
            return {name: dr.block_reduce(kind, array, size) for name, array in values.items()}

        sums = BlockSums(
            reduced(dr.ReduceOp.Add, values),
            reduced(dr.ReduceOp.Min, lowest),
            reduced(dr.ReduceOp.Max, highest),
        )
        dr.eval(sums)
        return sums

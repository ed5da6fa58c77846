"""Sums over the paths of a launch, for each window and randomisation."""

from dataclasses import dataclass, replace
from functools import reduce
from itertools import chain
from math import gcd

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.plugins.paths.launch import Launch, rounding_error
from mi_lcair.plugins.recorders.radiance import LARGEST, SUMMED, UnmetSource

# The geometric tail: estimate of the radiance beyond the last traced reflection, and its error
# ---------------------------------------------------------------------------------------------

COUNTS = 5  # last bounce counts recorded separately: the tail needs two, its error up to five
LARGEST_RATIO = 0.999  # ratio assumed where the radiance does not fall from one count to the next
# Largest ratio of an earlier change of the estimate to the last one, where the earlier one is used
# in its place, see `extrapolation_error`.
PASSING = 10


@dataclass(frozen=True)
class Tail:
    """Sums over paths, from which the tail and its error are computed; sums of passes add up.

    counts: radiance that was reflected N - 4, ..., N times, (2, COUNTS) [W m^-2 sr^-1]. The rows
    are the model and its background. Each has its own ratio, because their surroundings may differ.
    variance: variance of the sum of the tails, from the noise of the ratios, which are the same for
    all paths. paths: number of paths.
    """

    counts: np.ndarray
    variance: float
    paths: int

    def __add__(self, other: "Tail") -> "Tail":
        """The sums over the paths of both passes."""
        return Tail(
            counts=self.counts + other.counts,
            variance=self.variance + other.variance,
            paths=self.paths + other.paths,
        )

    def error(self, max_bounces: int) -> float:
        """Estimated error of the mean of the tail [W m^-2 sr^-1].

        It contains the error of the extrapolation, the noise of the ratios, and the Float32
        rounding of the ratios.
        """
        known = min(max_bounces + 1, COUNTS)
        bias = sum(extrapolation_error(counts[-known:]) for counts in self.counts)
        return float((bias + np.sqrt(self.variance)) / self.paths)


def ratio(before: float, last: float) -> float:
    """Ratio of the radiances at two successive counts; 0 if the first one is 0."""
    return last / before if before > 0 else 0.0


def continued(before: float, last: float) -> float:
    """Sum of the geometric series after these two counts; 0 if the counts do not fall."""
    r = ratio(before, last)
    return last * r / (1 - r) if r < 1 else 0.0


def extrapolation_error(counts) -> float:
    """Error of the geometric continuation of the last two counts [unit of the counts].

    counts: radiances after successive numbers of reflections, the newest last, three or more.

    At each count there is an estimate of the limit: the sum up to that count and its geometric
    continuation. This estimate changes from count to count. Its changes are assumed to fall by the
    ratio r of the last two counts. The changes still to come then add up to r / (1 - r) times the
    last change. The last change may be small by chance, because changes can pass through zero.
    Earlier changes, multiplied by r for each count since, are therefore considered too, up to
    PASSING times the last change. Rounding of the ratio explains a part of each change. That part
    is subtracted from the changes, and the rounding error is added at the end.
    """
    newest, r = counts[-1], ratio(*counts[-2:])
    if r >= 1:
        return newest / (1 - LARGEST_RATIO)
    rounding = rounding_error(0) * newest * r / (1 - r) ** 2
    changes = [
        max(0.0, abs(c + continued(b, c) - continued(a, b)) * r**age - 2 * rounding / r)
        for age, (a, b, c) in enumerate(zip(counts[-3::-1], counts[-2::-1], counts[::-1]))
        if r > 0
    ]
    change = min(max(changes), PASSING * changes[0]) if changes else 0.0
    return change * r / (1 - r) + rounding


def add_tail(last: list, of_model) -> tuple[mi.Float, Tail]:
    """The tail of each path [W m^-2 sr^-1], and the sums from which it is computed.

    last: radiance reflected N - 4, ..., N times, one array per count. of_model: 1 for paths that
    first hit the model, 0 for others. All arrays must be evaluated. Sums are taken in Float64. In
    Float32 the sum of a million equal numbers has an error of 1e-5, which a room of reflectance
    0.99 would multiply by 100.
    """
    Float64 = dr.float64_array_t(mi.Float)
    of_model = Float64(of_model)
    counts, variance, tail = np.zeros((2, COUNTS)), 0.0, mi.Float(0)
    for row, share in enumerate((of_model, 1 - of_model)):
        parts = [Float64(dr.select(dr.isfinite(channel), channel, 0)) * share for channel in last]
        counts[row] = [float(dr.sum(part)[0]) for part in parts]
        r = ratio(*counts[row, -2:])
        if 0 < r < 1:
            tail += mi.Float(parts[-1] * (r / (1 - r)))
            scatter = float(dr.sum(dr.square(parts[-1] - r * parts[-2]))[0])
            variance += scatter * (r / (1 - r) ** 2) ** 2
    return tail, Tail(counts=counts, variance=variance, paths=dr.width(last[-1]))


# Consecutive values summed in Float32, before sums in Float64. A Float32 sum of 16,000 equal
# numbers has an error of 1e-5.
SUMMED_IN_FLOAT32 = 8
SUMMED_TOGETHER = 2**16  # values of all channels that NumPy sums in one call
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

        def total(arrays: list) -> np.ndarray:
            """Sums of some arrays, (arrays, windows, randomisations)."""
            values = np.concatenate([array.numpy() for array in arrays])
            of_blocks = values.reshape(len(arrays), launch.windows, launch.randomisations, -1)
            if of_blocks.shape[-1] <= FEW_BLOCKS:
                return reduce(np.add, np.moveaxis(of_blocks, -1, 0).astype(np.float64))
            return of_blocks.sum(axis=-1, dtype=np.float64)

        def of_windows(values) -> np.ndarray:
            # In the order in which NumPy finds the extremes of many short rows fast
            return np.asfortranarray(values.numpy().reshape(launch.windows, -1), dtype=float)

        arrays = list(blocks.sums.values())
        some = max(1, SUMMED_TOGETHER // len(arrays[0]))
        parts = [total(arrays[k : k + some]) for k in range(0, len(arrays), some)]
        channels = dict(zip(blocks.sums, chain(*parts)))
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

"""The geometric tail: estimate of the radiance beyond the last traced reflection, and its error."""

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.plugins.paths.offsets import rounding_error

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

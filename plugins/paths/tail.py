"""The geometric tail: what stands in for the reflections beyond the last one that was followed, and
its error.
"""

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.plugins.paths.rounding import rounding_error

COUNTS = 5  # bounce counts that are kept apart: the tail needs two, its error up to five
LARGEST_RATIO = 0.999  # of successive counts, which stands for one that does not fall at all
PASSING = 10  # see extrapolation_error


@dataclass(frozen=True)
class Tail:
    """Sums over paths, from which the tail and its error follow; passes add up.

    counts: what was reflected N - 4, ..., N times (2, COUNTS), of the model and of its background,
    which may lie in other surroundings and are continued each with its own ratio. variance: of the
    sum of the tails, from the noise of their ratios, which all paths share; paths: how many.
    [W m^-2 sr^-1]
    """

    counts: np.ndarray
    variance: float
    paths: int

    def __add__(self, other: "Tail") -> "Tail":
        return Tail(
            counts=self.counts + other.counts,
            variance=self.variance + other.variance,
            paths=self.paths + other.paths,
        )

    def error(self, max_bounces: int) -> float:
        """Estimated error of the mean that the tail adds [W m^-2 sr^-1]: the extrapolation's, the
        noise of the ratios, and Float32's rounding of them.
        """
        known = min(max_bounces + 1, COUNTS)
        bias = sum(extrapolation_error(counts[-known:]) for counts in self.counts)
        return float((bias + np.sqrt(self.variance)) / self.paths)


def ratio(before: float, last: float) -> float:
    """Of two successive counts; 0 where nothing is left."""
    return last / before if before > 0 else 0.0


def continued(before: float, last: float) -> float:
    """The sum of all counts after these two, if they fall geometrically; 0 if they do not fall."""
    r = ratio(before, last)
    return last * r / (1 - r) if r < 1 else 0.0


def extrapolation_error(counts) -> float:
    """Error of the geometric continuation of the last two of these counts (three or more, rising).

    Each count gives an estimate of the limit: what came up to it, and its continuation. Were the
    counts followed further, these estimates would go on to change; their changes are taken to fall
    by the ratio r of the last counts, so that r / (1 - r) times the last change is still to come.
    As a change may pass through zero, an earlier one, fallen likewise, may stand in for the last,
    up to PASSING times as large. Rounding of the ratio explains some of a change, and adds to the
    error.
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
    """The tail of each path, and the sums that it rests on.

    last: radiance reflected N - 4, ..., N times; of_model: 1 where the path first meets the model.
    All are evaluated. Sums are taken in Float64: in Float32 that of a million equal numbers is off
    by 1e-5, which a room of reflectance 0.99 would multiply by 100.
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

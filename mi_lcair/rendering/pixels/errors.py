"""Errors of the pixels of an image: their neighbourhoods, and what they must meet."""

from abc import abstractmethod
from dataclasses import dataclass
from math import hypot

import numpy as np
from scipy.ndimage import correlate, uniform_filter

from mi_lcair.rendering.measurands import Criterion, check_reachable
from mi_lcair.rendering.statistics import Totals

# Pixels along each side of the neighbourhood in which the errors of pixels are averaged
POOLED = 5
# A row, a column and both diagonals of it
LINES = (np.ones((1, POOLED)), np.ones((POOLED, 1)), np.eye(POOLED), np.eye(POOLED)[::-1])
# Ratio of the largest mean variance of a line to that of the square in an even image, on average:
# by chance, with 4 randomisations. Lines count beyond it. They enlarge even variances by 7 %.
BY_CHANCE = 1.35
# Sides of the squares of pixels around a pixel whose mean variances decide its share of the paths.
# The small ones follow edges, the large ones hold enough paths to meet what is rare. They were
# compared on images of a box, a cylinder and an airliner.
SQUARES = (3, 9, 27)
FAINTEST = 1e-100  # replaces 0 in quotients and logarithms [W m^-2 sr^-1]
SMALLEST = 1e-3  # variance around a pixel, as a fraction of that of the image, if none was measured


def pixel_errors(total: Totals, size: tuple[int, int], name: str | None = None) -> np.ndarray:
    """Standard errors of a channel of pixels, from the scatter in their neighbourhood, (P,).

    The scatter of a few paths through one pixel says little about its error: where paths rarely
    meet a source, most pixels have none. The variances of a path around it say more. A source that
    no path through the neighbourhood has met is one that these paths may have missed. For a channel
    other than the radiance, it is taken to have the spectrum of the image.

    size: rows and columns of the image. name: the channel; None for the radiance.
    """

    paths = np.maximum(total.paths, 1)
    of_path = total.random_error(name) ** 2 * paths
    variance = around(of_path.reshape(size)).ravel() / paths
    systematic = averaged((total.systematic * total.mean(name)) ** 2, size, POOLED)
    share = total.mean(name).mean() / max(total.mean().mean(), FAINTEST)
    missed = missed_nearby(share * total.missed_error() * paths, size) / paths
    return np.sqrt(variance + systematic + missed**2)


def around(variances: np.ndarray) -> np.ndarray:
    """Variances of pixels, from those of POOLED x POOLED pixels around them, (..., H, W).

    They are the mean of the square, or of one of its LINES where that is larger beyond chance: few
    pixels of the square are on an edge, and the scatter is there.
    """
    axes, ahead = (-2, -1), (1,) * (variances.ndim - 2)
    square = np.maximum(uniform_filter(variances, POOLED, mode="nearest", axes=axes), 0)
    lines = [np.reshape(line, ahead + line.shape) / POOLED for line in LINES]
    means = [correlate(variances, line, mode="nearest") for line in lines]
    return np.maximum(square, np.max(means, axis=0) / BY_CHANCE)


def missed_nearby(errors: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """Standard errors of pixels from sources that no path of their neighbourhood has met, (P,).

    errors: those from sources that no path of the pixel has met, (P,), for the same number of paths
    in all of them. size: rows and columns of the image.
    """
    return averaged(errors, size, POOLED) / min(POOLED**2, np.prod(size))


def averaged(values: np.ndarray, size: tuple[int, int], side: int) -> np.ndarray:
    """Means of nonnegative numbers over side x side pixels around each pixel, (P,)."""
    return np.maximum(uniform_filter(values.reshape(size), side, mode="nearest").ravel(), 0)


def surroundings(values: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """What is expected of a pixel from those around it: a geometric mean of means over SQUARES.

    The pixel itself does not count. values: of each pixel, (P,), not negative. size: rows and
    columns of the image.
    """
    mean, values = values.mean(), values.reshape(size)
    logarithm = np.zeros(size)
    for side in SQUARES:
        # Sums over the parts of the squares that are inside the image
        counts, sums = (
            side**2 * uniform_filter(image, side, mode="constant") - image
            for image in (np.ones(size), values)
        )
        around = np.where(counts > 0.5, sums / np.maximum(counts, 1), mean)
        logarithm += np.log(np.maximum(around + SMALLEST * mean, FAINTEST))
    return np.exp(logarithm / len(SQUARES)).ravel()


class PixelCriterion(Criterion):
    """What the errors of the pixels of an image must meet."""

    @abstractmethod
    def squares(self, total: Totals) -> np.ndarray:
        """Squared ratios of the pixels' errors from scatter to the allowed error, (P,)."""

    @abstractmethod
    def expected(self, squares: np.ndarray, more: np.ndarray) -> float:
        """Ratio of the error to the allowed one if pixels had `more` times their paths, (P,)."""

    def unmet(self, total: Totals) -> float:
        """Ratio of the error from sources that no path has hit to the allowed error."""
        return 0.0

    @abstractmethod
    def weight(self, total: Totals, size: tuple[int, int]) -> np.ndarray:
        """Numbers of paths that serve best, in any unit, (P,).

        That of a pixel must not depend on its own paths, but on its `surroundings`. total: of as
        many paths in each pixel. size: rows and columns of the image.
        """

    def excess(self, total):
        return hypot(self.expected(self.squares(total), np.ones(1)), self.unmet(total))


@dataclass(frozen=True)
class PixelError(PixelCriterion):
    """The rms standard error over the pixels is below a fraction of the mean radiance."""

    tolerance: float

    def check(self, tracer, name):
        check_reachable(self.tolerance, tracer, name)

    def allowed(self, total) -> float:
        return max(self.tolerance * total.mean().mean(), FAINTEST)

    def squares(self, total):
        return (total.standard_error() / self.allowed(total)) ** 2

    def unmet(self, total):
        return np.sqrt(len(total.valid)) * total.missed_by_all() / self.allowed(total)

    def expected(self, squares, more):
        return float(np.sqrt(np.mean(squares / more)))

    def weight(self, total, size):
        return np.sqrt(surroundings(total.scatter_error() ** 2, size))

    def excess(self, total):
        error = total.rms_error()
        return np.inf if error is None else error / self.tolerance

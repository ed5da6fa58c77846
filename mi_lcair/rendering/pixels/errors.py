"""Errors of the pixels of an image: their neighbourhoods, and what they must meet."""

from abc import abstractmethod
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import uniform_filter

from mi_lcair.rendering.measurands import Criterion, check_reachable
from mi_lcair.rendering.statistics import Totals

# Pixels along each side of the neighbourhood in which the errors of pixels are averaged
POOLED = 5
# Sides of the squares of pixels around a pixel whose mean variances decide its share of the paths.
# The small ones follow edges, the large ones hold enough paths to meet what is rare. They were
# compared on images of a box, a cylinder and an airliner.
SQUARES = (3, 9, 27)
SMALLEST = 1e-3  # variance around a pixel, as a fraction of that of the image, if none was measured


def pixel_errors(total: Totals, size: tuple[int, int]) -> np.ndarray:
    """Standard errors of pixels, from the scatter in their neighbourhood, (P,).

    The scatter of a few paths through one pixel says little about its error: where paths rarely
    meet a source, most pixels have none. The mean variance of a path in POOLED x POOLED pixels says
    more. A source that no path through the neighbourhood has met is one that these paths may have
    missed.

    size: rows and columns of the image.
    """

    def pooled(values):
        return np.maximum(uniform_filter(values.reshape(size), POOLED, mode="nearest").ravel(), 0)

    paths = np.maximum(total.paths, 1)
    variance = pooled(total.random_error() ** 2 * paths) / paths
    systematic = pooled((total.systematic * total.mean()) ** 2)
    # That of as many paths as the neighbourhood would have if all of it had those of the pixel
    missed = pooled(total.missed_error() * paths) / paths / min(POOLED**2, np.prod(size))
    return np.sqrt(variance + systematic + missed**2)


def surroundings(squares: np.ndarray) -> np.ndarray:
    """What is expected of a pixel from those around it: a geometric mean of means over SQUARES.

    The pixel itself does not count. squares: squared errors, (rows, columns).
    """
    mean = squares.mean()
    logarithm = np.zeros(squares.shape)
    for side in SQUARES:
        # Sums over the parts of the squares that are inside the image
        counts, sums = (
            side**2 * uniform_filter(values, side, mode="constant") - values
            for values in (np.ones(squares.shape), squares)
        )
        around = np.where(counts > 0.5, sums / np.maximum(counts, 1), mean)
        logarithm += np.log(np.maximum(around, 0) + SMALLEST * mean)
    return np.exp(logarithm / len(SQUARES))


class PixelCriterion(Criterion):
    """What the errors of the pixels of an image must meet."""

    @abstractmethod
    def squares(self, total: Totals) -> np.ndarray:
        """Squared ratios of the pixels' errors from scatter to the allowed error, (P,)."""

    @abstractmethod
    def unmet(self, total: Totals) -> float:
        """Squared ratio of the error from sources that no path has hit to the allowed error."""

    @abstractmethod
    def expected(self, squares: np.ndarray, unmet: float, more: np.ndarray) -> float:
        """Ratio of the error to the allowed one if pixels had `more` times their paths, (P,)."""

    @abstractmethod
    def weight(self, squares: np.ndarray) -> np.ndarray:
        """Numbers of paths that serve best, in any unit, for these `squares` of as many paths."""

    def excess(self, total):
        return self.expected(self.squares(total), self.unmet(total), np.ones(1))


@dataclass(frozen=True)
class PixelError(PixelCriterion):
    """The rms standard error over the pixels is below a fraction of the mean radiance."""

    tolerance: float

    def check(self, tracer, name):
        check_reachable(self.tolerance, tracer, name)

    def allowed(self, total) -> float:
        return max(self.tolerance * total.mean().mean(), np.finfo(float).tiny)

    def squares(self, total):
        return (total.standard_error() / self.allowed(total)) ** 2

    def unmet(self, total):
        return len(total.valid) * (total.missed_by_all() / self.allowed(total)) ** 2

    def expected(self, squares, unmet, more):
        return float(np.sqrt(np.mean(squares / more) + unmet / np.min(more) ** 2))

    def weight(self, squares):
        return np.sqrt(squares)

    def excess(self, total):
        error = total.rms_error()
        return np.inf if error is None else error / self.tolerance

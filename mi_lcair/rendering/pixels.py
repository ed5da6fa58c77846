"""Pixels of an image: their errors, and how paths are shared among them."""

import pickle
from abc import abstractmethod
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import lru_cache, partial
from math import hypot

import numpy as np
import scipy

from mi_lcair.plugins.paths.launch import Launch
from mi_lcair.plugins.paths.sums import Sums
from mi_lcair.rendering.measurands import Criterion, Measurands, check_reachable
from mi_lcair.rendering.scene import Scene
from mi_lcair.rendering.statistics import Totals
from mi_lcair.rendering.window import Windows
from mi_lcair.tasks import exclusively, in_order

# Errors of the pixels of an image: their neighbourhoods, and what they must meet
# -------------------------------------------------------------------------------

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


def pixel_errors(
    total: Totals, size: tuple[int, int], name: str | None = None, with_bounds: bool = True
) -> np.ndarray:
    """Standard errors of a channel of pixels, from the scatter in their neighbourhood, (P,).

    The scatter of a few paths through one pixel says little about its error: where paths rarely
    meet a source, most pixels have none. The variances of a path around it say more. A source that
    no path through the neighbourhood has met is one that these paths may have missed. For a channel
    other than the radiance, it is taken to have the spectrum of the image.

    size: rows and columns of the image. name: the channel; None for the radiance. with_bounds:
    whether edges and sources count that paths may have missed. They are bounds, so that intervals
    hold the truth too often with them.
    """

    paths = np.maximum(total.paths, 1)
    random = total.random_error(name) if with_bounds else total.scatter_error(name)
    variance = around((random**2 * paths).reshape(size)).ravel() / paths
    systematic = averaged((total.systematic * total.mean(name)) ** 2, size, POOLED)
    if not with_bounds:
        return np.sqrt(variance + systematic)
    share = total.mean(name).mean() / max(total.mean().mean(), FAINTEST)
    missed = missed_nearby(share * total.missed_error() * paths, size) / paths
    return np.sqrt(variance + systematic + missed**2)


def around(variances: np.ndarray) -> np.ndarray:
    """Variances of pixels, from those of POOLED x POOLED pixels around them, (..., H, W).

    They are the mean of the square, or of one of its LINES where that is larger beyond chance: few
    pixels of the square are on an edge, and the scatter is there.
    """
    axes, ahead = (-2, -1), (1,) * (variances.ndim - 2)
    square = np.maximum(
        scipy.ndimage.uniform_filter(variances, POOLED, mode="nearest", axes=axes), 0
    )
    lines = [np.reshape(line, ahead + line.shape) / POOLED for line in LINES]
    means = [scipy.ndimage.correlate(variances, line, mode="nearest") for line in lines]
    return np.maximum(square, np.max(means, axis=0) / BY_CHANCE)


def missed_nearby(errors: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """Standard errors of pixels from sources that no path of their neighbourhood has met, (P,).

    errors: those from sources that no path of the pixel has met, (P,), for the same number of paths
    in all of them. size: rows and columns of the image.
    """
    return averaged(errors, size, POOLED) / min(POOLED**2, np.prod(size))


def averaged(values: np.ndarray, size: tuple[int, int], side: int) -> np.ndarray:
    """Means of nonnegative numbers over side x side pixels around each pixel, (P,)."""
    return np.maximum(
        scipy.ndimage.uniform_filter(values.reshape(size), side, mode="nearest").ravel(), 0
    )


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
            side**2 * scipy.ndimage.uniform_filter(image, side, mode="constant") - image
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

    def expected(self, squares: np.ndarray, more: np.ndarray) -> float:
        """Ratio of the error to the allowed one if pixels had `more` times their paths, (P,).

        By default the error is the rms over the pixels.
        """
        return float(np.sqrt(np.mean(squares / more)))

    def unmet(self, total: Totals) -> float:
        """Ratio of the error from sources that no path has hit to the allowed error."""
        return 0.0

    def weight(self, total: Totals, size: tuple[int, int]) -> np.ndarray:
        """Numbers of paths that serve best, in any unit, (P,).

        That of a pixel must not depend on its own paths, but on its `surroundings`. total: of as
        many paths in each pixel. size: rows and columns of the image.
        """
        return np.sqrt(surroundings(total.scatter_error() ** 2, size))

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

    def excess(self, total):
        error = total.rms_error()
        return np.inf if error is None else error / self.tolerance


# How the paths of an image are shared among its pixels: more go where its error is larger
# ----------------------------------------------------------------------------------------
# All pixels first get the same number of paths. From the scatter of these paths follows a share of
# the further ones for each pixel. The share comes from the pixels around it and not from itself. A
# pixel's number of paths is therefore independent of the radiance of these paths, so that neither
# its mean nor its standard error is biased. A pixel that stopped because its own first paths
# scattered little would be too dark on average, because these paths missed what is bright and rare.

EVEN_PARTS = (1 / 8, 1 / 4, 1 / 2)  # smallest share of a pixel; the best of them is taken
STEP = 4  # points that a pixel gets more at once, so that few kernels are compiled
LEAST_PILOT = 1 / 8  # part of all points that decide the shares, at least
LEAST_GAIN = 1.5  # smallest ratio of the paths saved; launches of unlike pixels take a third longer
MARGIN = 1.02  # ratio of the expected error to the one that is aimed at, as both are estimates
ACCURACY = 0.05  # of the binary logarithm of a number of paths


@dataclass(frozen=True)
class Allocation:
    """Numbers of points of each randomisation of the windows of an image.

    Attributes
    ----------
    shares : ndarray, shape (windows,)
        Their mean is 1.
    pilot : int
        Points that all windows have.
    step : int
        Number of points by which they grow.
    """

    shares: np.ndarray
    pilot: int = 0
    step: int = 1

    def points(self, goal: float) -> np.ndarray:
        """Points of each window for a mean number, (windows,), but no fewer than the pilot's."""
        steps = np.maximum(goal * self.shares - self.pilot, 0) // self.step
        return self.pilot + self.step * steps.astype(int)

    def spans(self, active, done: int, goal: int) -> Iterator[tuple[np.ndarray, int, int]]:
        """Windows with the same share, their points for `done`, and the points that they lack.

        active: numbers of the windows. done, goal: mean numbers of points.
        """
        shares, inverse = np.unique(self.shares[active], return_inverse=True)
        of_share = replace(self, shares=shares)
        for k, (first, points) in enumerate(zip(of_share.points(done), of_share.points(goal))):
            if points > first:
                yield active[inverse == k], int(first), int(points - first)


def allocate(
    total: Totals, criterion: PixelCriterion, size: tuple[int, int], pilot: int, most: float
) -> tuple[Allocation | None, float]:
    """The allocation that meets a criterion with the fewest paths, and its mean number of points.

    Parameters
    ----------
    total : Totals
        Those of `pilot` points of each randomisation of each window.
    criterion : PixelCriterion
        It is not met yet.
    size : tuple of int
        Rows and columns of the windows.
    pilot : int
    most : float
        Largest mean number of points.

    Returns
    -------
    tuple
        The argument of `Allocation.points`. None instead of an allocation if all windows should get
        the same number of points, up to this one at least.
    """
    squares, unmet = criterion.squares(total), criterion.unmet(total)
    if not 0 < squares.mean() < np.inf:
        return None, np.inf

    def excess(points: np.ndarray) -> float:
        more = points / pilot
        return MARGIN * hypot(criterion.expected(squares, more), unmet / more.min())

    weight = criterion.weight(total, size)
    even, *shared = (
        cheapest(Allocation(shares, pilot, STEP), excess, most)
        for shares in [np.ones(len(squares)), *(shares_of(weight, part) for part in EVEN_PARTS)]
    )
    best = min(shared)
    if best.cost * LEAST_GAIN > even.cost:
        return None, np.inf
    if pilot < LEAST_PILOT * best.points:
        return None, LEAST_PILOT * best.points
    return best.allocation, best.goal


@dataclass(frozen=True, order=True)
class Prospect:
    """An allocation that meets a criterion, or comes close to it with the most paths.

    cost: mean number of points with which the criterion is met, perhaps more than the most. points:
    mean number of points. goal: argument of `Allocation.points` that gives them.
    """

    cost: float
    points: float
    goal: float
    allocation: Allocation = field(compare=False)


def cheapest(allocation: Allocation, excess: Callable, most: float) -> Prospect:
    """The smallest goal for which an allocation meets a criterion, or the largest goal.

    excess: gives the expected ratio of the error to the allowed error from the points of the
    windows. most: largest mean number of points.
    """

    def ratio(logarithm: float) -> float:
        return np.log(excess(allocation.points(2**logarithm)))

    least, largest = np.log2(allocation.pilot / 2), np.log2(most)
    if ratio(least) <= 0:
        largest = least
    elif ratio(largest) < 0:
        largest = scipy.optimize.bisect(ratio, least, largest, xtol=ACCURACY)
    points = allocation.points(2**largest).mean()
    return Prospect(points * max(np.exp(ratio(largest)), 1) ** 2, points, 2**largest, allocation)


def shares_of(weight: np.ndarray, smallest: float) -> np.ndarray:
    """Shares in proportion to weights, but with a smallest one, in steps of a factor of 2."""
    shares = smallest + (1 - smallest) * weight / weight.mean()
    shares = 2.0 ** np.round(np.log2(shares))
    return shares / shares.mean()


# Launches of an image on workers
# -------------------------------


def on_workers(
    scene: Scene,
    windows: Windows,
    measurands: Measurands,
    tolerance: float | None,
    launches: list[Launch],
) -> Iterator[Sums]:
    """Yield the sums of each launch of an image from a sensor of the scene.

    tolerance: that of the sampling, which decides on bins of wavelength.
    """
    number = scene.mi.sensors().index(windows.sensor)
    sent = pickle.dumps((scene, number, measurands, tolerance, windows.by_randomisation))
    yield from in_order([partial(trace_sent, sent, launch) for launch in launches])


def may_be_sent(scene: Scene, windows: Windows, measurands: Measurands) -> bool:
    """Whether workers can trace the launches of an image: from a sensor of the scene."""
    is_plain = not (measurands.facets or measurands.explored or measurands.reduced)
    is_known = windows.sensor in scene.mi.sensors()
    has_own_air = bool(scene.mi.integrator().filters)
    return is_plain and is_known and measurands.channels.tables is None and not has_own_air


@lru_cache(maxsize=1)
def received(sent: bytes) -> tuple:
    """What `on_workers` sends, which a worker unpacks once."""
    return pickle.loads(sent)


@exclusively
def trace_sent(sent: bytes, launch: Launch) -> Sums:
    """The sums of a launch on a worker."""
    scene, number, measurands, tolerance, by_randomisation = received(sent)
    binning = measurands.binning(tolerance)
    with scene.prepared(measurands.by_spectrum, measurands.explored, binning) as tracer:
        sums = measurands.trace(tracer, scene.sensors[number], launch)
    if by_randomisation:
        return sums
    channels = {name: values.sum(axis=1, keepdims=True) for name, values in sums.channels.items()}
    return replace(sums, channels=channels)  # as `Totals` would, so that less is sent

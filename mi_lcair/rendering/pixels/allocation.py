"""How the paths of an image are shared among its pixels: more go where its error is larger.

All pixels first get the same number of paths. From the scatter of these paths follows a share of
the further ones for each pixel. The share comes from the pixels around it and not from itself. A
pixel's number of paths is therefore independent of the radiance of these paths, so that neither its
mean nor its standard error is biased. A pixel that stopped because its own first paths scattered
little would be too dark on average, because these paths missed what is bright and rare.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from math import hypot

import numpy as np
import scipy

from mi_lcair.rendering.pixels.errors import PixelCriterion
from mi_lcair.rendering.statistics import Totals

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

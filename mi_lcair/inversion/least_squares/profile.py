"""Profile-likelihood intervals where the linear ones do not hold: at bounds and in curved valleys.

Whether they are needed follows from the cost at the ends of the linear interval, without a render.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy import sparse

from mi_lcair.errors import InputError
from mi_lcair.inversion.least_squares.newton import Prior, bent, minimiser
from mi_lcair.inversion.least_squares.prediction import DatumBlock, cost_of, equations
from mi_lcair.physics.estimation.profiles import further, profile_ends, student_factor

WIDTH = student_factor(np.inf)  # half of a 95 % interval, standard errors
MOST_UNKNOWNS = 30  # number of unknowns above which all intervals are linear
STRAIGHT = 0.1  # relative error of a linear interval from which it is replaced
RENDERS = 4  # largest number of renders for the end of an interval


def profile_intervals(
    blocks: list[DatumBlock],
    x: np.ndarray,
    prior: Prior,
    covariance: np.ndarray,
    is_noisy: np.ndarray,
    render: Callable[[np.ndarray], list[DatumBlock]] | None,
) -> np.ndarray:
    """Lower and upper ends (N, 2) of the 95 % intervals about the estimate x, (N,).

    They are NaN where the linear interval holds. Standard errors (N,) of the estimate come from its
    covariance (N, N).

    is_noisy: unknowns (N,) of bool whose errors are mostly those of the render. Its noise would
    hide the rise of the cost, so that their intervals stay linear. render: gives the blocks at
    values; None if those at the estimate hold for all values.
    """
    ends = np.full((len(x), 2), np.nan)
    if any(sparse.issparse(block.columns[0]) for block in blocks) or len(x) > MOST_UNKNOWNS:
        return ends
    normal = equations(blocks, x)
    for k in range(len(x)):
        if is_noisy[k] or not covariance[k, k] > 0:
            continue
        profile = Profile(blocks, x, prior, k, covariance[k] / np.sqrt(covariance[k, k]), normal)
        if profile.rise_of_error <= 0:
            continue  # the noise of the render is larger than the rise
        if all(profile.is_straight(side) for side in (-1, 1)):
            continue
        ends[k] = [profile.end(side, render) for side in (-1, 1)]
    return ends


class Profile:
    """The cost along one unknown k, with the others at their best.

    direction: change (N,) of the estimate for one standard error of the unknown. normal: the
    equations at the estimate x.
    """

    def __init__(self, blocks, x, prior: Prior, k: int, direction: np.ndarray, normal):
        self.blocks, self.x, self.prior, self.k, self.direction = blocks, x, prior, k, direction
        self.cost = cost_of(blocks, x) + prior.cost(x)
        # The weights are not exactly the inverse variances, and the noise of derivatives is in the
        # standard error alone. The rise that belongs to one standard error makes up for both.
        rise = direction @ (normal.matrix @ direction + prior.times(direction))
        self.rise_of_error = float(rise)

    def errors(self, blocks, x) -> float:
        """Distance from the estimate, in standard errors, that the cost at the values x shows."""
        rise = cost_of(blocks, x) + self.prior.cost(x) - self.cost
        return float(np.sqrt(max(rise, 0) / self.rise_of_error))

    def is_straight(self, side: int) -> bool:
        """Whether the linear interval ends within all bounds, where the cost is as expected."""
        x = self.x + side * WIDTH * self.direction
        if (x < self.prior.lower).any() or (x > self.prior.upper).any():
            return False
        return abs(self.errors(self.blocks, x) / WIDTH - 1) < STRAIGHT

    def at(self, blocks, start: np.ndarray, value: float) -> np.ndarray:
        """The best values (N,) of the others if the unknown has this value."""
        lower, upper = self.prior.lower.copy(), self.prior.upper.copy()
        lower[self.k] = upper[self.k] = value
        step = (value - start[self.k]) * self.direction / self.direction[self.k]
        # At a bound, such as a reflectance of 1, the data may know nothing of the others
        first = np.clip(start + step, 0.5 * (start + lower), 0.5 * (start + upper))
        first[self.k] = value
        held = replace(self.prior, lower=lower, upper=upper)
        return minimiser(blocks, first, held, 0.0, False)

    def end(self, side: int, render) -> float:
        """The end of the interval on one side, -1 or 1."""
        bound = (self.prior.upper if side > 0 else self.prior.lower)[self.k]
        if self.x[self.k] == bound:
            return float(bound)
        blocks, first = self.blocks, None
        for _ in range(RENDERS):
            place, predicted, beyond = self.crossing(blocks, side, bound)
            if first is not None and (place == self.x).all():
                # By this render even the estimate is outside: noise of the render hides the rise
                place, predicted, beyond = first
                errors = predicted
                break
            first, errors = first or (place, predicted, beyond), predicted
            if render is None:
                break
            try:
                rendered = render(place)
            except InputError:
                break  # no surface can have these values
            blocks = [
                bent(replace(new, weight=old.weight, curvature=old.curvature), old)
                for new, old in zip(rendered, blocks)
            ]
            place = self.at(blocks, place, place[self.k])
            errors = self.errors(blocks, place)
            if abs(errors - predicted) < STRAIGHT * WIDTH:
                break
        value = further(self.x[self.k], place[self.k], errors, WIDTH)
        return float(min(value, beyond) if side > 0 else max(value, beyond))

    def crossing(self, blocks, side: int, bound: float) -> tuple[np.ndarray, float, float]:
        """Values (N,) within the interval near its end by the blocks, and their distance.

        The third result is a value of the unknown outside the interval, or the bound itself.
        """

        def refit(_, values, starts):
            places = [self.at(blocks, start, value) for value, start in zip(values, starts)]
            return np.array([self.errors(blocks, place) for place in places]), np.array(places)

        x = self.x[self.k]
        first = x + side * WIDTH * self.direction[self.k]
        ends = profile_ends(refit, [x], self.x, [first], [bound], WIDTH)
        return tuple(of[0] for of in ends)

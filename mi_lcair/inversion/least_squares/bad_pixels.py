"""Dead, hot and saturated pixels that nobody stated, found by their residuals."""

from dataclasses import replace

import numpy as np
from scipy import stats

from mi_lcair.inversion.least_squares.prediction import DatumBlock

FALSE_ALARM = 0.05  # probability that noise alone makes any pixel of an image a bad one
# Share of an image above which large residuals are no bad pixels: the scene misses something.
MOST_BAD = 0.05
# Median of the residuals, relative to that of the stated noise, above which the same holds.
LARGEST_SCALE = 1.5
ROUNDS = 6  # largest number of solutions after which bad pixels are looked for


class Search:
    """The search for bad pixels, after one solution and the next.

    bad: the bad pixels of each datum, (n,) of bool.
    """

    def __init__(self, blocks: list[DatumBlock]):
        self.bad = [np.zeros(len(block.measured), dtype=bool) for block in blocks]
        self.rounds = 0

    def continues(self, blocks: list[DatumBlock], x: np.ndarray, weights) -> bool:
        """Look for bad pixels at a solution x; whether others are bad than before.

        If they stay too many, the scene misses something, and no pixel counts as bad.
        """
        if self.rounds >= ROUNDS:
            return False
        self.rounds += 1
        listed = [bad_pixels(block, x, weight) for block, weight in zip(blocks, weights)]
        before, self.bad = self.bad, [is_bad for is_bad, _ in listed]
        is_new = any((now != then).any() for now, then in zip(self.bad, before))
        are_many = any(many for _, many in listed)
        if are_many and (not is_new or self.rounds == ROUNDS):
            self.bad, self.rounds = [np.zeros_like(now) for now in before], ROUNDS
            return True
        return is_new

    def weighed(self, blocks: list[DatumBlock], weights) -> list[DatumBlock]:
        """The blocks with weights, which are 0 for bad pixels."""
        return [
            replace(block, weight=np.where(is_bad, 0.0, weight))
            for block, weight, is_bad in zip(blocks, weights, self.bad)
        ]


def bad_pixels(block: DatumBlock, x: np.ndarray, weight: np.ndarray) -> tuple[np.ndarray, bool]:
    """Pixels of an image, (n,), whose residual at the values x is too large for noise.

    The limit follows the median of the residuals, so that it is wide as long as bad pixels spoil
    the solution. Of many pixels only those with the largest residuals are bad, because they may
    have made the other residuals. Data that are no images have none.

    weight: weights (n,) of all pixels, see `Datum.weight`. The second result is whether the
    residuals are too many, or too large everywhere, to come from bad pixels.
    """
    if not block.is_image:
        return np.zeros(len(weight), dtype=bool), False
    residuals = block.at(x).residuals.mean(axis=0)
    if block.common:
        residuals = block.common.removed(block.weight, residuals[:, None])[:, 0]
    sigmas = np.abs(residuals) * np.sqrt(weight)
    scale = max(float(np.median(sigmas)) / stats.norm.ppf(0.75), 1.0)
    is_bad = sigmas > scale * stats.norm.isf(FALSE_ALARM / 2 / len(weight))
    are_many = np.mean(is_bad) > MOST_BAD or scale > LARGEST_SCALE
    is_bad &= sigmas > np.quantile(sigmas, 1 - MOST_BAD) * (np.mean(is_bad) > MOST_BAD)
    return is_bad, bool(are_many)

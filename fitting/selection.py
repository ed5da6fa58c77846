"""Which form of the model, and whether rho_d and b are needed at all: no more than the data ask
for.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

RESTRICTIONS = {"rho_d = 0": 1, "b = 0": 2}  # and the coordinate of the cube that stays 0
# difference in the criterion; less is "not worth more than a bare mention" (Kass and Raftery 1995)
SIGNIFICANT = 2.0


@dataclass
class Candidate:
    """A model at its minimum: u (4,), cost = half the sum of squares of the rows, free (4,)
    coordinates that moved.
    """

    form: str
    restriction: str | None
    free: np.ndarray
    residuals: Any
    u: np.ndarray
    cost: float
    gradient: float
    share: float  # of the starts that ended in this minimum
    criterion: float = 0.0  # above the best candidate's

    @property
    def size(self) -> int:
        return int(self.free.sum())


def free_coordinates(restriction: str | None) -> np.ndarray:
    return np.arange(4) != RESTRICTIONS.get(restriction, -1)


def criterion(candidate: Candidate, rows: int, effective: float) -> float:
    """Bayesian information criterion, n ln(sum of squares / rows) + k ln n, n being the effective
    number of rows.
    """
    mean = max(2 * candidate.cost / rows, 1e-24)  # below that two models differ by round-off
    return effective * np.log(mean) + candidate.size * np.log(effective)


def choose(candidates: list[Candidate], criteria) -> int:
    """Index of the simplest candidate that is not significantly worse than the best; of equally
    simple ones, the better.
    """
    close = [
        index for index in range(len(candidates)) if criteria[index] <= min(criteria) + SIGNIFICANT
    ]
    return min(close, key=lambda index: (candidates[index].size, criteria[index]))

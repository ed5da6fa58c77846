"""One claim, and the witness who compares it with the truth."""

from dataclasses import dataclass

import numpy as np
from scipy.special import stdtrit

from docs.studies.claims.case import Case

MOST_PATHS = 2**20  # of a window, to a tolerance


def student(freedom: int) -> float:
    return float(stdtrit(freedom, 0.975))


@dataclass(frozen=True)
class Claim:
    """One claim.

    name: what is claimed. kind: kind of the scene. setting: of emitter sampling. seed, number: of
    the case. excess: error over what was stated or asked for; above 1 the claim is false. error:
    the error as a fraction of the truth.
    """

    name: str
    kind: str
    setting: str
    seed: int
    number: int
    excess: float
    error: float

    @property
    def held(self) -> bool:
        return self.excess <= 1


class Witness:
    """Compares what is stated about a case with the truth."""

    def __init__(self, case: Case, seed: int, number: int, setting: str):
        self.case, self.label = case, (case.kind, setting, seed, number)

    def claim(self, name: str, value, truth, stated) -> Claim:
        """That `value` is `truth` within `stated`."""
        allowed = stated + self.case.error * abs(truth)
        error = abs(value - truth)
        excess = error / allowed if allowed > 0 else np.inf if error > 0 else 0.0
        relative = (value - truth) / abs(truth) if truth else np.nan
        return Claim(name, *self.label, float(excess), float(relative))

    def fault(self, error: Exception) -> Claim:
        """That a command ends without a fault, which it did not."""
        return Claim(f"fault: {type(error).__name__}", *self.label, np.inf, np.nan)

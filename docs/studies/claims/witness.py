"""One claim, and the witness who compares it with the truth."""

from dataclasses import dataclass

import numpy as np
from scipy.special import stdtrit

from docs.studies.claims.case import Case
from docs.studies.claims.scene_file import PIXELS

MOST_PATHS = 2**20  # of a window, to a tolerance


def student(freedom: int) -> float:
    return float(stdtrit(freedom, 0.975))


@dataclass(frozen=True)
class Claim:
    """One claim.

    name: what is claimed. kind: kind of the scene. setting: of emitter sampling. seed, number: of
    the case. excess: error over what was stated or asked for; above 1 the claim is false. error:
    the error as a fraction of the truth, NaN where that is 0.
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
    """Compares what is stated about a case with the truth.

    most_paths: largest number of paths through a window, to a tolerance; `most_spp` is that of a
    pixel.
    """

    def __init__(
        self, case: Case, seed: int, number: int, setting: str, most_paths: int = MOST_PATHS
    ):
        self.case, self.label = case, (case.kind, setting, seed, number)
        self.most_spp = most_paths // PIXELS**2

    def claim(self, name: str, value, truth, stated, unit=None) -> Claim:
        """That `value` is `truth` within `stated`. The error is written in `unit`, or the truth."""
        allowed = stated + self.case.error * abs(truth)
        error = abs(value - truth)
        excess = error / allowed if allowed > 0 else np.inf if error > 0 else 0.0
        unit = abs(truth) if unit is None else unit
        relative = (value - truth) / unit if unit else np.nan
        return Claim(name, *self.label, float(excess), float(relative))

    def fault(self, error: Exception) -> Claim:
        """That a command ends without a fault, which it did not."""
        return Claim(f"fault: {type(error).__name__}", *self.label, np.inf, np.nan)

"""Which reflection model, in which form, with which restriction: no more than the data ask for."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.physics.reflection import MODELS, model
from mi_lcair.physics.reflection.interface import ReflectionModel, Restriction

AUTO = "auto"  # as a model or a form: all of them are compared
# difference in the criterion; less is "not worth more than a bare mention" (Kass and Raftery 1995)
SIGNIFICANT = 2.0


@dataclass(frozen=True)
class Variant:
    """What a search adapts to the data: a form of a reflection model, whole or restricted."""

    model: ReflectionModel
    form: str
    restriction: Restriction | None = None

    @property
    def whole(self) -> "Variant":
        return Variant(self.model, self.form)

    @property
    def free(self) -> np.ndarray:
        """Mask (n,) of the coordinates that move."""
        held = self.restriction.coordinate if self.restriction else -1
        return np.arange(len(self.model.parameters)) != held

    def restrict(self, u: np.ndarray) -> np.ndarray:
        """Coordinates u (m, n) with the restriction's value where it holds one."""
        return np.where(self.free, u, self.restriction.value if self.restriction else 0)


@dataclass
class Candidate:
    """A variant at its minimum: u (n,), cost = half the sum of squares of the rows."""

    variant: Variant
    residuals: Any
    u: np.ndarray
    cost: float
    gradient: float
    share: float  # of the starts that ended in this minimum
    criterion: float = 0.0  # above the best candidate's

    @property
    def size(self) -> int:
        """Number of free parameters."""
        return int(self.variant.free.sum())


def variants(model_name: str, form: str) -> list[Variant]:
    """The variants that a model and a form, each a name or "auto", leave to compare; whole ones
    first.

    Restricted ones are compared where the form is left open. InputError for unknown names.
    """
    models = list(MODELS.values()) if model_name == AUTO else [model(model_name)]
    whole = [
        Variant(one, own_form)
        for one in models
        for own_form in one.forms
        if form in (AUTO, own_form)
    ]
    if not whole:
        known = "; ".join(f"{one.name} has {', '.join(one.forms)}" for one in models)
        raise InputError(f"form '{form}' is unknown; {known}")
    return whole + [
        Variant(one.model, one.form, restriction)
        for one in whole
        for restriction in one.model.restrictions
        if form == AUTO
    ]


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

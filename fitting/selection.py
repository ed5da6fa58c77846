"""Choice of the simplest reflection model, form and restriction that the data allow."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.physics.reflection import model
from mi_lcair.physics.reflection.interface import ReflectionModel, Restriction
from mi_lcair.physics.reflection.models import MODELS

# The models that a fit compares where it is not told its model
COMPARED = {name: entry for name, entry in MODELS.items() if entry.is_compared}
AUTO = "auto"  # as a name of a model or a form: all of them are compared
# Smallest significant difference of the criterion. A smaller one is "not worth more than a bare
# mention" (Kass and Raftery 1995).
SIGNIFICANT = 2.0


@dataclass(frozen=True)
class Variant:
    """What a search fits to the data: a form of a reflection model, whole or restricted."""

    model: ReflectionModel
    form: str
    restriction: Restriction | None = None

    @property
    def whole(self) -> "Variant":
        """The same model and form without a restriction."""
        return Variant(self.model, self.form)

    @property
    def free(self) -> np.ndarray:
        """Mask (n,) of the coordinates that a search may change."""
        mask = np.ones(len(self.model.parameters), dtype=bool)
        if self.restriction:
            mask[self.restriction.coordinate] = False
        return mask

    def restrict(self, u: np.ndarray) -> np.ndarray:
        """Coordinates u (m, n), with the restricted one set to its fixed value."""
        return np.where(self.free, u, self.restriction.value) if self.restriction else u


@dataclass
class FittedVariant:
    """A variant at its minimum.

    Attributes
    ----------
    variant, residuals
        The variant, and the residuals that were minimized.
    u
        Coordinates of the minimum, (n,).
    cost
        Half the sum of squares of the rows.
    gradient
        Relative gradient at the minimum.
    share
        Share of the starts that reached this minimum.
    criterion
        Excess of the criterion over that of the best candidate.
    """

    variant: Variant
    residuals: Any
    u: np.ndarray
    cost: float
    gradient: float
    share: float
    criterion: float = 0.0

    @property
    def size(self) -> int:
        """Number of free parameters."""
        return int(self.variant.free.sum())


def variants(model_name: str, form: str) -> list[Variant]:
    """The variants to compare for a model and a form, whole ones first.

    model_name, form: names, or "auto" for all. Restricted variants are included if the form is
    "auto". Raises InputError for unknown names.
    """
    models = list(COMPARED.values()) if model_name == AUTO else [model(model_name)]
    whole = [
        Variant(entry, name) for entry in models for name in entry.forms if form in (AUTO, name)
    ]
    if not whole:
        known = "; ".join(f"{listed.name} has {', '.join(listed.forms)}" for listed in models)
        raise InputError(f"form '{form}' is unknown; {known}")
    return whole + [
        Variant(variant.model, variant.form, restriction)
        for variant in whole
        for restriction in variant.model.restrictions
        if form == AUTO
    ]


def criterion(candidate: FittedVariant, rows: int, effective: float) -> float:
    """Bayesian information criterion, n ln(sum of squares / rows) + k ln n.

    k is the number of free parameters.

    Parameters
    ----------
    candidate
        A variant at its minimum.
    rows
        Number of residuals.
    effective
        Number n of independent residuals.

    Returns
    -------
    float
        The criterion; the lower, the better.
    """
    mean = max(2 * candidate.cost / rows, 1e-24)  # smaller means differ by round-off only
    return effective * np.log(mean) + candidate.size * np.log(effective)


def choose(candidates: list[FittedVariant], criteria) -> int:
    """Index of the simplest candidate that is not significantly worse than the best.

    Of several equally simple candidates, it is the one with the lower criterion.
    """
    close = [
        index for index in range(len(candidates)) if criteria[index] <= min(criteria) + SIGNIFICANT
    ]
    return min(close, key=lambda index: (candidates[index].size, criteria[index]))

"""Law of propagation of uncertainty, with correlated quantities (GUM, JCGM 100:2008, 5.2)."""

from dataclasses import dataclass

import numpy as np

from mi_lcair.uncertainty.inputs import Group, Inputs


@dataclass(frozen=True)
class BudgetRow:
    """One row of a budget.

    Attributes
    ----------
    quantity : str
        Name of the quantity, or of a group of correlated ones.
    contribution : float
        Its standard uncertainty of the result, in the result's unit. For a single quantity it has
        the sign of the sensitivity.
    share : float
        Share of the variance of the result.
    value, sigma, sensitivity, sensitivity_error : float or None
        Value and standard deviation of the quantity; derivative of the result with respect to it,
        and its standard error. None for a group and for rows that are no quantity.
    unit : str
        Unit of value and sigma.
    distribution : str
        The quantity's distribution in words, if it is not normal.
    members : tuple of BudgetRow
        The quantities of a group. Their contributions are those of each one alone, and they have no
        share of their own.
    """

    quantity: str
    contribution: float
    share: float | None
    value: float | None = None
    sigma: float | None = None
    sensitivity: float | None = None
    sensitivity_error: float | None = None
    unit: str = ""
    distribution: str = ""
    members: tuple["BudgetRow", ...] = ()


def rows(
    inputs: Inputs, derivative: np.ndarray, errors: np.ndarray, others: dict[str, float]
) -> list[BudgetRow]:
    """The rows of a budget, the largest share first.

    Parameters
    ----------
    inputs : Inputs
        K quantities with their covariance.
    derivative, errors : ndarray, shape (K,)
        Derivatives of the result, and their standard errors.
    others : dict of str to float
        Further standard uncertainties of the result, by name, which are independent of all others.
    """
    kinds = {name: of_name.words for name, of_name in inputs.distributions.items()}
    variances = {group.label: group_variance(inputs, derivative, group) for group in inputs.groups}
    total = sum(variances.values()) + sum(error**2 for error in others.values())

    def share(variance):
        return variance / total if total > 0 else 0.0

    budget_rows = []
    for group in inputs.groups:
        members = [
            BudgetRow(
                quantity=inputs.quantities[k].name,
                contribution=float(derivative[k] * inputs.sigma[k]),
                share=None,
                value=inputs.quantities[k].value,
                sigma=float(inputs.sigma[k]),
                sensitivity=float(derivative[k]),
                sensitivity_error=float(errors[k]),
                unit=inputs.quantities[k].unit,
                distribution=kinds.get(inputs.quantities[k].name, ""),
            )
            for k in group.index
        ]
        variance = variances[group.label]
        if len(members) == 1:
            budget_rows.append(BudgetRow(**vars(members[0]) | {"share": share(variance)}))
        else:
            contribution = float(np.sqrt(variance))
            budget_rows.append(
                BudgetRow(group.label, contribution, share(variance), members=tuple(members))
            )
    budget_rows += [BudgetRow(name, error, share(error**2)) for name, error in others.items()]
    return sorted(budget_rows, key=lambda row: -row.share)


def group_variance(inputs: Inputs, derivative: np.ndarray, group: Group) -> float:
    """Variance of the result from a group of correlated quantities."""
    c = derivative[group.index]
    return float(max(c @ inputs.covariance[np.ix_(group.index, group.index)] @ c, 0.0))


def combined(budget_rows: list[BudgetRow]) -> float:
    """Standard uncertainty of the result: the root of the sum of the squared contributions."""
    return float(np.sqrt(sum(row.contribution**2 for row in budget_rows)))

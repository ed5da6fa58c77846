"""What contributes to the error of an estimate, as a table that all results share."""

from mi_lcair.estimate import Contribution, Estimate, in_unit
from mi_lcair.results.sections import Table


def contributions(estimate: Estimate) -> Table:
    """What contributes to the error of a single value. A group is followed by its members."""
    head = ["quantity", "value", "sigma", "sensitivity"]
    head += [in_unit("contribution", estimate.unit), "share"]
    rows = [_cells(entry) for row in estimate.contributions for entry in (row, *row.members)]
    return Table(head, rows)


def _cells(row: Contribution) -> list[str]:
    """Cells of what contributes to an estimate. A member of a group has no share."""
    slope = _number(row.sensitivity)
    if row.sensitivity_error is not None and row.sensitivity_error >= 1e-3 * abs(row.sensitivity):
        slope += f" +- {row.sensitivity_error:.1g}"
    quantity = row.quantity if row.share is not None else f"  {row.quantity}"
    return [
        quantity + (f" ({row.distribution})" if row.distribution else ""),
        _number(row.value) and in_unit(_number(row.value), row.unit),
        _number(row.sigma, 3),
        slope,
        f"{row.contribution:.4g}" if row.sensitivity is None else f"{row.contribution:+.4g}",
        "" if row.share is None else f"{100 * row.share:.2f} %",
    ]


def _number(value: float | None, digits: int = 5) -> str:
    """A number as text; empty without one."""
    return "" if value is None else f"{value:.{digits}g}"

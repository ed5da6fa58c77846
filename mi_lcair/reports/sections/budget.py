"""Sections of an uncertainty budget."""

from mi_lcair.declared import percent
from mi_lcair.estimate import Contribution, Estimate
from mi_lcair.results.sections import Facts, Remarks, Section, Table


def sections(budget) -> list[Section]:
    """The result and its uncertainty, what contributes to it, and what renders say about that."""
    parts = [Facts(uncertainty(budget)), contributions(budget.estimate), Remarks(budget.remarks)]
    result = [Section("Uncertainty budget", parts)]
    if budget.checks:
        columns = ["rendered at", "derivative", "plus sigma", "minus sigma", "linear"]
        checks = [
            [
                check.quantity,
                f"+-{abs(check.linear):.4g}",
                change(check.plus),
                change(check.minus),
                "holds" if check.holds else "FAILS",
            ]
            for check in budget.checks
        ]
        result.append(Section("Checks", [Table(columns, checks)]))
    return result


def uncertainty(budget) -> list[tuple[str, str]]:
    """Rows about the result, its standard uncertainty, and the Monte Carlo."""
    estimate, unit = budget.estimate, in_unit("", budget.estimate.unit)
    relative = f", {percent(budget.sigma / abs(budget.value))}" if budget.value else ""
    rows = [
        (budget.title, f"{estimate} (one standard uncertainty{relative})"),
        ("expanded", f"+- {2 * budget.sigma:.3g}{unit} (k = 2, about 95 %)"),
    ]
    curved = budget.second_order
    if curved is not None:
        low, high = curved.interval
        rows.append(
            (
                "second order",
                f"mean {curved.shift:+.2g}, sigma {curved.sigma:.3g}{unit}, about 95 % in "
                f"{low:.5g}..{high:.5g}",
            )
        )
    drawn = budget.monte_carlo
    if drawn is not None:
        low, high = drawn.interval
        rows.append(
            (
                "monte carlo",
                f"{Estimate(drawn.mean, drawn.sigma, estimate.unit)} (itself +- "
                f"{drawn.sigma_error:.2g}) from {drawn.draws} draws, 95 % in "
                f"{low:.5g}..{high:.5g}; linear, of the quantities alone: "
                f"{budget.sigma_of_quantities:.3g}",
            )
        )
    return [*rows, ("renders", f"{budget.renders} of {budget.paths} paths")]


def contributions(estimate: Estimate) -> Table:
    """What contributes to the error of an estimate. A group is followed by its members."""
    head = ["quantity", "value", "sigma", "sensitivity"]
    head += [in_unit("contribution", estimate.unit), "share"]
    rows = [cells(entry) for row in estimate.contributions for entry in (row, *row.members)]
    return Table(head, rows)


def cells(row: Contribution) -> list[str]:
    """Cells of what contributes to an estimate. A member of a group has no share."""
    slope = number(row.sensitivity)
    if row.sensitivity_error is not None and row.sensitivity_error >= 1e-3 * abs(row.sensitivity):
        slope += f" +- {row.sensitivity_error:.1g}"
    quantity = row.quantity if row.share is not None else f"  {row.quantity}"
    return [
        quantity + (f" ({row.distribution})" if row.distribution else ""),
        number(row.value) and in_unit(number(row.value), row.unit),
        number(row.sigma, 3),
        slope,
        f"{row.contribution:.4g}" if row.sensitivity is None else f"{row.contribution:+.4g}",
        "" if row.share is None else f"{100 * row.share:.2f} %",
    ]


def number(value: float | None, digits: int = 5) -> str:
    """A number as text; empty without one."""
    return "" if value is None else f"{value:.{digits}g}"


def in_unit(text: str, unit: str) -> str:
    """A text with a unit behind it, which a ratio does not have."""
    return text if unit in ("", "1") else f"{text} {unit}"


def change(value: float | None) -> str:
    """A change of the result, as text."""
    return "outside its bounds" if value is None else f"{value:+.4g}"

"""Sections of an uncertainty budget."""

from mi_lcair.declared import percent
from mi_lcair.results.sections import Facts, Remarks, Section, Table


def sections(budget) -> list[Section]:
    """The result and its uncertainty, what contributes to it, and what renders say about that."""
    head = [
        "quantity",
        "value",
        "sigma",
        "sensitivity",
        f"contribution{budget.words_of_unit}",
        "share",
    ]
    rows = []
    for row in budget.rows:
        rows.append(cells(row, f"{100 * row.share:.2f} %"))
        rows += [cells(member, "", indent="  ") for member in row.members]
    parts = [Facts(uncertainty(budget)), Table(head, rows), Remarks(budget.remarks)]
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
    unit = budget.words_of_unit
    relative = f", {percent(budget.sigma / abs(budget.value))}" if budget.value else ""
    stated = f"{budget.value:.6g} +- {budget.sigma:.3g}{unit} (one standard uncertainty{relative})"
    rows = [
        (budget.title, stated),
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
                f"{drawn.mean:.6g} +- {drawn.sigma:.3g}{unit} (itself +- "
                f"{drawn.sigma_error:.2g}) from {drawn.draws} draws, 95 % in "
                f"{low:.5g}..{high:.5g}; linear, of the quantities alone: "
                f"{budget.sigma_of_quantities:.3g}",
            )
        )
    return [*rows, ("renders", f"{budget.renders} of {budget.paths} paths")]


def cells(row, share: str, indent: str = "") -> list[str]:
    """Cells of a row of the budget."""
    unit = "" if row.unit in ("", "1") else f" {row.unit}"
    slope = number(row.sensitivity)
    if row.sensitivity_error is not None and row.sensitivity_error >= 1e-3 * abs(row.sensitivity):
        slope += f" +- {row.sensitivity_error:.1g}"
    return [
        f"{indent}{row.quantity}" + (f" ({row.distribution})" if row.distribution else ""),
        number(row.value) + (unit if row.value is not None else ""),
        number(row.sigma, 3),
        slope,
        f"{row.contribution:+.4g}" if row.value is not None else f"{row.contribution:.4g}",
        share,
    ]


def number(value: float | None, digits: int = 5) -> str:
    """A number as text; empty without one."""
    return "" if value is None else f"{value:.{digits}g}"


def change(value: float | None) -> str:
    """A change of the result, as text."""
    return "outside its bounds" if value is None else f"{value:+.4g}"


def in_unit(row, number: float) -> str:
    """A number in the unit of an uncertain quantity."""
    return f"{number:g}" if row.unit == "1" else f"{number:g} {row.unit}"


def contribution(row, value: str, slope: str, sigma: float, total: float) -> tuple[str, ...]:
    """Cells of an uncertain quantity: value, standard uncertainty, slope, contribution and share.

    sigma: its standard uncertainty of the result. total: that of all quantities together.
    """
    share = f"{100 * (sigma / total) ** 2:.1f} %"
    return row.quantity, value, in_unit(row, row.number.sigma), slope, f"{sigma:.3g}", share

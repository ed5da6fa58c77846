"""Tornado chart of an uncertainty budget."""

from mi_lcair.drawing import new_figure, plain, styled
from mi_lcair.knowing.budgets.budget import Budget
from mi_lcair.sections import typeset

MOST_ROWS = 20  # rows that are drawn; the smaller ones are left out
RAISES, LOWERS, NEUTRAL = "C3", "C0", "C7"  # colours
# Points of the changes that renders found
CHECKED = {"marker": "D", "markersize": 5, "markeredgecolor": "black", "linestyle": "none"}


@styled
def figure(budget: Budget):
    """Figure with a bar for the contribution of each row, the largest at the top.

    The side on which plus one standard deviation moves the result has another colour than the side
    of minus one. Points show the changes that renders found.
    """
    rows = [row for row in budget.rows if row.contribution != 0][:MOST_ROWS]
    checks = {check.quantity: check for check in budget.checks}
    height = 1.7 + 0.32 * max(len(rows), 2)
    figure = new_figure((8, height), layout="constrained")
    panel = figure.subplots()
    for place, row in enumerate(rows):
        colors = (NEUTRAL, NEUTRAL) if row.value is None else (RAISES, LOWERS)
        for sign, color in zip((1, -1), colors):
            panel.barh(place, sign * row.contribution, 0.65, color=color, alpha=0.75)
        check = checks.get(row.quantity)
        # The check moves a group toward larger results, and a quantity toward larger values
        for change, color in zip((check.plus, check.minus), colors) if check else ():
            if change is not None:
                panel.plot(change, place, color=color, **CHECKED)
        reach = max(abs(row.contribution), *(abs(c) for c in changes(check)), 0)
        panel.annotate(
            f"{share(row.share)}",
            (reach, place),
            xytext=(6, 0),
            textcoords="offset points",
            va="center",
            fontsize=8,
        )
    panel.set_yticks(range(len(rows)), [label(row) for row in rows], fontsize=8)
    panel.invert_yaxis()
    panel.axvline(0, color="black", linewidth=0.8)
    panel.margins(x=0.17)
    panel.ticklabel_format(axis="x", style="sci", scilimits=(-2, 4))
    unit = "" if budget.estimate.unit == "1" else f" ({typeset(budget.estimate.unit)})"
    panel.set_xlabel(f"change of the {plain(budget.title)}{unit}")
    figure.suptitle(
        f"{plain(budget.what)}: {typeset(str(budget.estimate))} (one standard uncertainty)"
    )
    legend(panel, bool(checks))
    return figure


def changes(check) -> list[float]:
    """The changes that renders found for a row, if it was checked."""
    return [c for c in (check.plus, check.minus) if c is not None] if check else [0.0]


def label(row) -> str:
    """Name of a row, with its standard deviation if it is a quantity."""
    if row.sigma is None:
        return plain(row.quantity)
    unit = "" if row.unit == "1" else f" {typeset(row.unit)}"
    kind = f" ({row.distribution})" if row.distribution else ""
    return f"{plain(row.quantity)} ± {row.sigma:.3g}{unit}{kind}"


def share(fraction: float) -> str:
    """A share of the variance as text."""
    return f"{100 * fraction:.3g} %" if fraction >= 1e-3 else "< 0.1 %"


def legend(panel, has_checks: bool) -> None:
    """Explain colours and points under the panel."""
    from matplotlib.patches import Patch

    handles = [
        Patch(color=RAISES, alpha=0.75, label="plus one sigma"),
        Patch(color=LOWERS, alpha=0.75, label="minus one sigma"),
    ]
    if has_checks:
        handles += panel.plot([], [], color="white", label="rendered at one sigma", **CHECKED)
    panel.legend(
        handles=handles,
        loc="upper center",
        bbox_to_anchor=(0.4, -0.75 / panel.figure.get_figheight()),
        ncols=3,
    )

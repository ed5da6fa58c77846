"""Sections of a temperature."""

import numpy as np

from mi_lcair.results.result import summary_of
from mi_lcair.results.sections import Facts, Remarks, Section, Table


def sections(result) -> list[Section]:
    """The temperature, the air, and the budget of the uncertainty."""
    sigma = result.typical(result.sigma)
    uncertainty = f"{sigma:.3g} K (standard), +- {2 * sigma:.3g} K (k = 2, about 95 %)"
    rows = [
        ("uncertainty", uncertainty if sigma else "none is stated; 0.92+-0.02 states one"),
        ("transmittance", f"{result.transmittance:.4f}, mean in the band"),
    ]
    if result.kelvin.size > 1:
        known = int(np.isfinite(result.kelvin).sum())
        rows.append(("pixels", f"{known} of {result.kelvin.size} have a temperature"))
    parts = [summary_of(result), Facts(rows)]
    head = ["quantity", "value", "sigma", "slope", "contribution K", "share"]
    budget = []
    for row in result.contributions:
        unit = "" if row.unit == "1" else f" {row.unit}"
        value = "" if row.quantity == "apparent" else f"{row.number.value:g}{unit}"
        contribution = result.typical(row.sigma)
        slope = f"{result.typical(row.slope):.4g} K{f' per{unit}' if unit else ''}"
        share = f"{100 * (contribution / sigma) ** 2:.1f} %"
        budget.append(
            (
                row.quantity,
                value,
                f"{row.number.sigma:g}{unit}",
                slope,
                f"{contribution:.3g}",
                share,
            )
        )
    parts += [Table(head, budget)] if budget else []
    return [Section("Temperature", [*parts, Remarks(list(result.remarks))])]

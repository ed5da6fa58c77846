"""Sections of a temperature."""

import numpy as np

from mi_lcair.reports.sections.budget import contribution, in_unit
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
        value = "" if row.quantity == "apparent" else in_unit(row, row.number.value)
        per = "" if row.unit == "1" else f" per {row.unit}"
        slope = f"{result.typical(row.slope):.4g} K{per}"
        budget.append(contribution(row, value, slope, result.typical(row.sigma), sigma))
    parts += [Table(head, budget)] if budget else []
    return [Section("Temperature", [*parts, Remarks(list(result.remarks))])]

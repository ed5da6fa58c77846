"""Sections of a temperature."""

import numpy as np

from mi_lcair.reports.sections.budget import contributions
from mi_lcair.results.result import summary_of
from mi_lcair.results.sections import Facts, Remarks, Section


def sections(result) -> list[Section]:
    """The temperature, the air, and the budget of the uncertainty."""
    sigma = result.typical.standard_error
    uncertainty = f"{sigma:.3g} K (standard), +- {2 * sigma:.3g} K (k = 2, about 95 %)"
    rows = [
        ("uncertainty", uncertainty if sigma else "none is stated; 0.92+-0.02 states one"),
        ("transmittance", f"{result.transmittance:.4f}, mean in the band"),
    ]
    if result.kelvin.size > 1:
        known = int(np.isfinite(result.kelvin).sum())
        rows.append(("pixels", f"{known} of {result.kelvin.size} have a temperature"))
    parts = [summary_of(result), Facts(rows)]
    if result.estimate.contributions:
        parts.append(contributions(result.typical))
    return [Section("Temperature", [*parts, Remarks(list(result.remarks))])]

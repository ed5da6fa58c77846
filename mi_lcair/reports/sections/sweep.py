"""Sections of a sweep."""

import numpy as np

from mi_lcair.results.result import summary_of
from mi_lcair.results.sections import Facts, LongTable, Section


def sections(sweep) -> list[Section]:
    """The conditions, the extremes of the quantities, and the table of a sweep."""
    extremes = [
        (name, f"{np.nanmin(values):.5g} to {np.nanmax(values):.5g}")
        for name, values in sweep.table.items()
        if not ("_standard_error" in name or "_half_width" in name or np.isnan(values).all())
    ]
    parts = [summary_of(sweep), Facts(extremes), LongTable(sweep.columns())]
    return [Section("Signatures by condition", parts)]

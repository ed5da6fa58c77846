"""Sections of a sweep."""

import numpy as np

from mi_lcair.results.result import summary_of
from mi_lcair.results.sections import Facts, LongTable, Section


def sections(sweep) -> list[Section]:
    """The conditions, the extremes of the quantities, and the table of a sweep."""
    parts = [summary_of(sweep), extremes(sweep.table), LongTable(sweep.columns())]
    return [Section("Signatures by condition", parts)]


def extremes(columns: dict[str, np.ndarray]) -> Facts:
    """The least and the greatest value of each quantity. The summary counts `reached`."""
    return Facts(
        [
            (name, f"{np.nanmin(values):.5g} to {np.nanmax(values):.5g}")
            for name, values in columns.items()
            if values.dtype.kind in "iuf"
            and name != "reached"
            and not ("_standard_error" in name or "_half_width" in name or np.isnan(values).all())
        ]
    )

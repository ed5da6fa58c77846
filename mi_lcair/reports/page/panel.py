"""Parts of a page that scripts draw, and tables among them."""

from dataclasses import dataclass

import numpy as np

from mi_lcair.errors import printable
from mi_lcair.results.cells import heading, typeset_unit
from mi_lcair.results.sections import LongTable

LONGEST = 200  # characters of a title or label


@dataclass(frozen=True)
class Panel:
    """A part of a page that a script draws.

    kind: name of the script's function, such as "image". data: what the function gets; arrays may
    lie at any depth. height: height before the script has run, pixels.
    """

    kind: str
    data: dict
    height: int = 480


def table_panel(table: LongTable) -> Panel:
    """The panel of a table of many rows, which is sorted and turned page by page."""
    columns = [column_data(*item) for item in table.columns.items()]
    return Panel("table", {"columns": columns, "sort": table.sort_by}, height=300)


def column_data(name: str, values) -> dict:
    """A column for the scripts: numbers as they are, texts as numbers of a list of names."""
    values = np.asarray(values)
    words, unit = heading(name)
    entries = {"name": name, "title": words, "unit": typeset_unit(unit)}
    if values.dtype.kind == "b":
        values = np.where(values, "yes", "no")
    if values.dtype.kind in "fiu":
        return entries | {"values": values if values.dtype.kind == "f" else values.astype(int)}
    names, codes = np.unique(values.astype(str), return_inverse=True)
    return entries | {"values": codes, "names": [printable(text) for text in names]}

"""Tables of this project as files: their columns."""

from pathlib import Path

import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.formats import netcdf
from mi_lcair.table import read_table


def read_columns(path: str | Path) -> dict[str, np.ndarray]:
    """Columns of a .csv or .nc file by name: Float64 with NaN for what is missing, or texts.

    Raises InputError for a file that is no table.
    """
    if Path(path).suffix.lower() == ".nc":
        return netcdf.read_columns(path)
    table = read_table(path, ())
    columns = {}
    for place, name in enumerate(table.columns):
        try:
            columns[name] = table.numbers([name], may_lack=True)[name]
        except InputError:
            columns[name] = np.array([cells[place] for _, cells in table.rows], dtype=object)
    return columns

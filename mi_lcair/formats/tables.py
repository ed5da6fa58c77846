"""Tables of this project as files: their columns, and which kind of table they are."""

from pathlib import Path

import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.formats import netcdf
from mi_lcair.table import read_table

# Kinds of tables, and the columns by which they are known
TREND, SPECTRUM, FACETS = "a trend", "a spectrum", "a table of facets"
KNOWN_BY = {
    TREND: ("azimuth_deg", "elevation_deg", "intensity_W_sr"),
    SPECTRUM: ("wavelength_um", "target_W_sr_um"),
    FACETS: ("facet",),
}
RESULTS = "a table of results"  # that of a sweep or a flight, known by the INTERVALS in its columns
INTERVALS = "_half_width"


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


def kind_of(path: str | Path, names) -> str:
    """TREND, SPECTRUM, FACETS or RESULTS, by the names of a table's columns.

    Raises InputError for another table; `path` is that of its file in the message.
    """
    if any(INTERVALS in name for name in names):
        return RESULTS
    for kind, needed in KNOWN_BY.items():
        if set(needed) <= set(names):
            return kind
    trend, spectrum, facets = (", ".join(needed) for needed in KNOWN_BY.values())
    raise InputError(
        f"'{path}': neither a trend ({trend}), nor a spectrum ({spectrum}), nor facets ({facets}), "
        f"nor the table of a sweep or a flight (with columns *{INTERVALS}*)"
    )

"""Plain CSV files: one header line, one row a line, nothing else."""

import csv
from pathlib import Path

import numpy as np

from mi_lcair.files import replacing
from mi_lcair.table import safe_cell

DIGITS = 9  # significant digits of a number; they keep every Float32


def write(path: str | Path, columns: dict[str, np.ndarray]) -> None:
    """Write columns of equal length as a CSV file, completely or not at all.

    `pandas.read_csv(path)` gives them back without options. Separators are commas, the decimal mark
    is a point, a missing value (NaN) is an empty cell.

    Parameters
    ----------
    path : path-like
        File to write.
    columns : dict of str to array-like
        Numbers or texts by name of column. The unit is the end of the name, such as intensity_W_sr.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    with replacing(path) as partial, partial.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(map(safe_cell, columns))
        for row in zip(*columns.values(), strict=True):
            writer.writerow(map(cell, row))


def cell(value) -> str:
    """A value as the file holds it.

    Texts come from the user's files and are made safe for spreadsheets.
    """
    if isinstance(value, str):
        return safe_cell(value)
    if isinstance(value, (bool, np.bool_)):
        return str(int(value))
    if isinstance(value, (float, np.floating)):
        return "" if np.isnan(value) else f"{value:.{DIGITS}g}"
    return str(value)

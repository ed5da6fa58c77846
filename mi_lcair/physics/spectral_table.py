"""CSV files of spectra.

A file has # comments, a header of named columns, and rows of numbers. It holds one spectrum, or one
spectrum for each value of a key column.
"""

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.files import revision
from mi_lcair.table import LARGEST, read_table

WAVELENGTH = "wavelength_um"
SHORTEST_UM, LONGEST_UM = 0.1, 1000.0
HIGHEST_DEG = 90.0  # largest elevation that may be a key


@dataclass(frozen=True, eq=False)
class SpectralTable:
    """Columns of numbers over wavelength.

    Attributes
    ----------
    keys
        Rising keys of the spectra, (k,); None if the file holds a single spectrum.
    wavelengths_um
        Rising wavelengths [um], (n,).
    columns
        The columns, (n,) each, or (k, n) if the file has keys.
    """

    keys: np.ndarray | None
    wavelengths_um: np.ndarray
    columns: tuple[np.ndarray, ...]


def spectral_table(
    path: Path,
    kind: str,
    columns: tuple[tuple[str, float], ...],
    key: str | None = None,
    keyless: bool = False,
) -> SpectralTable:
    """Read wavelengths and columns of a CSV file, in whatever order the file has them.

    Parameters
    ----------
    path
        The CSV file.
    kind
        What error messages call the file, such as "spectrum".
    columns
        Name and largest accepted value of each column. Negative values are refused.
    key
        Column that tells spectra apart: rows with the same key are one spectrum, and all spectra
        have the same wavelengths. None for a file with a single spectrum.
    keyless
        Whether the file may lack the column `key`.

    Returns
    -------
    SpectralTable
        The columns in the order of `columns`.

    Raises
    ------
    InputError
        With the line that cannot be used.
    """
    return _read(path, revision(path), kind, columns, key, keyless)


@lru_cache(maxsize=8)
def _read(path, revision, kind, columns, key, keyless) -> SpectralTable:
    what = f"{kind} {path}"
    of_key = {} if key is None else {key: HIGHEST_DEG if key.endswith("_deg") else LARGEST}
    largest = {WAVELENGTH: LONGEST_UM, **of_key, **dict(columns)}
    file = read_table(path, [name for name in largest if name != key or not keyless], kind)
    if keyless and key not in file.columns:
        del largest[key]
    table = file.numbers(largest)
    for name, limit in largest.items():
        file.check_range(name, table[name], SHORTEST_UM if name == WAVELENGTH else 0, limit)
    numbers = [number for number, _ in file.rows]

    key_of_row = table.get(key, np.zeros(len(numbers)))
    keys = np.unique(key_of_row)
    blocks = [np.flatnonzero(key_of_row == value) for value in keys]
    if not blocks or len(blocks[0]) < 2:
        raise InputError(f"{what}: needs two rows or more, with rising {WAVELENGTH}")
    for block in blocks:
        wavelengths = table[WAVELENGTH][block]
        if np.any(np.diff(wavelengths) <= 0):
            k = int(np.argmax(np.diff(wavelengths) <= 0))
            raise InputError(
                f"{what}, line {numbers[block[k + 1]]}: {WAVELENGTH} {wavelengths[k + 1]:g} after "
                f"{wavelengths[k]:g}; must be rising"
            )
        if not np.array_equal(wavelengths, table[WAVELENGTH][blocks[0]]):
            raise InputError(
                f"{what}, line {numbers[block[0]]}: every {key} must have the same wavelengths"
            )
    spectra = [np.array([table[name][block] for block in blocks]) for name, _ in columns]
    if key not in table:
        return SpectralTable(None, wavelengths, tuple(column[0] for column in spectra))
    return SpectralTable(keys, wavelengths, tuple(spectra))

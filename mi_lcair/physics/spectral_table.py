"""CSV files of spectra: # comments, a header of named columns, rows of numbers; one spectrum, or
one for each key.
"""

import os
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.table import LARGEST, read_table

WAVELENGTH = "wavelength_um"
SHORTEST_UM, LONGEST_UM = 0.1, 1000.0


@dataclass(frozen=True, eq=False)
class SpectralTable:
    """Columns over rising wavelengths (um, (n,)): (n,) each, or (keys, n) where a column of keys
    tells spectra apart.
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
    """Reads the wavelengths and `columns` (name, largest value; none may be negative), in whatever
    order the file has them.

    key: the column whose values, in rising order, stand for one spectrum each, all of the same
    wavelengths (None: one spectrum alone); keyless: the file may lack it. kind: what errors call
    the file. Raises InputError with the line that cannot be used.
    """
    written = (
        path.stat().st_mtime_ns if os.path.exists(path) else None
    )  # a file that was edited is another one
    return _read(path, written, kind, columns, key, keyless)


@lru_cache(maxsize=8)
def _read(path, written, kind, columns, key, keyless) -> SpectralTable:
    what = f"{kind} {path}"
    largest = {WAVELENGTH: LONGEST_UM, **({key: LARGEST} if key else {}), **dict(columns)}
    file = read_table(path, [name for name in largest if name != key or not keyless], kind)
    if keyless and key not in file.columns:
        del largest[key]
    table = file.numbers(largest)
    for name, limit in largest.items():
        file.check_range(name, table[name], SHORTEST_UM if name == WAVELENGTH else 0, limit)
    numbers = [number for number, _ in file.rows]

    of_key = table.get(key, np.zeros(len(numbers)))
    keys = np.unique(of_key)
    blocks = [np.flatnonzero(of_key == value) for value in keys]
    if not blocks or len(blocks[0]) < 2:
        raise InputError(f"{what}: needs two rows or more, with rising {WAVELENGTH}")
    for block in blocks:
        wavelengths = table[WAVELENGTH][block]
        if np.any(np.diff(wavelengths) <= 0):
            k = int(np.argmax(np.diff(wavelengths) <= 0))
            raise InputError(
                f"{what}, line {numbers[block[k + 1]]}: {WAVELENGTH} {wavelengths[k + 1]:g} after {wavelengths[k]:g}; must be rising"
            )
        if not np.array_equal(wavelengths, table[WAVELENGTH][blocks[0]]):
            raise InputError(
                f"{what}, line {numbers[block[0]]}: every {key} must have the same wavelengths"
            )
    found = [np.array([table[name][block] for block in blocks]) for name, _ in columns]
    if key not in table:
        return SpectralTable(None, wavelengths, tuple(column[0] for column in found))
    return SpectralTable(keys, wavelengths, tuple(found))

"""CSV files of spectra.

A file has # comments, a header of named columns, and rows of numbers. It holds one spectrum, or one
spectrum for each value of a key column or combination of values of several.
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
HIGHEST_DEG = {
    "elevation_deg": 90.0,
    "azimuth_deg": 180.0,
    "theta_deg": 90.0,
}  # largest angles that may be keys


@dataclass(frozen=True, eq=False)
class SpectralTable:
    """Columns of numbers over wavelength.

    Attributes
    ----------
    keys
        Keys of the spectra by column, (k,) each, rising in the order of the columns; none if the
        file holds a single spectrum.
    wavelengths_um
        Rising wavelengths [um], (n,).
    columns
        The columns, (n,) each, or (k, n) if the file has keys.
    """

    keys: dict[str, np.ndarray]
    wavelengths_um: np.ndarray
    columns: tuple[np.ndarray, ...]

    def grid(self, what: str) -> tuple[list[np.ndarray], list[np.ndarray]]:
        """Rising values of each key, and the columns over these and wavelength, (..., n).

        Raises InputError, which begins with `what`, if a combination of values has no spectrum.
        """
        axes = [np.unique(values) for values in self.keys.values()]
        shape = [len(axis) for axis in axes]
        count = len(self.columns[0])
        if count != np.prod(shape):
            each = " and ".join(f"{n} {name}" for n, name in zip(shape, self.keys))
            raise InputError(f"{what}: {count} spectra for {each}; each pair must have one")
        return axes, [column.reshape(*shape, -1) for column in self.columns]


def spectral_table(
    path: Path,
    kind: str,
    columns: tuple[tuple[str, float], ...],
    keys: tuple[str, ...] = (),
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
    keys
        Columns that tell spectra apart: rows with the same keys are one spectrum, and all spectra
        have the same wavelengths. None for a file with a single spectrum.
    keyless
        Whether the file may lack these columns.

    Returns
    -------
    SpectralTable
        The columns in the order of `columns`.

    Raises
    ------
    InputError
        With the line that cannot be used.
    """
    return _read(path, revision(path), kind, columns, keys, keyless)


@lru_cache(maxsize=8)
def _read(path, revision, kind, columns, keys, keyless) -> SpectralTable:
    what = f"{kind} {path}"
    of_keys = {key: HIGHEST_DEG.get(key, LARGEST) for key in keys}
    largest = {WAVELENGTH: LONGEST_UM, **of_keys, **dict(columns)}
    file = read_table(path, [name for name in largest if name not in keys or not keyless], kind)
    keys = [key for key in keys if key in file.columns]
    largest = {name: limit for name, limit in largest.items() if name in file.columns}
    table = file.numbers(largest)
    for name, limit in largest.items():
        file.check_range(name, table[name], SHORTEST_UM if name == WAVELENGTH else 0, limit)
    numbers = [number for number, _ in file.rows]

    keys_of_rows = np.stack([np.zeros(len(numbers)), *(table[key] for key in keys)])
    of_blocks, block_of_row = np.unique(keys_of_rows, axis=1, return_inverse=True)
    blocks = [np.flatnonzero(block_of_row == k) for k in range(of_blocks.shape[1])]
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
                f"{what}, line {numbers[block[0]]}: every {' and '.join(keys)} must have the same "
                "wavelengths"
            )
    spectra = [np.array([table[name][block] for block in blocks]) for name, _ in columns]
    if not keys:
        spectra = [column[0] for column in spectra]
    return SpectralTable(dict(zip(keys, of_blocks[1:])), wavelengths, tuple(spectra))

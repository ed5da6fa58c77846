"""CSV files of spectra.

A file has # comments, a header of named columns, and rows of numbers. It holds one spectrum, or one
spectrum for each value of a key column or combination of values of several.
"""

import warnings
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from mi_lcair.declared import Bounds
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
        least = SHORTEST_UM if name == WAVELENGTH else 0
        file.check_range(name, table[name], Bounds(lower=least, upper=limit))
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


# Tables of measured directional quantities
# -----------------------------------------
# They are CSV files `theta_deg,emissivity[,emissivity_std]` or `theta_deg,dhr[,dhr_std]`.

# Smallest accepted standard deviation. No instrument is better, and 1 / std^2 stays finite.
SMALLEST_STD = 1e-6
# Largest distance from the table's first angle to 0 degrees, and from its last angle to 90 degrees,
# that causes no warning.
FARTHEST_DEG = 15.0


def read_directional_table(
    path, quantity: str = "emissivity"
) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
    """Read angles, values and standard deviations of a measured table.

    Parameters
    ----------
    path
        CSV file. Lines that start with # are comments.
    quantity
        Name of the column of values. Their standard deviations are in `<quantity>_std`.

    Returns
    -------
    tuple
        Ascending angles [radians], values (0..1) and standard deviations, (n,) each. The last is
        None if the file has no such column.

    Raises
    ------
    InputError
        If the file or a column is missing, a row has more or fewer cells than the header, a cell is
        no number, a value lies outside 0..1, a standard deviation is not positive, or an angle lies
        outside 0..90 degrees or appears twice.
    """
    table = read_table(path, ("theta_deg", quantity))
    std = f"{quantity}_std"
    bounds = {
        "theta_deg": Bounds(lower=0, upper=90),
        quantity: Bounds(lower=0, upper=1),
        std: Bounds(lower=SMALLEST_STD, upper=1),
    }
    columns = table.numbers([name for name in bounds if name in table.columns])
    for name, values in columns.items():
        table.check_range(name, values, bounds[name])
    theta, value = columns["theta_deg"], columns[quantity]
    order = np.argsort(theta, kind="stable")
    repeated = order[1:][np.diff(theta[order]) == 0]
    if repeated.size:
        row = repeated.min()
        raise InputError(
            f"{path}, line {table.rows[row][0]}: theta_deg {theta[row]:g} appears twice"
        )
    return np.radians(theta[order]), value[order], columns[std][order] if std in columns else None


def over_the_hemisphere(path, theta: np.ndarray, values: np.ndarray, nodes: np.ndarray):
    """Values of a measured table at other angles over the hemisphere.

    They are interpolated linearly between the measured angles. Outside them the nearest value is
    used. A Python warning says so if the table ends more than FARTHEST_DEG from 0 or 90 degrees.

    Parameters
    ----------
    path
        Name of the table, for the warning.
    theta
        Ascending measured angles [radians], (n,).
    values
        Measured values, (n,).
    nodes
        Angles from 0 to pi/2 at which values are returned [radians], (m,).

    Returns
    -------
    numpy.ndarray
        Values at `nodes`, (m,).
    """
    first, last = np.degrees(theta[[0, -1]])
    if first > FARTHEST_DEG or 90 - last > FARTHEST_DEG:
        measured = f"{first:g}..{last:g} degrees" if last > first else f"{first:g} degrees alone"
        warnings.warn(
            f"{path}: measured at {measured}; the nearest value is used at all other angles of "
            "0..90",
            stacklevel=2,
        )
    return np.interp(nodes, theta, values)

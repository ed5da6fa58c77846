"""CSV files of spectra: # comments, a header of named columns, rows of numbers; one spectrum, or
one for each key.
"""

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from mi_lcair.errors import InputError

WAVELENGTH = "wavelength_um"


@dataclass(frozen=True, eq=False)
class SpectralTable:
    """Columns over rising wavelengths (um, (n,)): (n,) each, or (keys, n) where a column of keys
    tells spectra apart.
    """

    keys: np.ndarray | None
    wavelengths_um: np.ndarray
    columns: tuple[np.ndarray, ...]


def spectral_table(
    path: Path, kind: str, columns: tuple[tuple[str, float], ...], key: str, keyless: bool = False
) -> SpectralTable:
    """Reads the wavelengths and `columns` (name, largest value; none may be negative), in whatever
    order the file has them.

    key: the column whose values, in rising order, stand for one spectrum each, all of the same
    wavelengths; keyless: the file may lack it. kind: what errors call the file. Raises InputError
    with the line that cannot be used.
    """
    written = (
        path.stat().st_mtime_ns if path.exists() else None
    )  # a file that was edited is another one
    return _read(path, written, kind, columns, key, keyless)


@lru_cache(maxsize=8)
def _read(path, written, kind, columns, key, keyless) -> SpectralTable:
    what = f"{kind} {path}"
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(
            f"{what}: cannot be read as a text file ({error.__class__.__name__})"
        ) from None
    rows = [
        (n, [cell.strip() for cell in line.split(",")])
        for n, line in enumerate(lines, 1)
        if line.strip() and line[0] != "#"
    ]
    header = rows[0][1] if rows else []
    largest = {WAVELENGTH: np.inf, key: np.inf, **dict(columns)}
    if keyless and key not in header:
        del largest[key]
    if not set(largest) <= set(header):
        raise InputError(
            f"{what}: the header must name {_listed(largest)}; found: {', '.join(header) or 'nothing'}"
        )
    numbers = [n for n, _ in rows[1:]]
    values = np.array(
        [
            _numbers(what, n, cells, [header.index(name) for name in largest])
            for n, cells in rows[1:]
        ]
    )
    table = dict(zip(largest, values.reshape(-1, len(largest)).T))
    for name, limit in largest.items():
        allowed = (table[name] >= 0) & (table[name] <= limit) & np.isfinite(table[name])
        if not allowed.all():
            k = int(np.argmin(allowed))
            raise InputError(
                f"{what}, line {numbers[k]}: {name} {table[name][k]:g}; "
                f"must {'be 0 or more' if limit == np.inf else f'lie in 0..{limit:g}'}"
            )

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


def _numbers(what, line, cells, places) -> list[float]:
    try:
        return [float(cells[place]) for place in places]
    except (ValueError, IndexError):
        raise InputError(
            f"{what}: line {line} is '{','.join(cells)[:60]}'; each row must hold numbers"
        ) from None


def _listed(names) -> str:
    *first, last = names
    return f"{', '.join(first)} and {last}"

"""Measured or computed spectra of sources that are no blackbodies, among them the bundled sky tables."""
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from ..errors import InputError, unknown
from .bands import Band

BUNDLED = Path(__file__).with_name("lowtran7")
WAVELENGTH, RADIANCE, ELEVATION = "wavelength_um", "radiance_W_m2_sr_um", "elevation_deg"
GAP_UM = 0.1        # rows further apart than this leave out what lies between them


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Spectral radiance [W m^-2 sr^-1 um^-1] over rising wavelengths [um], straight lines between the rows."""

    name: str
    wavelengths_um: np.ndarray
    radiance: np.ndarray

    def at(self, wavelengths_um) -> np.ndarray:
        """Spectral radiance at these wavelengths (um)."""
        return np.interp(wavelengths_um, self.wavelengths_um, self.radiance)

    def in_band_radiance(self, band: Band) -> float:
        """W m^-2 sr^-1 in the band. Raises InputError where the table does not cover it."""
        x = self.wavelengths_um
        first, last = np.searchsorted(x, band.lower_um, side="right") - 1, np.searchsorted(x, band.upper_um)
        if first < 0 or last == len(x) or np.diff(x[first:last + 1]).max() > GAP_UM:
            parts = np.split(x, np.flatnonzero(np.diff(x) > GAP_UM) + 1)
            covered = ", ".join(f"{part[0]:.4g}-{part[-1]:.4g}" for part in parts)
            raise InputError(f"spectrum '{self.name}': does not cover band {band.label}; it has {covered} um")
        return float(band.integral(x, self.radiance))


def sky_names() -> list[str]:
    """Names of the bundled sky tables (LOWTRAN7; their headers say how they were made), without 'sky_' and '.csv'."""
    return sorted(file.stem.removeprefix("sky_") for file in BUNDLED.glob("sky_*.csv"))


def spectrum(source: str | Path, elevation_deg: float | None = None) -> Spectrum:
    """The spectrum that `source` holds.

    source: a CSV with the columns wavelength_um and radiance_W_m2_sr_um, or the name of a bundled sky table. A table
    with a column elevation_deg holds one spectrum for each elevation of the line of sight: `elevation_deg` chooses,
    with straight lines between its elevations and the nearest one outside them. Raises InputError for an unknown
    name, a file that holds no spectrum, an elevation that is missing or out of place.
    """
    path = Path(source)
    if not path.suffix:
        if str(source) not in sky_names():
            raise unknown("sky table", str(source), sky_names())
        path = BUNDLED / f"sky_{source}.csv"
    elevations, wavelengths, radiance = _table(path)
    if elevations is None:
        if elevation_deg is not None:
            raise InputError(f"spectrum {path}: has no column {ELEVATION}, so that an elevation cannot be chosen")
        return Spectrum(str(source), wavelengths, radiance)
    if elevation_deg is None or not 0 <= elevation_deg <= 90:
        raise InputError(f"spectrum {path}: elevation_deg = {elevation_deg} must lie in 0..90, to choose one of its "
                         f"{len(elevations)} lines of sight")
    values = [np.interp(elevation_deg, elevations, column) for column in radiance.T]
    return Spectrum(f"{source} {elevation_deg:g} deg", wavelengths, np.array(values))


@lru_cache(maxsize=8)
def _table(path: Path):
    """Elevations (or None), wavelengths and radiance: (n,) without elevations, (elevations, n) with them."""
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"spectrum {path}: cannot be read as a text file ({error.__class__.__name__})") from None
    rows = [(n, [cell.strip() for cell in line.split(",")]) for n, line in enumerate(lines, 1) if line.strip() and line[0] != "#"]
    columns = rows[0][1] if rows else []
    if WAVELENGTH not in columns or RADIANCE not in columns:
        raise InputError(f"spectrum {path}: the header must name {WAVELENGTH} and {RADIANCE}; found: {', '.join(columns) or 'nothing'}")
    wanted = [columns.index(name) for name in (ELEVATION, WAVELENGTH, RADIANCE) if name in columns]
    try:
        table = np.array([[float(cells[k]) for k in wanted] for n, cells in rows[1:]]).reshape(-1, len(wanted))
    except (ValueError, IndexError):
        raise InputError(f"spectrum {path}: {_first_bad(rows[1:], wanted)}; each row must hold numbers") from None
    if not (np.all(np.isfinite(table)) and np.all(table >= 0)):
        line = rows[1 + int(np.argmin(np.all(np.isfinite(table) & (table >= 0), axis=1)))][0]
        raise InputError(f"spectrum {path}, line {line}: a value is negative or not finite")
    blocks = [table[:, -2:]]
    elevations = None
    if ELEVATION in columns and len(table):
        elevations = np.unique(table[:, 0])
        blocks = [table[table[:, 0] == elevation, 1:] for elevation in elevations]
    wavelengths = blocks[0][:, 0]
    if len(wavelengths) < 2 or np.any(np.diff(wavelengths) <= 0):
        raise InputError(f"spectrum {path}: needs two rows or more, with rising {WAVELENGTH}")
    if any(len(block) != len(wavelengths) or np.any(block[:, 0] != wavelengths) for block in blocks):
        raise InputError(f"spectrum {path}: every {ELEVATION} must have the same wavelengths")
    radiance = np.array([block[:, 1] for block in blocks])
    return elevations, wavelengths, radiance if ELEVATION in columns else radiance[0]


def _first_bad(rows, wanted) -> str:
    for n, cells in rows:
        try:
            [float(cells[k]) for k in wanted]
        except (ValueError, IndexError):
            return f"line {n} is '{','.join(cells)[:60]}'"

"""Measured or computed spectra of sources that are no blackbodies, among them the bundled sky
tables.
"""

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mi_lcair.errors import InputError, unknown
from mi_lcair.physics import tape7
from mi_lcair.physics.bands import Band
from mi_lcair.physics.spectral_table import spectral_table
from mi_lcair.table import LARGEST

BUNDLED = Path(__file__).with_name("lowtran7")
RADIANCE, ELEVATION = "radiance_W_m2_sr_um", "elevation_deg"


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Spectral radiance [W m^-2 sr^-1 um^-1] over rising wavelengths [um], straight lines between
    the rows.
    """

    name: str
    wavelengths_um: np.ndarray
    radiance: np.ndarray

    def at(self, wavelengths_um) -> np.ndarray:
        """Spectral radiance at these wavelengths (um)."""
        return np.interp(wavelengths_um, self.wavelengths_um, self.radiance)

    def in_band_radiance(self, band: Band) -> float:
        """W m^-2 sr^-1 in the band. Raises InputError where the table does not cover it."""
        band.check_covered(self.wavelengths_um, f"spectrum '{self.name}'")
        return float(band.integral(self.wavelengths_um, self.radiance))


def sky_names() -> list[str]:
    """Names of the bundled sky tables (LOWTRAN7; their headers say how they were made), without
    'sky_' and '.csv'.
    """
    return sorted(file.stem.removeprefix("sky_") for file in BUNDLED.glob("sky_*.csv"))


def spectrum(source: str | Path, elevation_deg: float | None = None) -> Spectrum:
    """The spectrum that `source` holds.

    source: a CSV with the columns wavelength_um and radiance_W_m2_sr_um, a MODTRAN tape7 of one
    line of sight (its TOTAL_RAD), or the name of a bundled sky table. A table with a column
    elevation_deg holds one spectrum for each elevation of the line of sight: `elevation_deg`
    chooses, with straight lines between its elevations and the nearest one outside them. Raises
    InputError for an unknown name, a file that holds no spectrum, an elevation that is missing or
    out of place.
    """
    path, keys, wavelengths, radiance = _read(source)
    if keys is None:
        if elevation_deg is not None:
            raise InputError(
                f"spectrum {path}: has no column {ELEVATION}, so that an elevation cannot be chosen"
            )
        return Spectrum(str(source), wavelengths, radiance)
    if elevation_deg is None or not 0 <= elevation_deg <= 90:
        raise InputError(
            f"spectrum {path}: elevation_deg = {elevation_deg} must lie in 0..90, to choose one of its "
            f"{len(keys)} lines of sight"
        )
    values = [np.interp(elevation_deg, keys, column) for column in radiance.T]
    return Spectrum(f"{source} {elevation_deg:g} deg", wavelengths, np.array(values))


def has_elevations(source: str | Path) -> bool:
    """Whether `source` holds one spectrum for each elevation, so that `spectrum` needs one."""
    return _read(source)[1] is not None


def _read(source):
    """Path, elevations (None where the file has none), wavelengths and radiances."""
    path = Path(source)
    if str(source) in sky_names():
        path = BUNDLED / f"sky_{source}.csv"
    elif not path.suffix and not os.path.exists(path):
        raise unknown("sky table", str(source), sky_names())
    if tape7.is_tape7(path):
        blocks = tape7.blocks(path)
        if len({block.range_m for block in blocks}) > 1:
            raise InputError(
                f"spectrum {path}: holds lines of sight of different ranges; keep the blocks of one"
            )
        block = tape7.joined(path, blocks)
        return path, None, block.wavelengths_um, block.total_radiance
    table = spectral_table(path, "spectrum", ((RADIANCE, LARGEST),), key=ELEVATION, keyless=True)
    return path, table.keys, table.wavelengths_um, table.columns[0]

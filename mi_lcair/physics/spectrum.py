"""Measured or computed spectra of sources other than blackbodies, such as the bundled skies."""

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from mi_lcair.errors import InputError, unknown
from mi_lcair.physics import tape7
from mi_lcair.physics.bands import Band
from mi_lcair.physics.spectral_table import spectral_table
from mi_lcair.table import LARGEST

BUNDLED = Path(__file__).with_name("lowtran7")
RADIANCE, ELEVATION = "radiance_W_m2_sr_um", "elevation_deg"


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Spectral radiance over wavelength, linear between the rows.

    wavelengths_um: rising wavelengths [um], (n,). radiance: [W m^-2 sr^-1 um^-1], (n,).
    """

    name: str
    wavelengths_um: np.ndarray
    radiance: np.ndarray

    def at(self, wavelengths_um: ArrayLike) -> np.ndarray:
        """Spectral radiance [W m^-2 sr^-1 um^-1] at these wavelengths [um]."""
        return np.interp(wavelengths_um, self.wavelengths_um, self.radiance)

    def in_band_radiance(self, band: Band) -> float:
        """In-band radiance [W m^-2 sr^-1], weighted by the band's response.

        Raises InputError if the table does not cover the band.
        """
        band.check_covered(self.wavelengths_um, f"spectrum '{self.name}'")
        return float(band.integral(self.wavelengths_um, self.radiance))


def sky_names() -> list[str]:
    """Names of the bundled sky tables: their file names without "sky_" and ".csv".

    They were computed with LOWTRAN7. Their headers say how.
    """
    return sorted(file.stem.removeprefix("sky_") for file in BUNDLED.glob("sky_*.csv"))


def spectrum(source: str | Path, elevation_deg: float | None = None) -> Spectrum:
    """Read a spectrum by its name or from a file.

    Parameters
    ----------
    source
        A CSV file with the columns wavelength_um and radiance_W_m2_sr_um, a MODTRAN tape7 of one
        line of sight (its TOTAL_RAD), or the name of a bundled sky table. A table with a column
        elevation_deg holds one spectrum for each elevation of the line of sight.
    elevation_deg
        Elevation of the line of sight [degrees], for a table with elevations. The spectrum is
        interpolated linearly between the table's elevations; outside them the nearest one is used.

    Returns
    -------
    Spectrum
        Spectral radiance over wavelength.

    Raises
    ------
    InputError
        If the name is unknown, the file holds no spectrum, or the elevation is missing, superfluous
        or outside 0..90 degrees.
    """
    path, keys, wavelengths, radiance = _read(source)
    if keys is None:
        if elevation_deg is not None:
            raise InputError(
                f"spectrum {path}: has no column {ELEVATION}; an elevation cannot be chosen"
            )
        return Spectrum(str(source), wavelengths, radiance)
    if elevation_deg is None or not 0 <= elevation_deg <= 90:
        raise InputError(
            f"spectrum {path}: elevation_deg = {elevation_deg} must lie in 0..90, to choose one of "
            f"its {len(keys)} lines of sight"
        )
    values = [np.interp(elevation_deg, keys, column) for column in radiance.T]
    return Spectrum(f"{source} {elevation_deg:g} deg", wavelengths, np.array(values))


def has_elevations(source: str | Path) -> bool:
    """Whether `source` has a spectrum for each elevation; `spectrum` then needs `elevation_deg`."""
    return _read(source)[1] is not None


def _read(source):
    """Path, elevations [degrees] (or None), wavelengths [um] and radiances of `source`."""
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

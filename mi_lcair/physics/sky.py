"""Skies by elevation: clear skies by the band model, cloudy skies and a user's from tables."""

import os
import warnings
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from mi_lcair.errors import InputError, unknown
from mi_lcair.physics.air import tape7
from mi_lcair.physics.air.clear_air import clear_air
from mi_lcair.physics.air.levels import HEIGHT_M, Weather, model_names
from mi_lcair.physics.bands import BUNDLED, Spectrum
from mi_lcair.physics.blackbody import C1, C2, spectral_radiance
from mi_lcair.physics.spectral_table import SpectralTable, spectral_table
from mi_lcair.table import LARGEST, rows_at

RADIANCE, ELEVATION, AZIMUTH = "radiance_W_m2_sr_um", "elevation_deg", "azimuth_deg"
CLEAR = "_clear"  # end of the names of clear skies
ABOVE_AIR = 1.002  # radiance of a blackbody at the air's temperature that no sky reaches, relative
MEAN_ROWS = 5  # elevations of a mean over the sky
LEAST = 1e-12  # emissivity of a sky that stands for 0 in logarithms
# Beyond this wavelength, where it scatters little sunlight, no sky is brighter than a blackbody of
# this temperature
THERMAL_UM, WARMEST_K = 3.0, 400.0


@dataclass(frozen=True, eq=False)
class SkyTable:
    """Radiance of a sky at some elevations.

    The sky is seen as air of one temperature whose optical depth is a power of the air mass between
    neighbouring rows: ln(-ln(1 - L/B)) is linear in ln(air mass), with the radiance B of a
    blackbody at the highest brightness temperature of the table. Outside the rows the nearest one
    is used.

    Attributes
    ----------
    name
        Name or path of the table.
    elevations_deg
        Rising elevations [degrees], (e,).
    wavelengths_um
        Rising wavelengths [um], (k,).
    radiance
        Radiance [W m^-2 sr^-1 um^-1], (e, k).
    """

    name: str
    elevations_deg: np.ndarray
    wavelengths_um: np.ndarray
    radiance: np.ndarray

    def at(self, elevation_deg: float) -> Spectrum:
        """The spectrum at an elevation [degrees]."""
        name = f"{self.name} {elevation_deg:g} deg"
        if elevation_deg in self.elevations_deg or len(self.elevations_deg) == 1:
            row = np.argmin(abs(self.elevations_deg - elevation_deg))
            return Spectrum(name, self.wavelengths_um, self.radiance[row])
        x, limit = self.wavelengths_um, self.radiance
        warmest = (C2 / x / np.log1p(C1 / x**5 / np.maximum(limit, 1e-300))).max()
        black = ABOVE_AIR * spectral_radiance(x, warmest)
        share = np.maximum(self.radiance / black, LEAST)
        depths = np.log(-np.log1p(-share))
        places = -np.log(air_mass(self.elevations_deg))
        depth = rows_at(-np.log(air_mass(elevation_deg)), places, depths)
        return Spectrum(name, x, -np.expm1(-np.exp(depth)) * black)


def mean_nodes() -> tuple[np.ndarray, np.ndarray]:
    """Elevations [degrees] and weights of the mean of a sky over its cosine to the zenith.

    They are Gauss nodes in the sine of the elevation. The mean of a clear sky is met to 3e-4 in
    MWIR and LWIR.
    """
    nodes, weights = np.polynomial.legendre.leggauss(MEAN_ROWS)
    nodes = (nodes + 1) / 2
    return np.degrees(np.arcsin(nodes)), weights * nodes


def air_mass(elevation_deg):
    """Relative air mass at an apparent elevation [degrees] (Kasten and Young 1989)."""
    return 1 / (np.sin(np.radians(elevation_deg)) + 0.50572 * (elevation_deg + 6.07995) ** -1.6364)


def sky_names() -> list[str]:
    """Names of the bundled skies.

    Clear skies come from LOWTRAN7's band model, cloudy ones from tables that LOWTRAN7 computed for
    50 m above the ground. The tables' headers say how.
    """
    cloudy = (file.stem.removeprefix("sky_") for file in BUNDLED.glob("sky_*.csv"))
    return sorted([*cloudy, *(f"{name}{CLEAR}" for name in model_names())])


def clear_name(source: str | Path) -> str | None:
    """Name of the model atmosphere of a bundled clear sky; None for any other sky."""
    name = str(source).removesuffix(CLEAR)
    return name if str(source) == f"{name}{CLEAR}" and name in model_names() else None


def spectrum(
    source: str | Path,
    elevation_deg: float | None = None,
    height_m: float = HEIGHT_M,
    weather: Weather = Weather(),
) -> Spectrum:
    """Read a spectrum by its name or from a file.

    Parameters
    ----------
    source
        A CSV file with the columns wavelength_um and radiance_W_m2_sr_um, a MODTRAN tape7 of one
        line of sight (its TOTAL_RAD), or one of `sky_names()`. A table with a column elevation_deg
        holds one spectrum for each elevation of the line of sight.
    elevation_deg
        Elevation of the line of sight [degrees], for a sky or a table with elevations. Between the
        elevations of a table the spectrum is interpolated, see `SkyTable`.
    height_m, weather
        Height of the viewer above the ground [m] and weather, for a clear sky; others do not know
        them.

    Returns
    -------
    Spectrum
        Spectral radiance over wavelength; an `AirLight` for a clear sky.

    Raises
    ------
    InputError
        If the name is unknown, the file holds no spectrum, or the elevation is missing, superfluous
        or outside 0..90 degrees.
    """
    name = clear_name(source)
    if name is None:
        path, table = _read(source)
        if AZIMUTH in table.keys:
            raise InputError(
                f"spectrum {path}: has {AZIMUTH}; it serves as the sky of surroundings, not as the "
                "spectrum of a source"
            )
        if not table.keys:
            if elevation_deg is not None:
                raise InputError(
                    f"spectrum {path}: has no column {ELEVATION}; an elevation cannot be chosen"
                )
            return Spectrum(str(source), table.wavelengths_um, table.columns[0])
        what = f"one of its {len(table.columns[0])} lines of sight"
    else:
        path, what = source, "a line of sight"
    if elevation_deg is None or not 0 <= elevation_deg <= 90:
        raise InputError(
            f"spectrum {path}: elevation_deg = {elevation_deg} must lie in 0..90, to choose {what}"
        )
    if name is None:
        rows = table.keys[ELEVATION], table.wavelengths_um, table.columns[0]
        return SkyTable(str(source), *rows).at(elevation_deg)
    sky = clear_air(name, weather).sky(height_m, elevation_deg)
    return replace(sky, name=f"{source} {elevation_deg:g} deg")


def has_elevations(source: str | Path) -> bool:
    """Whether `source` has a spectrum for each elevation; `spectrum` then needs `elevation_deg`."""
    return clear_name(source) is not None or ELEVATION in _read(source)[1].keys


def has_azimuths(source: str | Path) -> bool:
    """Whether `source` is a file with spectra for each elevation and azimuth from the sun."""
    return os.path.isfile(source) and AZIMUTH in _read(source)[1].keys


def tables_by_azimuth(source: str | Path) -> tuple[np.ndarray, list[SkyTable]]:
    """Azimuths from the sun [degrees], and the sky at each, of a file with azimuths.

    Raises InputError if the elevations are not the same at all azimuths.
    """
    _, table = _read(source)
    if ELEVATION not in table.keys or len(np.unique(table.keys[AZIMUTH])) < 2:
        raise InputError(f"spectrum {source}: needs {ELEVATION} and two {AZIMUTH} or more")
    (azimuths, elevations), (radiance,) = table.grid(f"spectrum {source}")
    x = table.wavelengths_um
    return azimuths, [SkyTable(str(source), elevations, x, part) for part in radiance]


def check_brightness(source: str | Path) -> None:
    """Warn of a sky that is too bright, as one in another unit than W m^-2 sr^-1 um^-1."""
    path, table = _read(source)
    thermal = table.wavelengths_um >= THERMAL_UM
    x, radiance = table.wavelengths_um[thermal], table.columns[0][..., thermal]
    black = np.trapezoid(spectral_radiance(x, WARMEST_K), x)
    ratio = np.max(np.trapezoid(radiance, x)) / black if black else 0.0
    if ratio > 1:
        warnings.warn(
            f"sky {path}: is {ratio:.2g} times as bright as a blackbody of {WARMEST_K:g} K beyond "
            f"{THERMAL_UM:g} um; {RADIANCE} must be in W m^-2 sr^-1 um^-1",
            stacklevel=3,
        )


def _read(source):
    """Path and spectra of `source`."""
    path = Path(source)
    if str(source) in sky_names():
        path = BUNDLED / f"sky_{source}.csv"
    elif not path.suffix and not os.path.exists(path):
        raise unknown("sky table", str(source), sky_names())
    if tape7.is_tape7(path):
        blocks = tape7.blocks(path)
        if len({block.range_m for block in blocks}) > 1:
            raise InputError(
                f"spectrum {path}: has lines of sight of different ranges; keep the blocks of one"
            )
        block = tape7.joined(path, blocks)
        return path, SpectralTable({}, block.wavelengths_um, (block.total_radiance,))
    keys = AZIMUTH, ELEVATION
    return path, spectral_table(path, "spectrum", ((RADIANCE, LARGEST),), keys, keyless=True)

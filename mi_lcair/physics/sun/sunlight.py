"""Sunlight: spectral irradiance of the sun outside the air, through the bundled air, or measured.

The irradiance is that of the direct sun on a plane perpendicular to it.
"""

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline

from mi_lcair.errors import InputError, unknown
from mi_lcair.physics.bands import Band
from mi_lcair.physics.spectral_table import spectral_table
from mi_lcair.physics.spectrum import BUNDLED
from mi_lcair.table import LARGEST

NO_AIR = "none"
IRRADIANCE, TRANSMITTANCE = "irradiance_W_m2_um", "transmittance"
SOLAR_ELEVATION = "solar_elevation_deg"
# Rows between those of ASTM E490, whose own rows are up to 1 um apart at 10 um. On straight lines
# between rows in these steps, a curve that is straight in logarithms has an error below 1e-5.
STEP = 0.002
LONGEST_UM = 30.0  # the last row outside the air; beyond it the steps would become gaps
SMALLEST_TRANSMITTANCE = 1e-13  # stands for a transmittance below 1e-12, which is printed as 0


@dataclass(frozen=True, eq=False)
class Sunlight:
    """Spectral irradiance of the direct sun on a perpendicular plane, linear between the rows.

    wavelengths_um: rising wavelengths [um], (n,). irradiance: [W m^-2 um^-1], (n,).
    """

    name: str
    wavelengths_um: np.ndarray
    irradiance: np.ndarray

    def in_band_irradiance(self, band: Band) -> float:
        """In-band irradiance [W m^-2], weighted by the band's response.

        Raises InputError if the table does not cover the band, or for the band `total`.
        """
        if band.is_total:
            raise InputError(
                f"sunlight '{self.name}': does not cover band total, and materials are those of a "
                "band; choose a band with limits, such as MWIR"
            )
        band.check_covered(self.wavelengths_um, f"sunlight '{self.name}'")
        return float(band.integral(self.wavelengths_um, self.irradiance))


def air_names() -> list[str]:
    """Names of the bundled airs through which the sun is known, and "none" for no air."""
    names = (file.stem for file in BUNDLED.glob("sun_*_clear.csv"))
    return [*sorted(name.removeprefix("sun_").removesuffix("_clear") for name in names), NO_AIR]


def sunlight(air=NO_AIR, elevation_deg=None, distance_au: float | None = None) -> Sunlight:
    """The sunlight through an air.

    Parameters
    ----------
    air : str or Path
        "none": outside the air, ASTM E490-00a, interpolated in logarithms. "midlat_summer" or
        "us_standard": at 0.05 km altitude under a clear sky, with LOWTRAN7's own sun. Or the path
        of a CSV file wavelength_um,irradiance_W_m2_um with the irradiance at the scene.
    elevation_deg : float or None
        Elevation of the sun above the horizon [degrees]; only a bundled air needs it.
    distance_au : float or None
        Distance of the sun [astronomical units]; None for 1.

    Returns
    -------
    Sunlight

    Raises
    ------
    InputError
        If the name is unknown, the file holds no irradiance, a distance is given for a file, or the
        sun is lower than in the table of the air.
    """
    path = Path(air)
    if str(air) == NO_AIR:
        x, irradiance = outside_air()
    elif str(air) in air_names():
        x, irradiance = through_air(str(air), elevation_deg)
    elif not path.suffix and not os.path.exists(path):
        raise unknown("air", str(air), [*air_names(), "a CSV file"])
    else:
        table = spectral_table(path, "sunlight", ((IRRADIANCE, LARGEST),))
        if distance_au is not None:
            raise InputError(
                f"sunlight {path}: distance_au = {distance_au:g}, but a file holds the irradiance "
                "at the scene; leave the distance out"
            )
        return Sunlight(str(air), table.wavelengths_um, table.columns[0])
    name = f"{air} {elevation_deg:g} deg" if str(air) != NO_AIR else "E490"
    return Sunlight(name, x, irradiance / (distance_au or 1) ** 2)


def outside_air() -> tuple[np.ndarray, np.ndarray]:
    """Wavelengths [um] and irradiance [W m^-2 um^-1] of ASTM E490-00a in steps of STEP or less."""
    file = BUNDLED / "solar_e490.csv"
    table = spectral_table(file, "sunlight", ((IRRADIANCE, LARGEST),))
    x, irradiance = table.wavelengths_um, table.columns[0]
    between = np.exp(np.arange(np.log(x[0]), np.log(LONGEST_UM), STEP))
    fine = np.union1d(between, x[x <= LONGEST_UM])
    return fine, np.exp(np.interp(np.log(fine), np.log(x), np.log(irradiance)))


def through_air(air: str, elevation_deg: float) -> tuple[np.ndarray, np.ndarray]:
    """Wavelengths [um] and irradiance [W m^-2 um^-1] through a bundled air.

    The logarithm of the optical depth at each wavelength is interpolated over that of the air mass,
    by a cubic spline. With one elevation left out of the table, the irradiance at that elevation in
    3-5 um and 8-12 um is found to 0.02 % from 30 to 75 degrees, to 0.12 % at 20 degrees and to
    0.6 % at 10 degrees. Raises InputError for an elevation below the first one of the table.
    """
    elevations, x, transmittance, irradiance = air_table(air)
    if elevation_deg is None or not elevations[0] <= elevation_deg <= 90:
        raise InputError(
            f"sunlight '{air}': solar elevation {elevation_deg} degrees must lie in "
            f"{elevations[0]:g}..90"
        )
    # The row of the highest sun has the largest transmittance
    sun = np.divide(
        irradiance[-1], transmittance[-1], out=np.zeros(len(x)), where=transmittance[-1] > 0
    )
    return x, sun * transmitted(elevations, transmittance, elevation_deg)


def air_table(air: str) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Elevations [degrees], wavelengths [um], transmittance and irradiance (elevations, n)."""
    columns = (TRANSMITTANCE, 1.0), (IRRADIANCE, LARGEST)
    file = BUNDLED / f"sun_{air}_clear.csv"
    table = spectral_table(file, "sunlight", columns, key=SOLAR_ELEVATION)
    return table.keys, table.wavelengths_um, *table.columns


def transmitted(elevations, transmittance, elevation_deg: float) -> np.ndarray:
    """Transmittance at an elevation [degrees], (n,).

    elevations: of the rows, rising [degrees], (k,). transmittance: (k, n).
    """
    depths = np.log(-np.log(np.clip(transmittance, SMALLEST_TRANSMITTANCE, 1 - 1e-12)))
    # A spline needs rising positions, and the air mass falls with the elevation
    spline = CubicSpline(np.log(air_mass(elevations))[::-1], depths[::-1])
    return np.exp(-np.exp(spline(np.log(air_mass(elevation_deg)))))


def air_mass(elevation_deg):
    """Relative air mass at an apparent elevation [degrees] (Kasten and Young 1989)."""
    return 1 / (np.sin(np.radians(elevation_deg)) + 0.50572 * (elevation_deg + 6.07995) ** -1.6364)

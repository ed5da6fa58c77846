"""Sunlight: spectral irradiance of the sun outside the air, through clear air, or measured.

The irradiance is that of the direct sun on a plane perpendicular to it.
"""

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mi_lcair.errors import InputError, unknown
from mi_lcair.physics.air.clear_air import clear_air
from mi_lcair.physics.air.levels import Weather, model_names
from mi_lcair.physics.air.light import AirLight
from mi_lcair.physics.bands import Band
from mi_lcair.physics.spectral_table import spectral_table
from mi_lcair.physics.spectrum import BUNDLED, Spectrum
from mi_lcair.table import LARGEST

NO_AIR = "none"
OUTSIDE_AIR = "E490"  # name of the spectrum outside the air
IRRADIANCE = "irradiance_W_m2_um"
# Rows between those of ASTM E490, whose own rows are up to 1 um apart at 10 um. On straight lines
# between rows in these steps, a curve that is straight in logarithms has an error below 1e-5.
STEP = 0.002
LONGEST_UM = 30.0  # the last row outside the air; beyond it the steps would become gaps
HEIGHT_M = 50.0  # height above the ground of a scene that states none


@dataclass(frozen=True, eq=False)
class Sunlight:
    """Spectral irradiance of the direct sun on a perpendicular plane, linear between the rows.

    wavelengths_um: rising wavelengths [um], (n,). irradiance: [W m^-2 um^-1], (n,). through_air:
    the irradiance as light that has crossed air; None outside the air and for a file.
    """

    name: str
    wavelengths_um: np.ndarray
    irradiance: np.ndarray
    through_air: AirLight | None = None

    def over(self, solid_angle: float) -> Spectrum:
        """Spectral radiance of an even disc of a projected solid angle [sr] with the irradiance."""
        if self.through_air is not None:
            return self.through_air.scaled(1 / solid_angle)
        return Spectrum(self.name, self.wavelengths_um, self.irradiance / solid_angle)

    def in_band_irradiance(self, band: Band) -> float:
        """In-band irradiance [W m^-2], weighted by the band's response.

        Raises InputError if the table does not cover the band, or for the band `total`.
        """
        band.check_covered(self.wavelengths_um, f"sunlight '{self.name}'")
        return float(band.integral(self.wavelengths_um, self.irradiance))


def air_names() -> list[str]:
    """Names of the clear airs through which the sun shines, and "none" for no air."""
    return [*model_names(), NO_AIR]


def sunlight(
    air=NO_AIR,
    elevation_deg=None,
    distance_au: float | None = None,
    height_m: float = HEIGHT_M,
    weather: Weather = Weather(),
) -> Sunlight:
    """The sunlight through an air.

    Parameters
    ----------
    air : str or Path
        "none": outside the air, ASTM E490-00a, interpolated in logarithms. "midlat_summer" or
        "us_standard": through that clear air, with LOWTRAN7's own sun. Or the path of a CSV file
        wavelength_um,irradiance_W_m2_um with the irradiance at the scene.
    elevation_deg : float or None
        Apparent elevation of the sun above the horizon, 1..90 [degrees]; only a clear air needs it.
    distance_au : float or None
        Distance of the sun [astronomical units]; None for 1.
    height_m : float
        Height of the scene above the ground [m], for a clear air.
    weather : Weather
        Weather of a clear air.

    Returns
    -------
    Sunlight

    Raises
    ------
    InputError
        If the name is unknown, the file holds no irradiance, a distance is given for a file, or the
        height or the elevation is out of bounds.
    """
    path = Path(air)
    if str(air) == NO_AIR:
        x, irradiance = outside_air()
    elif str(air) in air_names():
        light = clear_air(str(air), weather).sun(height_m, elevation_deg, distance_au or 1.0)
        return Sunlight(light.name, light.wavelengths_um, light.radiance, light)
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
    return Sunlight(OUTSIDE_AIR, x, irradiance / (distance_au or 1) ** 2)


def outside_air() -> tuple[np.ndarray, np.ndarray]:
    """Wavelengths [um] and irradiance [W m^-2 um^-1] of ASTM E490-00a in steps of STEP or less."""
    file = BUNDLED / "solar_e490.csv"
    table = spectral_table(file, "sunlight", ((IRRADIANCE, LARGEST),))
    x, irradiance = table.wavelengths_um, table.columns[0]
    between = np.exp(np.arange(np.log(x[0]), np.log(LONGEST_UM), STEP))
    fine = np.union1d(between, x[x <= LONGEST_UM])
    return fine, np.exp(np.interp(np.log(fine), np.log(x), np.log(irradiance)))

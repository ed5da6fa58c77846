"""Sunlight: spectral irradiance of the sun outside the air, through clear air, or measured.

The irradiance is that of the direct sun on a plane perpendicular to it. It is also the radiance of
an even disc whose projected solid angle is 1 sr.
"""

import os
from pathlib import Path

import numpy as np

from mi_lcair.errors import InputError, unknown
from mi_lcair.physics.air.clear_air import clear_air
from mi_lcair.physics.air.levels import HEIGHT_M, Weather, model_names
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


def air_names() -> list[str]:
    """Names of the clear airs through which the sun shines, and "none" for no air."""
    return [*model_names(), NO_AIR]


def sunlight(
    air=NO_AIR,
    elevation_deg=None,
    distance_au: float | None = None,
    height_m: float = HEIGHT_M,
    weather: Weather = Weather(),
) -> Spectrum:
    """The sunlight through an air, as the radiance of a disc of 1 sr.

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
    Spectrum
        An `AirLight` through a clear air.

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
        return clear_air(str(air), weather).sun(height_m, elevation_deg, distance_au or 1.0)
    elif not path.suffix and not os.path.exists(path):
        raise unknown("air", str(air), [*air_names(), "a CSV file"])
    else:
        table = spectral_table(path, "sunlight", ((IRRADIANCE, LARGEST),))
        if distance_au is not None:
            raise InputError(
                f"sunlight {path}: distance_au = {distance_au:g}, but a file holds the irradiance "
                "at the scene; leave the distance out"
            )
        return Spectrum(str(air), table.wavelengths_um, table.columns[0])
    return Spectrum(OUTSIDE_AIR, x, irradiance / (distance_au or 1) ** 2)


def outside_air() -> tuple[np.ndarray, np.ndarray]:
    """Wavelengths [um] and irradiance [W m^-2 um^-1] of ASTM E490-00a in steps of STEP or less."""
    file = BUNDLED / "solar_e490.csv"
    table = spectral_table(file, "sunlight", ((IRRADIANCE, LARGEST),))
    x, irradiance = table.wavelengths_um, table.columns[0]
    between = np.exp(np.arange(np.log(x[0]), np.log(LONGEST_UM), STEP))
    fine = np.union1d(between, x[x <= LONGEST_UM])
    return fine, np.exp(np.interp(np.log(fine), np.log(x), np.log(irradiance)))

"""Electrons of a pixel for a spectral radiance at the aperture.

The camera counts photons, and a photon carries the energy h c / wavelength. Its response to a
radiance in watts is therefore proportional to the wavelength.
"""

from dataclasses import replace

import numpy as np

from mi_lcair.physics.bands import Band
from mi_lcair.physics.blackbody import (
    LIGHT_SPEED,
    PLANCK,
    brightness_temperature,
    in_band_radiance,
    in_band_slope,
)
from mi_lcair.physics.imager import Imager

# Points between two rows of a response. The product of two straight lines is a parabola, which the
# points replace by straight lines.
BETWEEN = 8


def electron_band(band: Band, imager: Imager, optics_transmittance: float = 1.0) -> Band:
    """The band in which the in-band value of a spectral radiance is a number of electrons.

    The electrons of a pixel are the integral of L(x) x / (h c) QE(x) over the wavelength x, times
    the optics' transmittance, the solid angle of the pupil, the pixel's area and the time. The
    response of `band` multiplies the camera's quantum efficiency.

    Parameters
    ----------
    band : Band
        Band of the detector with its response, not `total`.
    imager : Imager
    optics_transmittance : float
        Transmittance of the optics.

    Returns
    -------
    Band
        `in_band_radiance` of it gives the electrons of a blackbody that fills the pixel.
    """
    energy = PLANCK * LIGHT_SPEED * 1e6  # J um
    per_um = (
        optics_transmittance
        * imager.quantum_efficiency
        * imager.solid_angle
        * imager.pixel_area
        * imager.seconds
        / energy
    )
    rows = np.array([band.lower_um, band.upper_um])
    if band.response is not None:
        x = band.response[0]
        rows = np.interp(np.arange(BETWEEN * (len(x) - 1) + 1) / BETWEEN, np.arange(len(x)), x)
    return replace(
        band,
        weights_um=band.weights_um * per_um * band.wavelengths_um,
        response=np.array([rows, per_um * rows * band.response_at(rows)]),
    )


def electrons(electron_band: Band, temperature):
    """Electrons of a pixel that a blackbody of this temperature, K, fills."""
    return in_band_radiance(electron_band, temperature)


def electrons_per_kelvin(electron_band: Band, temperature: float) -> float:
    """Change of the electrons with the temperature of a blackbody, at `temperature`, K."""
    return float(in_band_slope(electron_band, temperature))


def in_kelvin(electron_band: Band, electrons, deviation) -> np.ndarray:
    """Change of the apparent temperature, K, that a deviation of the electrons makes.

    The deviation is added. It stays finite where a pixel has no electrons.
    """
    return apparent_temperature(electron_band, electrons + deviation) - apparent_temperature(
        electron_band, electrons
    )


def apparent_temperature(electron_band: Band, electrons) -> np.ndarray:
    """Temperature, K, of the blackbody that gives these electrons; 0 where they are not positive.

    It is the inverse of `electrons`.
    """
    return brightness_temperature(electron_band, np.maximum(electrons, 0))

"""In-band radiance of a blackbody in Float64, apart from the one that is tested.

The integral of Planck's law from 0 to a wavelength is the series of M. A. Bramson and of W. K.
Widger and M. P. Woodall (Integration of the Planck blackbody radiation function, Bull. Amer.
Meteor. Soc. 57, 1217, 1976).
"""

import numpy as np
from scipy.constants import c, h, k, sigma

C2_UM = h * c / k * 1e6  # second radiation constant, um K
BANDS_UM = {"SWIR": (1.0, 3.0), "MWIR": (3.0, 5.0), "LWIR": (8.0, 12.0), "total": (0.0, np.inf)}
TERMS = np.arange(1, 400)
NODES, WEIGHTS = np.polynomial.legendre.leggauss(200)


def fraction_below(wavelength_um: float, temperature: float) -> float:
    """Fraction of a blackbody's radiance at wavelengths below `wavelength_um`."""
    if wavelength_um == 0 or np.isinf(wavelength_um):
        return float(wavelength_um > 0)
    x, n = C2_UM / (wavelength_um * temperature), TERMS
    terms = np.exp(-n * x) * (x**3 / n + 3 * x**2 / n**2 + 6 * x / n**3 + 6 / n**4)
    return float(15 / np.pi**4 * terms.sum())


def in_band_radiance(band: str, temperature: float) -> float:
    """Radiance of a blackbody in a band of BANDS_UM [W m^-2 sr^-1]."""
    return radiance_within(*BANDS_UM[band], temperature)


def radiance_within(lower: float, upper: float, temperature: float) -> float:
    """Radiance of a blackbody between two wavelengths [um] [W m^-2 sr^-1]."""
    share = fraction_below(upper, temperature) - fraction_below(lower, temperature)
    return sigma * temperature**4 / np.pi * share


def by_quadrature(band: str, temperature: float, photons: bool = False) -> float:
    """The same by Gauss's quadrature of Planck's law; in photons m^-2 sr^-1 s^-1 on request."""
    lower, upper = BANDS_UM[band]
    wavelength = (lower + upper + (upper - lower) * NODES) / 2 * 1e-6
    spectral = 2 * h * c**2 / wavelength**5
    with np.errstate(over="ignore"):
        spectral /= np.expm1(h * c / (wavelength * k * temperature))
    if photons:
        spectral *= wavelength / (h * c)
    return float((WEIGHTS * spectral).sum() * (upper - lower) / 2 * 1e-6)


def photons_of_even_light(band: str) -> float:
    """Photons per joule of light whose spectrum is constant over a band."""
    return sum(BANDS_UM[band]) / 2 * 1e-6 / (h * c)

"""Spectra of sources other than blackbodies."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from mi_lcair.physics.bands import Band

BUNDLED = Path(__file__).with_name("lowtran7")


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

    def scaled(self, factor: float) -> "Spectrum":
        """The spectrum times a factor."""
        return replace(self, radiance=self.radiance * factor)

    def in_band_radiance(self, band: Band) -> float:
        """In-band radiance [W m^-2 sr^-1], weighted by the band's response.

        Raises InputError if the table does not cover the band.
        """
        band.check_covered(self.wavelengths_um, f"spectrum '{self.name}'")
        return float(band.integral(self.wavelengths_um, self.radiance))

"""A detector with a single pixel, which integrates its whole field of view (thesis 3.8)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from mi_lcair.declared import Table, entry
from mi_lcair.errors import InputError
from mi_lcair.physics.bands import Band
from mi_lcair.physics.bands import band as band_of

LOCK_ON = 10.0  # signal-to-noise ratio that a lock-on requires (thesis 3.8)


@dataclass(frozen=True)
class Detector(Table, where="sensor"):
    """Spectral band, optics and noise of a detector.

    The signal is the contrast irradiance at the aperture times optics_transmittance. It is detected
    if its absolute value is at least snr * nei. Irradiances are weighted by the band's response.

    Attributes
    ----------
    band
        Band with the detector's response, in any form that `mi_lcair.physics.bands.band` reads.
    optics_transmittance
        Transmittance of the optics, in (0, 1].
    field_of_view_deg
        Full angle of the conical field of view, in (0, 180] [degrees]; None if it is not limited.
    nei
        Noise-equivalent irradiance behind the optics [W m^-2]. A value stated at the aperture, as
        in the thesis, includes the optics; optics_transmittance is then left at 1.
    snr
        Required signal-to-noise ratio.

    Raises
    ------
    InputError
        If a value is out of its range.
    """

    band: Band
    optics_transmittance: float = entry(1.0, is_positive=True, upper=1)
    field_of_view_deg: float | None = entry(None, is_positive=True, upper=180)
    nei: float | None = entry(None, is_positive=True, unit="W m^-2")
    snr: float = entry(LOCK_ON, is_positive=True)

    def complete(self) -> None:
        self.derive(band=band_of(self.band))

    @property
    def solid_angle(self) -> float | None:
        """Solid angle of the field of view [sr]; None if field_of_view_deg is None."""
        if self.field_of_view_deg is None:
            return None
        return 4 * np.pi * np.sin(np.radians(self.field_of_view_deg) / 4) ** 2

    def signal(self, irradiance: ArrayLike) -> np.ndarray | float:
        """Signal behind the optics [W m^-2] for a contrast irradiance at the aperture [W m^-2].

        The contrast may be positive or negative.
        """
        return self.optics_transmittance * np.asarray(irradiance)[()]

    def detects(self, irradiance: ArrayLike) -> np.ndarray | bool:
        """Whether a contrast irradiance at the aperture [W m^-2] is detected.

        Raises InputError if nei is None.
        """
        if self.nei is None:
            raise InputError(
                "sensor: nei is missing; give the noise-equivalent irradiance in W m^-2"
            )
        return np.abs(self.signal(irradiance)) >= self.snr * self.nei

    def nei_max(self, irradiance: ArrayLike) -> np.ndarray | float:
        """Largest nei [W m^-2] at which a contrast irradiance is detected (thesis Eq 3.14).

        irradiance: contrast irradiance at the aperture [W m^-2].
        """
        return np.abs(self.signal(irradiance)) / self.snr

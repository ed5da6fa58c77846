"""A detector of one pixel: the whole of its field of view is one signal (thesis 3.8)."""

from dataclasses import dataclass

import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.physics.bands import Band
from mi_lcair.physics.bands import band as band_of

LOCK_ON = 10.0  # signal over noise that a lock-on asks for (thesis 3.8)


@dataclass(frozen=True)
class Detector:
    """Band with its response, optics and noise; irradiances in W m^-2, weighted by the response.

    band: as bands.band takes it. optics_transmittance: in (0, 1]. field_of_view_deg: the full angle
    of a cone, in (0, 180]. nei: noise-equivalent irradiance, behind the optics; one that is stated
    at the aperture, as in the thesis, holds the optics in it: leave optics_transmittance 1. snr:
    the signal over noise that is asked for. The signal is the contrast irradiance at the aperture
    times optics_transmittance, and detected where its size reaches snr * nei.
    """

    band: Band
    optics_transmittance: float = 1.0
    field_of_view_deg: float | None = None
    nei: float | None = None
    snr: float = LOCK_ON

    def __post_init__(self):
        object.__setattr__(self, "band", band_of(self.band))
        for name, largest in (
            ("optics_transmittance", 1.0),
            ("field_of_view_deg", 180.0),
            ("nei", np.inf),
            ("snr", np.inf),
        ):
            value = getattr(self, name)
            if value is not None and not (0 < value <= largest and np.isfinite(value)):
                raise InputError(
                    f"sensor: {name} = {value}; must be positive and {'finite' if largest == np.inf else f'at most {largest:g}'}"
                )

    @property
    def solid_angle(self) -> float | None:
        """Of the field of view, sr; None without one."""
        return (
            None
            if self.field_of_view_deg is None
            else 4 * np.pi * np.sin(np.radians(self.field_of_view_deg) / 4) ** 2
        )

    def signal(self, irradiance):
        """What a contrast irradiance at the aperture, positive or negative, leaves behind the
        optics [W m^-2].
        """
        return self.optics_transmittance * np.asarray(irradiance)[()]

    def detects(self, irradiance):
        """Whether a contrast irradiance at the aperture [W m^-2] is detected. Raises InputError
        without a nei.
        """
        if self.nei is None:
            raise InputError(
                "sensor: nei is missing; give the noise-equivalent irradiance in W m^-2"
            )
        return np.abs(self.signal(irradiance)) >= self.snr * self.nei

    def nei_max(self, irradiance):
        """The largest nei with which a contrast irradiance at the aperture [W m^-2] is detected (Eq
        3.14) [W m^-2].
        """
        return np.abs(self.signal(irradiance)) / self.snr

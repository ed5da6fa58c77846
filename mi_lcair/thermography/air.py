"""The air between an object and a thermographic camera."""

from dataclasses import dataclass, replace

import numpy as np

from mi_lcair.physics.air.clear_air import clear_air
from mi_lcair.physics.air.clear_paths import ClearPaths
from mi_lcair.physics.air.levels import HEIGHT_M, Weather
from mi_lcair.physics.bands import Band
from mi_lcair.physics.blackbody import brightness_temperature, in_band_radiance

ATMOSPHERE = "us_standard"  # model atmosphere whose weather a measurement may change
REFINEMENTS = 2  # corrections of the quadrature over an air's wavelengths when it is inverted


@dataclass(frozen=True, eq=False)
class Air:
    """Air between an object and a camera.

    Attributes
    ----------
    band : Band
        Band of the camera.
    nodes : Band
        A quadrature of the band over the wavelengths at which the transmittance is known.
    through : Band
        The same, with its weights times the transmittance.
    path : float
        In-band path radiance [W m^-2 sr^-1].
    """

    band: Band
    nodes: Band
    through: Band
    path: float

    @staticmethod
    def given(band: Band, transmittance: float, temperature: float) -> "Air":
        """Grey air of one transmittance and temperature [K]."""
        through = replace(band, weights_um=transmittance * band.weights_um)
        path = (1 - transmittance) * float(in_band_radiance(band, temperature))
        return Air(band, band, through, path)

    @staticmethod
    def computed(band: Band, distance: float, weather: Weather) -> "Air":
        """Clear air in some weather along a horizontal path of a length [m].

        Raises InputError for a band that it does not cover.
        """
        clear = clear_air(ATMOSPHERE, weather)
        air = ClearPaths(ATMOSPHERE, clear, HEIGHT_M, 0.0, True, stated_m=distance)
        air.check_covers(band)
        line = air.path(distance)
        weights = band.row_weights(line.wavelengths_um)
        rows = np.flatnonzero(weights)
        nodes = replace(band, wavelengths_um=line.wavelengths_um[rows], weights_um=weights[rows])
        through = replace(nodes, weights_um=nodes.weights_um * line.transmittance[rows])
        return Air(band, nodes, through, float(weights @ line.radiance))

    def transmitted(self, temperature) -> np.ndarray:
        """In-band radiance that arrives from a blackbody, without the path radiance."""
        return in_band_radiance(self.through, temperature) / self.excess(temperature)

    def source_temperature(self, arriving: np.ndarray) -> np.ndarray:
        """Temperature [K] of the blackbody of which this in-band radiance arrives; NaN if it is not
        positive.
        """
        arriving = np.where(arriving > 0, arriving, np.nan)
        temperature = brightness_temperature(self.through, arriving)
        for _ in range(REFINEMENTS if self.nodes is not self.band else 0):
            temperature = brightness_temperature(self.through, arriving * self.excess(temperature))
        return temperature

    def excess(self, temperature) -> np.ndarray:
        """Radiance of a blackbody by the quadrature over the air's wavelengths, divided by the
        radiance. It differs from 1 by the curvature of Planck's law between the wavelengths.
        """
        if self.nodes is self.band:
            return np.ones(np.shape(temperature))
        with np.errstate(invalid="ignore", divide="ignore"):
            return in_band_radiance(self.nodes, temperature) / in_band_radiance(
                self.band, temperature
            )

    def transmittance(self, temperature: float) -> float:
        """Mean transmittance in the band for the radiance of a blackbody of a temperature [K]."""
        return float(self.transmitted(temperature) / in_band_radiance(self.band, temperature))

"""Irradiances at a sensor from a target's effective areas, Eqs 3.13-3.19 of the thesis: spectra
through the air, integrated last.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from mi_lcair.physics.atmosphere import Atmosphere, LineOfSight
from mi_lcair.physics.bands import Band
from mi_lcair.signatures.effective_areas import EffectiveAreas

TERMS = ("intensity", "target", "path", "background", "total")


class Estimate(NamedTuple):
    """A value and its standard error, from the rendering alone."""

    value: float
    standard_error: float


class Backdrop(NamedTuple):
    """What the sensor sees where the target is not: spectral radiance [W m^-2 sr^-1 um^-1] by
    wavelength [um], and where it has corners (rows_um).
    """

    name: str
    at: Callable[[np.ndarray], np.ndarray]
    rows_um: np.ndarray


class Irradiance:
    """The irradiances of one target before one backdrop, at any range along one line of sight
    through one atmosphere.

    All are linear in the effective areas and the projected area, whose covariance gives their
    errors. Where blackbodies were too many to be told apart there is none: `relative_error`, of the
    target's intensity, and the error of the projected area then count as if they acted together,
    which bounds the error from above. The target is seen by parallel rays: its own size must be
    small against the range.
    """

    def __init__(
        self,
        areas: EffectiveAreas,
        relative_error: float,
        band: Band,
        air: Atmosphere,
        backdrop: Backdrop,
    ):
        rows = np.concatenate(
            [
                areas.wavelengths_um(),
                air.wavelengths_um,
                backdrop.rows_um,
                [] if band.response is None else band.response[0],
            ]
        )
        inside = rows[(rows > band.lower_um) & (rows < band.upper_um)]
        rows = np.unique(np.concatenate([[band.lower_um, band.upper_um], inside]))
        # two Gauss points between neighbours: exact for air, source and response on straight lines,
        # and to h^4 for Planck's law
        middle, half = (rows[:-1] + rows[1:]) / 2, np.diff(rows) / 2
        self.wavelengths_um = np.column_stack(
            [middle - half / np.sqrt(3), middle + half / np.sqrt(3)]
        ).ravel()
        self.weights_um = np.repeat(half, 2) * band.response_at(self.wavelengths_um)
        self.areas = areas
        self.backdrop = backdrop.at(self.wavelengths_um)
        self.projected_area = Estimate(
            areas.projected_area, float(np.sqrt(areas.covariance[0, -1, -1]))
        )
        if areas.nodes_um.size:
            self.spectra = areas.spectrum(self.wavelengths_um)[0].sum(axis=0, keepdims=True)
            self.amounts, self.covariance = np.array([1.0, areas.projected_area]), None
            self.errors = np.array([relative_error, self.projected_area.standard_error])
        else:
            self.spectra = areas.radiance(self.wavelengths_um)
            self.amounts, self.covariance = (
                np.append(areas.area[0], areas.projected_area),
                areas.covariance[0],
            )

    def in_band(self, spectrum) -> float:
        """W m^-2 sr^-1 of a spectrum at `wavelengths_um`, times the response."""
        return float(spectrum @ self.weights_um)

    def at(self, path: LineOfSight) -> dict[str, Estimate]:
        """TERMS by name: the target's intensity before the air [W/sr] and, at the end of the path
        [W m^-2], its apparent irradiance (3.16), the path's, the hidden background's, and the
        contrast (3.19), which may be negative.
        """
        transmittance, radiance = path.at(self.wavelengths_um)
        per_amount = np.zeros(
            (len(TERMS), len(self.amounts))
        )  # what each unit of the amounts adds to each term
        per_amount[0, :-1] = self.spectra @ self.weights_um
        per_amount[1, :-1] = self.spectra @ (transmittance * self.weights_um)
        per_amount[2, -1], per_amount[3, -1] = self.in_band(radiance), self.in_band(self.backdrop)
        per_amount[4] = per_amount[1] + per_amount[2] - per_amount[3]
        per_amount[1:] /= path.range_m**2
        if self.covariance is None:
            errors = np.abs(per_amount) @ self.errors
        else:
            errors = np.sqrt(
                np.maximum(np.einsum("ti,ij,tj->t", per_amount, self.covariance, per_amount), 0)
            )
        return {
            name: Estimate(float(value), float(error))
            for name, value, error in zip(TERMS, per_amount @ self.amounts, errors)
        }

    def spectral(self, path: LineOfSight) -> dict[str, np.ndarray]:
        """The TERMS by wavelength: [W sr^-1 um^-1], then [W m^-2 um^-1], without the response."""
        transmittance, radiance = path.at(self.wavelengths_um)
        solid_angle = self.projected_area.value / path.range_m**2
        intensity = self.amounts[:-1] @ self.spectra
        target, own, hidden = (
            transmittance * intensity / path.range_m**2,
            radiance * solid_angle,
            self.backdrop * solid_angle,
        )
        return dict(zip(TERMS, (intensity, target, own, hidden, target + own - hidden)))

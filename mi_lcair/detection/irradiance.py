"""Irradiances at a sensor from the effective areas of a target (thesis Eqs 3.13-3.19).

All spectra are taken through the air first, and integrated over the band last.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from mi_lcair.estimate import Estimate
from mi_lcair.physics.air.atmosphere import Atmosphere, LineOfSight
from mi_lcair.physics.bands import Band
from mi_lcair.physics.spectrum import Spectrum
from mi_lcair.rendering.statistics import student_factor
from mi_lcair.signatures.effective_areas import EffectiveAreas
from mi_lcair.signatures.view_areas import ViewAreas

TERMS = ("intensity", "target", "path", "background", "total")


class Backdrop(NamedTuple):
    """Background that the sensor sees beside the target.

    Attributes
    ----------
    name : str
        Name for reports.
    at : callable
        Spectral radiance, W m^-2 sr^-1 um^-1, at an array of wavelengths, um.
    rows_um : ndarray
        Wavelengths, um, between which the spectral radiance is linear or smooth.
    path_at : callable or None
        Path from the background to the sensor, at a range of the target, m. Without it the
        spectral radiance is that at the sensor.
    reflected : tuple of (float, Spectrum)
        Light in `at` that has crossed air before the background reflects it, with factors.
    """

    name: str
    at: Callable[[np.ndarray], np.ndarray]
    rows_um: np.ndarray
    path_at: Callable[[float], LineOfSight] | None = None
    reflected: tuple[tuple[float, Spectrum], ...] = ()

    def scaled(self, factor: float) -> "Backdrop":
        """The background with another radiance, before the same air."""
        reflected = tuple((factor * share, light) for share, light in self.reflected)
        return self._replace(at=lambda x: factor * self.at(x), reflected=reflected)

    def at_sensor(self, range_m: float) -> "Backdrop":
        """The background as it arrives at the sensor, for a target at a range, m."""
        if self.path_at is None:
            return self
        path = self.path_at(range_m)

        def arriving(wavelengths_um):
            transmittance, radiance = path.at(wavelengths_um)
            total = transmittance * self.at(wavelengths_um) + radiance
            for factor, light in self.reflected:
                share = path.share(light, wavelengths_um) - transmittance
                total = total + factor * light.at(wavelengths_um) * share
            return total

        rows, of_path = self.rows_um, path.wavelengths_um
        if of_path.size:  # a table of the background may have more
            rows = rows[(of_path[0] <= rows) & (rows <= of_path[-1])]
        return Backdrop(self.name, arriving, np.union1d(rows, of_path))


class RenderError(NamedTuple):
    """What is uncertain in a rendered target.

    Attributes
    ----------
    degrees_of_freedom : float
        Degrees of freedom of the standard errors.
    missed : float
        Intensity that a source which no path has hit may add to the target, W/sr.
    systematic : float
        Relative error of the intensity that more paths do not reduce.
    """

    degrees_of_freedom: float = np.inf
    missed: float = 0.0
    systematic: float = 0.0


class LineOfSources:
    """The TERMS of a target at any range along one line of sight, for each of its amounts.

    The amounts are the effective areas of the target's sources and, last, its projected area. All
    terms are linear in them, so that they hold for any target with the same sources. The target is
    rendered with parallel rays. Its size must be small compared with the range.

    Parameters
    ----------
    areas : EffectiveAreas or ViewAreas
        Effective areas, of which the sources count here.
    band : Band
        Band of the detector, with its response.
    air : Atmosphere
        Atmosphere, whose wavelengths are resolved.
    backdrop : Backdrop
        Background of the target.
    """

    def __init__(
        self, areas: EffectiveAreas | ViewAreas, band: Band, air: Atmosphere, backdrop: Backdrop
    ):
        rows = band.rows(areas.wavelengths_um(), air.wavelengths_um, backdrop.rows_um)
        # Gauss quadrature with two points between neighbouring wavelengths. It is exact for the
        # product of air, source and response where they are linear. Its error for Planck's law
        # falls with the fourth power of the step.
        middle, half = (rows[:-1] + rows[1:]) / 2, np.diff(rows) / 2
        self.wavelengths_um = np.column_stack(
            [middle - half / np.sqrt(3), middle + half / np.sqrt(3)]
        ).ravel()
        self.response = band.response_at(self.wavelengths_um)
        self.weights_um = np.repeat(half, 2) * self.response
        self.areas, self.behind = areas, backdrop
        self.spectra = areas.spectra_of_amounts(self.wavelengths_um)

    def in_band(self, spectrum: np.ndarray) -> float:
        """Integral over the band of a spectrum at `wavelengths_um`, weighted with the response."""
        return float(spectrum @ self.weights_um)

    def background(self, path: LineOfSight) -> np.ndarray:
        """Radiance of the background at the end of a path, at `wavelengths_um`."""
        return self.behind.at_sensor(path.range_m).at(self.wavelengths_um)

    def arriving(self, path: LineOfSight) -> np.ndarray:
        """Spectra of the amounts but the last one at the end of a path, (amounts - 1, n).

        Light that has crossed air before the target reflects it gets the amounts of both paths.
        """
        transmittance, _ = path.at(self.wavelengths_um)
        arriving = self.spectra * transmittance
        for row, source in enumerate(self.areas.sources):
            if source.spectrum is not None:
                share = path.share(source.spectrum, self.wavelengths_um) - transmittance
                arriving[row] += source.spectrum.at(self.wavelengths_um) * share
        return arriving

    def per_amount(self, path: LineOfSight) -> np.ndarray:
        """Derivative of each of the TERMS with respect to each of the amounts, (TERMS, amounts)."""
        _, radiance = path.at(self.wavelengths_um)
        per_amount = np.zeros((len(TERMS), len(self.spectra) + 1))
        per_amount[0, :-1] = self.spectra @ self.weights_um
        per_amount[1, :-1] = self.arriving(path) @ self.weights_um
        per_amount[2, -1] = self.in_band(radiance)
        per_amount[3, -1] = self.in_band(self.background(path))
        per_amount[4] = per_amount[1] + per_amount[2] - per_amount[3]
        per_amount[1:] /= path.range_m**2
        return per_amount

    def per_intensity(self, path: LineOfSight) -> float:
        """Largest irradiance at the end of a path from an intensity of 1 W/sr, W m^-2."""
        transmittance, _ = path.at(self.wavelengths_um)
        return float((transmittance * self.response).max() / path.range_m**2)


class Irradiance(LineOfSources):
    """Irradiances of a target before a background, at any range along one line of sight.

    The covariance of the amounts gives the standard errors.

    Parameters
    ----------
    areas : EffectiveAreas
        Effective areas of the target.
    render_error : RenderError
    band, air, backdrop
        As for `LineOfSources`.
    """

    def __init__(
        self,
        areas: EffectiveAreas,
        render_error: RenderError,
        band: Band,
        air: Atmosphere,
        backdrop: Backdrop,
    ):
        super().__init__(areas, band, air, backdrop)
        self.render_error = render_error
        self.projected_area = Estimate(
            areas.projected_area, float(np.sqrt(areas.covariance[0, -1, -1]))
        )
        self.amounts, self.covariance = areas.amounts[0], areas.covariance[0]

    def at(self, path: LineOfSight) -> dict[str, Estimate]:
        """The in-band TERMS at the end of a path, by name.

        They are the intensity of the target before the air, W/sr; its apparent irradiance (3.16),
        the irradiances of the path and of the hidden background, W m^-2; and the contrast (3.19),
        W m^-2, which may be negative.
        """
        return self._estimates(TERMS, self.per_amount(path))

    def by_group(self, path: LineOfSight) -> dict[str, dict[str, Estimate]]:
        """The intensity and the target's irradiance of `at` by the group that emitted them.

        They are empty for a scene with too many temperatures.
        """
        if self.areas.nodes_um.size:
            return {}
        groups, per_amount = [source.group for source in self.areas.sources], self.per_amount(path)
        return {
            group: self._estimates(TERMS[:2], per_amount * [*(g == group for g in groups), False])
            for group in dict.fromkeys(groups)
        }

    def _estimates(self, names, per_amount: np.ndarray) -> dict[str, Estimate]:
        """Values by name, whose derivatives with respect to the amounts are `per_amount`."""
        variance = np.einsum("ti,ij,tj->t", per_amount, self.covariance, per_amount)
        errors = np.sqrt(np.maximum(variance, 0))
        return {
            name: Estimate(float(value), float(error))
            for name, value, error in zip(names, per_amount @ self.amounts, errors)
        }

    def half_width(self, path: LineOfSight) -> float:
        """Half of the 95 % interval of the contrast at the end of a path, W m^-2.

        It includes a source that no path of the render has hit.
        """
        degrees_of_freedom, missed, _ = self.render_error
        missed *= self.per_intensity(path)
        error = self.at(path)["total"].standard_error
        return float(student_factor(degrees_of_freedom) * error + missed)

    def least_half_width(self, path: LineOfSight) -> float:
        """The part of `half_width` that more paths do not reduce, W m^-2."""
        error = self.render_error.systematic * self.at(path)["target"].value
        return float(student_factor(self.render_error.degrees_of_freedom) * error)

    def spectral(self, path: LineOfSight) -> dict[str, np.ndarray]:
        """The TERMS at `wavelengths_um`, by name, without the response.

        The intensity is in W sr^-1 um^-1, the irradiances are in W m^-2 um^-1.
        """
        _, radiance = path.at(self.wavelengths_um)
        solid_angle = self.projected_area.value / path.range_m**2
        intensity = self.amounts[:-1] @ self.spectra
        target = self.amounts[:-1] @ self.arriving(path) / path.range_m**2
        air, hidden = radiance * solid_angle, self.background(path) * solid_angle
        return dict(zip(TERMS, (intensity, target, air, hidden, target + air - hidden)))

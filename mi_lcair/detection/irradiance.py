"""Irradiances at a sensor from the effective areas of a target (thesis Eqs 3.13-3.19).

All spectra are taken through the air first, and integrated over the band last.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, fields, replace
from typing import NamedTuple

import numpy as np

from mi_lcair.detection.scenario import Air, Scenario
from mi_lcair.estimate import Estimate
from mi_lcair.physics.air.atmosphere import Atmosphere, LineOfSight
from mi_lcair.physics.air.levels import STANDARD_CO2_PPMV, STANDARD_VISIBILITY_KM, Weather, levels
from mi_lcair.physics.atmosphere import clear_air_name
from mi_lcair.physics.bands import Band, Spectrum
from mi_lcair.plugins.emission.source import Source
from mi_lcair.plugins.emitters.distant_emitter import DistantEmitter
from mi_lcair.rendering.parameters.entries import Parameter
from mi_lcair.rendering.scene import Scene
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
    of_light, of_background : float or ndarray
        Shares of the light of the sources, (sources,), and of the hidden background that may be
        wrong at the range of the scenario, by its approximations.
    """

    degrees_of_freedom: float = np.inf
    missed: float = 0.0
    systematic: float = 0.0
    of_light: np.ndarray | float = 0.0
    of_background: float = 0.0


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

        It includes a source that no path of the render has hit, and approximations.
        """
        of_paths = self.half_width_of_paths(path)
        return float(np.hypot(of_paths, self.approximated(path)))

    def half_width_of_paths(self, path: LineOfSight) -> float:
        """The part of `half_width` that is due to the paths of the render, W m^-2."""
        degrees_of_freedom, missed, *_ = self.render_error
        missed *= self.per_intensity(path)
        error = self.at(path)["total"].standard_error
        return float(student_factor(degrees_of_freedom) * error + missed)

    def approximated(self, path: LineOfSight) -> float:
        """The part of `half_width` that is due to approximations, W m^-2.

        Those of several sources have the same cause. Their sizes are added.
        """
        error, per_amount = self.render_error, self.per_amount(path)
        n = len(self.areas.sources)
        light = per_amount[1, :n] * self.amounts[:n] * error.of_light
        background = per_amount[3, -1] * self.amounts[-1] * error.of_background
        return float(abs(light.sum()) + abs(background))

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


# Weather of a scenario: its quantities by name, and the light of sun and sky that crosses its air
# ------------------------------------------------------------------------------------------------
# ======================== ============================================
# scenario.air_temperature temperature of the air at the ground [K]
# scenario.air_humidity    relative humidity at the ground
# scenario.air_pressure    pressure at the ground [hPa]
# scenario.visibility      visibility [km]
# scenario.co2             carbon dioxide [ppmv]
# ======================== ============================================

# Quantities, and the entries of [atmosphere] that they are
QUANTITIES = {
    "scenario.air_temperature": "temperature",
    "scenario.air_humidity": "humidity",
    "scenario.air_pressure": "pressure",
    "scenario.visibility": "visibility",
    "scenario.co2": "co2",
}


def weather_quantities(air: Air) -> dict[str, Parameter]:
    """The quantities of the weather of a clear air by name; none of other air."""
    name = clear_air_name(air.table)
    if name is None:
        return {}
    weather, ground = air.weather, levels(name, air.weather)
    present = {
        "temperature": ground.temperature[0],
        "humidity": ground.humidity[0],
        "pressure": ground.pressure[0],
        "visibility": STANDARD_VISIBILITY_KM if weather.visibility is None else weather.visibility,
        "co2": STANDARD_CO2_PPMV if weather.co2 is None else weather.co2,
    }
    bounds = {entry.name: entry.metadata["bounds"] for entry in fields(Weather)}
    return {
        quantity: Parameter(
            quantity, "scenario", float(present[entry]), of.unit, of.lower, of.upper
        )
        for quantity, entry in QUANTITIES.items()
        for of in [bounds[entry]]
    }


def in_weather(scenario: Scenario, values: Mapping[str, float]) -> Scenario:
    """A scenario with other values of quantities of its weather."""
    entries = {QUANTITIES[name]: float(value) for name, value in values.items()}
    return replace(scenario, atmosphere=replace(scenario.atmosphere, **entries))


@dataclass(frozen=True)
class AirOfLight:
    """Air through which sun and sky of a scene shine on the target.

    height_m: height of the target above the ground [m]; None if it is not stated. name: name of the
    model atmosphere that has the weather; light through another one keeps that atmosphere's.
    """

    height_m: float | None
    name: str | None = None
    weather: Weather = Weather()

    @staticmethod
    def of(scenario: Scenario, height_m: float | None) -> "AirOfLight":
        """The air of a scenario whose target is at a height [m]."""
        weather = scenario.atmosphere.weather
        if weather == Weather():
            return AirOfLight(height_m)
        return AirOfLight(height_m, clear_air_name(scenario.atmosphere.table), weather)

    def shine_on(self, scene: Scene) -> None:
        """Give sun and sky of a scene the light through this air."""
        for emitter, weather in self.emitters(scene):
            emitter.in_air(self.height_m, weather)

    def emitters(self, scene: Scene) -> Iterator[tuple[DistantEmitter, Weather]]:
        """Sun and sky of a scene, and the weather in which they shine."""
        for emitter in scene.mi.emitters():
            if isinstance(emitter, DistantEmitter):
                is_here = self.name is not None and emitter.clear_air == self.name
                yield emitter, self.weather if is_here else Weather()

    def sources(self, scene: Scene, sources: list[Source]) -> list[Source]:
        """Sources of a scene with the light through this air, at the height of the emitters."""
        spectra = {
            (source.group, source.name): (source, light)
            for emitter, weather in self.emitters(scene)
            for source, light in zip(emitter.spectra(), emitter.spectra_in(weather))
            if source.spectrum is not None and source.in_band > 0
        }
        result = []
        for source in sources:
            before, light = spectra.get((source.group, source.name), (source, source))
            if light is not source:
                factor = source.in_band / before.in_band  # of a scale that the emitter has not
                spectrum = light.spectrum.scaled(factor)
                source = replace(source, in_band=factor * light.in_band, spectrum=spectrum)
            result.append(source)
        return result

"""The contrast of a scenario as a number with an uncertainty budget."""

from dataclasses import fields, replace
from functools import partial

import numpy as np

from mi_lcair.detection.irradiance import TERMS, Backdrop, Irradiance, RenderError
from mi_lcair.detection.line_of_sight import backdrop
from mi_lcair.detection.scenario import Scenario
from mi_lcair.detection.setting import Setting
from mi_lcair.errors import InputError
from mi_lcair.physics.air.levels import (
    STANDARD_CO2_PPMV,
    STANDARD_VISIBILITY_KM,
    Weather,
    levels,
)
from mi_lcair.physics.atmosphere import clear_air_name
from mi_lcair.physics.blackbody import spectral_radiance
from mi_lcair.plugins.properties import RADIANCE_UNIT
from mi_lcair.rendering.measurands import ExcessFunction
from mi_lcair.rendering.statistics import Totals
from mi_lcair.sensitivity.common_numbers import CommonNumbers
from mi_lcair.sensitivity.entries import Parameter
from mi_lcair.sensitivity.parameters import parameters_of
from mi_lcair.signatures.effective_areas import SPECTRUM_ROWS
from mi_lcair.uncertainty.numbers.number import SMALL, Linear, Number

# Quantities of a scenario by name, and the entries of [atmosphere] that they are
WEATHER = {
    "air_temperature": "temperature",
    "air_humidity": "humidity",
    "air_pressure": "pressure",
    "visibility": "visibility",
    "co2": "co2",
}
# Parameters of surroundings, and the entries of the background that they are
BEHIND = {
    "ground.temperature": "ground_temperature",
    "ground.emissivity": "ground_emissivity",
    "sky.temperature": "sky",
    "sky.scale": None,
}
TARGET, PATH, BACKGROUND, TOTAL = (
    TERMS.index(n) for n in ("target", "path", "background", "total")
)


class ContrastNumber(Number):
    """Contrast irradiance of a scenario's target at the sensor, W m^-2.

    Besides the parameters of the scene it depends on these quantities:

    scenario.transmittance         mean transmittance of the path; its spectrum keeps its shape
    scenario.path_radiance         radiance of the path, likewise
    scenario.background_radiance   radiance of the background, likewise
    scenario.background_temperature  temperature of a background that is a blackbody [K]
    scenario.range_m               range; the path changes with it [m]
    scenario.nei                   noise of the sensor, an irradiance [W m^-2]
    scenario.air_temperature, air_humidity, air_pressure, visibility, co2
                                   weather of a clear air, see `Weather`

    Parameters
    ----------
    scenario : Scenario
        The largest of its numbers of reflections is used.
    progress : callable or None
        As for `contrast`.

    The scene must have the scenario's lobe and number of reflections while the number is used.
    """

    title, unit = "contrast", "W m^-2"

    def __init__(self, scenario: Scenario, setting: Setting, progress=None):
        self.scenario, self.setting = scenario, setting
        self.scene, self.what = setting.view, scenario.name
        self.known = parameters_of(self.scene) | self.scenario_quantities()
        table = scenario.render
        sampling = table.of_render(progress)
        criterion = ExcessFunction(self.excess) if table.has_tolerance else None
        self.numbers = CommonNumbers(self.scene, sampling, True, criterion=criterion)

    def start(self):
        super().start()
        if not self.areas.projected_area > 0:
            raise InputError("no ray met the target; raise resolution or spp of [render]")

    def scenario_quantities(self) -> dict[str, Parameter]:
        """The scenario's quantities and their values, by name."""
        setting, band = self.setting, self.setting.detector.band
        extrapolate, range_m = self.scenario.atmosphere.extrapolate, setting.path.range_m
        x = np.linspace(band.lower_um, band.upper_um, SPECTRUM_ROWS)
        background = np.trapezoid(
            setting.backdrop.at_sensor(range_m).at(x) * band.response_at(x), x
        )
        transmittance = setting.air.transmittance_mean(band, range_m, extrapolate)
        (path_radiance,) = setting.air.band_path_radiance(band, [range_m], extrapolate)
        values = {
            "transmittance": (transmittance, "1", 0.0, 1.0),
            "path_radiance": (path_radiance, RADIANCE_UNIT, 0.0, np.inf),
            "background_radiance": (background, RADIANCE_UNIT, 0.0, np.inf),
            "range_m": (range_m, "m", setting.target.radius, self.farthest),
            "nei": (0.0, self.unit, -np.inf, np.inf),
        }
        temperature = self.scenario.background.temperature
        if temperature is not None:
            values["background_temperature"] = (temperature, "K", 1.0, np.inf)
        if (name := clear_air_name(self.scenario.atmosphere.table)) is not None:
            values |= weather_values(name, self.scenario.atmosphere.weather)
        return {
            f"scenario.{name}": Parameter(
                f"scenario.{name}", "scenario", float(value), unit, lower, upper
            )
            for name, (value, unit, lower, upper) in values.items()
        }

    @property
    def farthest(self) -> float:
        """Largest range that the atmosphere allows [m]."""
        air = self.setting.air
        if air.is_vacuum or self.scenario.atmosphere.extrapolate:
            return np.inf
        return float(air.ranges_m[-1])

    def irradiance(
        self, total: Totals, areas, temperature: float | None = None, setting: Setting | None = None
    ) -> Irradiance:
        """Irradiances of a render, optionally before a background of another temperature [K].

        setting: that of other weather.
        """
        setting = setting or self.setting
        backdrop = setting.backdrop
        if temperature is not None:
            at = partial(spectral_radiance, temperature=temperature)
            backdrop = Backdrop(backdrop.name, at, backdrop.rows_um)
        mean = total.mean("target")[0]
        return Irradiance(
            areas,
            RenderError(
                total.standard_error("target")[0] / mean if mean > 0 else 0.0,
                total.randomisations - 1,
                float(total.missed("target")[0] * self.numbers.area),
            ),
            setting.detector.band,
            setting.air,
            backdrop,
        )

    def excess(self, total: Totals) -> float:
        """Ratio of the half width of the contrast's 95 % interval to the allowed one."""
        terms, path = self.irradiance(total, self.areas_of(total)), self.setting.path
        allowed = self.scenario.render.allowed(terms.at(path)["total"].value)
        return terms.half_width(path) / allowed if allowed > 0 else np.inf

    def terms(self, total, areas, quantities) -> tuple[Irradiance, np.ndarray]:
        """Irradiances, and the target's, the path's and the background's part per amount."""

        def value(name):
            return quantities.get(f"scenario.{name}")

        weather = {entry: value(name) for name, entry in WEATHER.items() if value(name) is not None}
        setting = self.setting.in_weather(self.scenario, weather) if weather else self.setting
        irradiance = self.irradiance(total, areas, value("background_temperature"), setting)
        path = setting.path
        if value("range_m") is not None:
            path = setting.air.path(value("range_m"), self.scenario.atmosphere.extrapolate)
        per_amount = irradiance.per_amount(path)[[TARGET, PATH, BACKGROUND]]
        for row, name in enumerate(("transmittance", "path_radiance", "background_radiance")):
            was = self.known[f"scenario.{name}"].value if value(name) is not None else 0.0
            if was:
                per_amount[row] *= value(name) / was
        return irradiance, per_amount

    def linear(self, total, areas, quantities):
        irradiance, (target, path, background) = self.terms(total, areas, quantities)
        covariance = irradiance.covariance
        if covariance is None:
            covariance = np.diag(irradiance.errors**2)
        whole = np.zeros((len(target) + 1,) * 2)
        whole[:-1, :-1] = covariance
        return Linear(
            np.append(target + path - background, 1.0),
            np.append(irradiance.amounts, quantities.get("scenario.nei", 0.0)),
            whole,
        )

    # ------------------------------------------------------------------ Surroundings

    def at(self, values):
        return super().at(values) + sum(self.behind(name, v) for name, v in values.items())

    def derivatives(self, names, sigma):
        slopes, errors = super().derivatives(names, sigma)
        for k, name in enumerate(names):
            # Differences of the number know of the background already
            if name in BEHIND and (self.has_weights or not self.needs_render(name)):
                value, step = self.known[name].value, SMALL * sigma[k]
                ends = self.within(name, value - step), self.within(name, value + step)
                low, high = (self.behind(name, end) for end in ends)
                slopes[k] += (high - low) / (ends[1] - ends[0])
        return slopes, errors

    def behind(self, name: str, value: float) -> float:
        """Change of the number because a parameter of surroundings is also behind the target."""
        if name not in BEHIND or self.scenario.surroundings is None:
            return 0.0
        setting, background = self.setting, self.scenario.background
        irradiance = self.irradiance(self.total, self.areas)
        path, entry = setting.path, BEHIND[name]
        before = irradiance.in_band(irradiance.background(path))
        if entry is None:
            changed = setting.backdrop.scaled(1.0 if setting.sight.meets_ground else value)
        else:
            new = repr(float(value)) if entry == "sky" else float(value)
            scenario = replace(self.scenario, background=replace(background, **{entry: new}))
            changed = backdrop(scenario, setting.detector, setting.sight)
        at_sensor = changed.at_sensor(path.range_m)
        after = irradiance.in_band(at_sensor.at(irradiance.wavelengths_um))
        return -(after - before) * irradiance.projected_area.value / path.range_m**2

    @property
    def has_weights(self):
        return self.is_linear

    def weights(self):
        factors = self.terms(self.total, self.areas, {})[1][0]
        return {
            (source.group, source.name): factor / source.in_band if source.in_band > 0 else 0.0
            for source, factor in zip(self.areas.sources, factors)
        }

    @property
    def most_of_intensity(self) -> float:
        irradiance, _ = self.terms(self.total, self.areas, {})
        return irradiance.per_intensity(self.setting.path)

    @property
    def of_intensity(self) -> float:
        irradiance, (target, *_) = self.terms(self.total, self.areas, {})
        return float(target @ irradiance.amounts)


def weather_values(name: str, weather: Weather) -> dict[str, tuple]:
    """Value, unit and bounds of each quantity of WEATHER in a model atmosphere's weather."""
    air = levels(name, weather)
    stated = {
        "temperature": air.temperature[0],
        "humidity": air.humidity[0],
        "pressure": air.pressure[0],
        "visibility": STANDARD_VISIBILITY_KM if weather.visibility is None else weather.visibility,
        "co2": STANDARD_CO2_PPMV if weather.co2 is None else weather.co2,
    }
    bounds = {entry.name: entry.metadata["bounds"] for entry in fields(Weather)}
    return {
        quantity: (stated[entry], of_entry.unit, of_entry.lower, of_entry.upper)
        for quantity, entry in WEATHER.items()
        for of_entry in [bounds[entry]]
    }

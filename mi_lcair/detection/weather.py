"""Weather of a scenario: its quantities by name, and the light of sun and sky that crosses its air.

======================== ============================================
scenario.air_temperature temperature of the air at the ground [K]
scenario.air_humidity    relative humidity at the ground
scenario.air_pressure    pressure at the ground [hPa]
scenario.visibility      visibility [km]
scenario.co2             carbon dioxide [ppmv]
======================== ============================================
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields, replace

from mi_lcair.detection.scenario import Air, Scenario
from mi_lcair.physics.air.levels import STANDARD_CO2_PPMV, STANDARD_VISIBILITY_KM, Weather, levels
from mi_lcair.physics.atmosphere import clear_air_name
from mi_lcair.plugins.emission.source import Source
from mi_lcair.plugins.emitters.distant_emitter import DistantEmitter
from mi_lcair.rendering.parameters.entries import Parameter
from mi_lcair.rendering.scene import Scene

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

"""The line of sight of a scenario: the air along it, and the background behind the target.

A line that looks up ends in the sky. One that looks down goes on behind the target to the ground,
through air of its own, which is longer than the target's if the target is above the ground. Just
above the horizon it misses the ground, and ends in the sky too.
"""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from mi_lcair.detection.irradiance import Backdrop
from mi_lcair.detection.scenario import HIGHEST_M, Scenario
from mi_lcair.errors import InputError
from mi_lcair.physics.air.atmosphere import PAST_GROUND, Atmosphere, LineOfSight
from mi_lcair.physics.air.clear_air import ClearPaths, SunDirection, clear_air
from mi_lcair.physics.air.levels import HEIGHT_M, Weather, height_along, length_between, lower_end
from mi_lcair.physics.atmosphere import atmosphere, clear_air_name
from mi_lcair.physics.blackbody import spectral_radiance
from mi_lcair.physics.imager import Detector
from mi_lcair.physics.sky import clear_name
from mi_lcair.physics.sun import SUN_ELEVATION_DEG, ClearSky
from mi_lcair.physics.surroundings import ATMOSPHERE, CLEAR, Ground, Surroundings, TableSky, sky_of

CLOSE_M = 0.5  # difference of two ranges that is rounding of a table in km


@dataclass(frozen=True, eq=False)
class Sight:
    """A line of sight and its air.

    Attributes
    ----------
    elevation_deg : float
        Elevation of the line of sight at its lower end, degrees, upward from the sensor.
    observer_m, target_m : float or None
        Heights of the ends above the ground, m; None where neither scenario nor air states them.
    air : Atmosphere
        Air between target and sensor, over the range from the target to the sensor. The lower one
        of the two stays where it is.
    beyond_m : float
        Length, m, of the straight line of sight from its lower end on to the ground; infinite if
        it does not meet the ground.
    extrapolate : bool
        Whether ranges beyond a table are allowed.
    sun : SunDirection or None
        Sun, with the azimuth of the line of sight from it.
    """

    elevation_deg: float
    observer_m: float | None
    target_m: float | None
    air: Atmosphere
    beyond_m: float
    extrapolate: bool
    sun: SunDirection | None = None

    @staticmethod
    def of(scenario: Scenario, sun: tuple[float, float] | None = None) -> "Sight":
        """The line of sight of a scenario; raises InputError if its air does not cover it.

        sun: azimuth and elevation of a sun in the scene's axes [degrees]; None by night.
        """
        observer, of_air = scenario.observer, scenario.atmosphere
        name = clear_air_name(of_air.table)
        upward = 0.0 - observer.elevation_deg
        lower = lower_height(scenario, HEIGHT_M if name else None)
        lowest = lower or 0.0
        upper = height_along(lowest, abs(upward), observer.range_m)
        if lower is not None and upper > HIGHEST_M:
            raise InputError(
                f"[observer]: the upper end of the line of sight is {upper:.6g} m above the "
                f"ground; must be at most {HIGHEST_M:g} m"
            )
        direction = None if sun is None else from_sun(observer.azimuth_deg, *sun)
        air = atmosphere(of_air.table, of_air.ranges_m, upward, of_air.air_temperature)
        if name:
            clear = clear_air(name, of_air.weather)
            ends = of_air.table, clear, lowest, abs(upward), upward >= 0
            air = ClearPaths(*ends, observer.range_m, direction)
        beyond = (length_between(lowest, 0.0, -abs(upward)) or np.inf) if lowest else 0.0
        heights = (None, None) if lower is None else (lower, upper)
        return Sight(
            upward,
            *(heights if upward >= 0 else heights[::-1]),
            air,
            beyond,
            of_air.extrapolate,
            direction,
        )

    @property
    def meets_ground(self) -> bool:
        """Whether the line of sight meets the ground behind the target."""
        if self.elevation_deg >= 0:
            return False
        if isinstance(self.air, ClearPaths):
            return self.elevation_deg < self.air.air.horizon_deg(self.target_m)
        return bool(np.isfinite(self.beyond_m))

    def elevation_at_sensor(self, range_m: float) -> float:
        """Elevation at the sensor of the line to a target at a range, m [degrees], upward."""
        if self.elevation_deg >= 0 or not isinstance(self.air, ClearPaths):
            return self.elevation_deg
        return -self.air.air.end(self.air.lower_m, -self.elevation_deg, range_m)[2]

    def to_ground(self, range_m: float) -> LineOfSight:
        """Path from the ground to a sensor that looks down and is `range_m` from the target."""
        if isinstance(self.air, ClearPaths):
            return self.air.to_ground(range_m)
        if not np.isfinite(self.beyond_m):
            raise InputError(PAST_GROUND)
        length = range_m + self.beyond_m
        if not self.air.is_vacuum and abs(length - self.air.ranges_m[-1]) < CLOSE_M:
            length = float(self.air.ranges_m[-1])
        return self.air.path(length, self.extrapolate)


def lower_height(scenario: Scenario, unstated_m: float | None) -> float | None:
    """Height of the lower end of the line of sight, m; `unstated_m` if the scenario states none."""
    observer, height_m = scenario.observer, scenario.target.height_m
    if height_m is not None and observer.height_m is not None:
        raise InputError(
            "height_m of [target] and of [observer]; give one of them, the other follows from "
            "range and elevation"
        )
    target_is_lower = observer.elevation_deg > 0
    if height_m is None and observer.height_m is None:
        return unstated_m
    if (height_m is None) != target_is_lower:
        return observer.height_m if height_m is None else height_m
    upper, where = (observer.height_m, "[observer]") if height_m is None else (height_m, "[target]")
    height = lower_end(upper, abs(observer.elevation_deg), observer.range_m)
    if height < -0.5:
        remedy = "choose a shorter range or a larger height"
        if not observer.elevation_deg:
            remedy = "the earth is curved: give height_m of [observer], or elevation_deg = 0.01"
        raise InputError(
            f"{where}: from height_m = {upper:g} the line of sight, "
            f"{abs(observer.elevation_deg):g} degrees downward, ends below the ground before "
            f"range_m = {observer.range_m:g}; {remedy}"
        )
    return max(height, 0.0)


def from_sun(observer_azimuth_deg: float, azimuth_deg: float, elevation_deg: float) -> SunDirection:
    """Direction of a sun from the sensor, which looks away from where the target sees it."""
    turn = observer_azimuth_deg + 180 - azimuth_deg
    return SunDirection(elevation_deg, abs((turn + 180) % 360 - 180))


def backdrop(scenario: Scenario, detector: Detector, sight: Sight) -> Backdrop:
    """The background in the direction of the line of sight."""
    behind, upward = scenario.background, sight.elevation_deg
    if behind.temperature is not None:
        return Backdrop(
            f"blackbody at {behind.temperature:g} K",
            partial(spectral_radiance, temperature=behind.temperature),
            np.empty(0),
        )
    if behind.ground_temperature is not None and sight.meets_ground:
        return ground(scenario, detector, sight)
    if behind.sky is None and behind.daytime_sky is None:
        raise InputError(
            f"the line of sight looks up, by {upward:g} degrees, where no ground is behind the "
            "target; give [background] a sky"
            if upward >= 0
            else PAST_GROUND
        )
    # Past the ground, the sky is that at the target, and the air before the target is added
    height_m = sight.observer_m if upward >= 0 else sight.target_m
    sky = sky_behind(scenario, HEIGHT_M if height_m is None else height_m, sight.sun)
    if sky.by_elevation and sight.meets_ground:
        raise InputError(
            f"the line of sight looks down, by {-upward:g} degrees, where no sky is behind "
            "the target; give [background] a temperature or ground_temperature"
        )
    if sky.by_azimuth:
        azimuth = sight.sun.azimuth_deg
        name = f"{sky.name} by day, {upward:.4g} deg, azimuth {azimuth:.4g} deg from the sun"
        table = replace(sky.at(upward, azimuth), name=name)
    else:
        table = sky.at(upward)
    table.in_band_radiance(detector.band)  # raises InputError if the table does not cover the band
    through_air = None, ()
    if sky.by_elevation and upward < 0:
        through_air = partial(sight.air.path, extrapolate=sight.extrapolate), ((1.0, table),)
    return Backdrop(f"sky {table.name}", table.at, table.wavelengths_um, *through_air)


def background_sun(scenario: Scenario) -> tuple[float, float] | None:
    """Azimuth and elevation of the sun of a daytime sky [degrees]; None without one.

    They hold for a scene that has no sun of its own.
    """
    if not scenario.background.by_day:
        return None
    behind = scenario.background.with_sun(0.0, SUN_ELEVATION_DEG)
    return behind.sun_azimuth_deg, behind.sun_elevation_deg


def weather_of(scenario: Scenario, name: str | None) -> Weather:
    """Weather of a clear sky: that of [atmosphere] if it is the same model atmosphere."""
    of_air = scenario.atmosphere
    same = name is not None and clear_air_name(of_air.table) == name
    return of_air.weather if same else Weather()


def sky_behind(
    scenario: Scenario, height_m: float, sun: SunDirection | None
) -> ClearSky | TableSky:
    """The sky of a scenario's background, as it is seen from a height [m].

    sun: the sun, whose light it has if it is one by day.
    """
    behind = scenario.background
    name = behind.daytime_sky or clear_name(behind.sky)
    sky = behind.sky if behind.daytime_sky is None else CLEAR
    elevation = sun.elevation_deg if behind.by_day else None
    return sky_of(sky, name or ATMOSPHERE, elevation, height_m, weather_of(scenario, name))


def surroundings_of(scenario: Scenario, sight: Sight) -> Surroundings | None:
    """Sky and ground of a scenario's background around its sensor; None for a single radiance.

    Air is before the ground if it is clear air, whose weather is known in all directions.
    """
    behind, sky, below = scenario.background, None, None
    if behind.temperature is not None:
        return None
    if behind.sky is not None or behind.daytime_sky is not None:
        height_m = HEIGHT_M if sight.observer_m is None else sight.observer_m
        sky = sky_behind(scenario, height_m, sight.sun)
        if behind.ground_temperature is None and not sky.by_elevation:
            return None
    if behind.ground_temperature is not None:
        below = Ground(behind.ground_temperature, behind.ground_emissivity)
    sun = None if sight.sun is None else sight.sun.elevation_deg
    if isinstance(sight.air, ClearPaths):
        return Surroundings(sky, below, sight.air.air, sight.observer_m, sun, behind.sun_file)
    return Surroundings(sky, below, clear_air(ATMOSPHERE), None, sun, behind.sun_file)


def ground(scenario: Scenario, detector: Detector, sight: Sight) -> Backdrop:
    """The ground behind the target: it emits, and reflects sky and sun diffusely."""
    behind = scenario.background
    temperature, emissivity = behind.ground_temperature, behind.ground_emissivity
    emitted = partial(spectral_radiance, temperature=temperature)
    name = f"ground at {temperature:g} K, emissivity {emissivity:g}"
    if emissivity == 1:
        return Backdrop(name, emitted, np.empty(0), sight.to_ground)
    lights = surroundings_of(scenario, sight).reflected
    for light in lights:
        light.in_band_radiance(detector.band)  # raises InputError if it does not cover the band

    def radiance(wavelengths_um):
        reflected = sum(light.at(wavelengths_um) for light in lights)
        return emissivity * emitted(wavelengths_um) + reflected

    rows = np.unique(np.concatenate([light.wavelengths_um for light in lights]))
    above = behind.sky or f"{behind.daytime_sky} by day"
    through_air = tuple((1.0, light) for light in lights)
    return Backdrop(f"{name}, below {above}", radiance, rows, sight.to_ground, through_air)

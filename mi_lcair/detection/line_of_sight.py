"""The line of sight of a scenario: the air along it, and the background behind the target.

A line that looks up ends in the sky. One that looks down goes on behind the target to the ground,
through air of its own, which is longer than the target's if the target is above the ground.
"""

from dataclasses import dataclass
from functools import partial

import numpy as np

from mi_lcair.detection.irradiance import Backdrop
from mi_lcair.detection.scenario import Background, Scenario
from mi_lcair.errors import InputError
from mi_lcair.physics.atmosphere import Atmosphere, LineOfSight, atmosphere
from mi_lcair.physics.blackbody import spectral_radiance
from mi_lcair.physics.detector import Detector
from mi_lcair.physics.slant.air import SlantAir, is_slant, slant_air
from mi_lcair.physics.slant.geometry import extended_down, height_along, lower_end
from mi_lcair.physics.spectrum import Spectrum, has_elevations, spectrum
from mi_lcair.physics.sun.daytime_sky import SUN_ELEVATION_DEG, daytime_sky
from mi_lcair.physics.sun.sunlight import sunlight

SKY_NODES = 8  # elevations at which the sky that the ground reflects is integrated
CLOSE_M = 0.5  # difference of two ranges that is rounding of a table in km


@dataclass(frozen=True, eq=False)
class Sight:
    """A line of sight and its air.

    Attributes
    ----------
    elevation_deg : float
        Elevation of the line of sight, degrees, upward from the sensor, in the scene's axes.
    observer_m, target_m : float or None
        Heights of the ends above the ground, m; None where neither scenario nor table states them.
    air : Atmosphere
        Air between target and sensor, over the range from the target to the sensor. The lower one
        of the two stays where it is.
    below : Atmosphere
        Air between the ground and a sensor that looks down, over the range from the ground; `air`
        if the line of sight looks up.
    base_elevation_deg : float
        Elevation of the line of sight, degrees, where it meets the ground or the lower end of the
        air's table.
    beyond_m : float
        Length, m, of the line of sight from there to its lower end. If the sensor looks down, this
        is the path between the target and the ground.
    extrapolate : bool
        Whether ranges beyond the table are allowed.
    slant : SlantAir or None
        Table of slant paths that the air is from.
    """

    elevation_deg: float
    observer_m: float | None
    target_m: float | None
    air: Atmosphere
    below: Atmosphere
    base_elevation_deg: float
    beyond_m: float
    extrapolate: bool
    slant: SlantAir | None

    @staticmethod
    def of(scenario: Scenario) -> "Sight":
        """The line of sight of a scenario; raises InputError if its air does not cover it."""
        observer, of_air = scenario.observer, scenario.atmosphere
        slant = slant_air(of_air.table) if is_slant(of_air.table) else None
        if slant is not None and of_air.ranges_m is not None:
            raise InputError(
                f"atmosphere '{of_air.table}': ranges_m are for the blocks of a MODTRAN tape7 "
                "only; leave them out"
            )
        upward = 0.0 - observer.elevation_deg
        base = 0.0 if slant is None else slant.lower_m
        lower = lower_height(observer, base)
        lowest = base if lower is None else max(lower, base)
        extension = extended_down(lowest, abs(upward), base)
        if slant is None:
            air = below = atmosphere(of_air.table, of_air.ranges_m, upward)
            extension = extension or (0.0, np.inf)
        elif extension is None:
            raise InputError(
                f"atmosphere '{slant.name}': the line of sight, of {abs(upward):.4g} degrees at "
                f"{lowest:.6g} m, does not reach down to {base:g} m, where its paths begin; choose "
                "a higher elevation, or a table of horizontal paths"
            )
        else:
            air = slant.along(extension[0], upward >= 0, extension[1])
            below = air if upward >= 0 else slant.along(extension[0], False)
        upper = None if lower is None else height_along(lowest, abs(upward), observer.range_m)
        return Sight(
            upward,
            *((lower, upper) if upward >= 0 else (upper, lower)),
            air,
            below,
            *extension,
            of_air.extrapolate,
            slant,
        )

    def to_ground(self, range_m: float) -> LineOfSight:
        """Path from the ground to a sensor that looks down and is `range_m` from the target."""
        length = range_m + self.beyond_m
        if not np.isfinite(length):
            raise InputError(
                "the line of sight goes past the ground; lower elevation_deg of [observer], or "
                "give [background] a temperature"
            )
        if not self.below.is_vacuum and abs(length - self.below.ranges_m[-1]) < CLOSE_M:
            length = float(self.below.ranges_m[-1])
        return self.below.path(length, self.extrapolate)


def lower_height(observer, base_m: float) -> float | None:
    """Height of the lower end of the line of sight, m.

    Without a height of the observer it is that of the table's paths, or unknown (None) if the
    table's paths begin at no height of their own (`base_m` 0).
    """
    if observer.height_m is None:
        return base_m or None
    if observer.elevation_deg <= 0:
        return observer.height_m
    height = lower_end(observer.height_m, observer.elevation_deg, observer.range_m)
    if height < -0.5:
        raise InputError(
            f"[observer]: from height_m = {observer.height_m:g} the line of sight, "
            f"{observer.elevation_deg:g} degrees downward, ends below the ground before "
            f"range_m = {observer.range_m:g}; choose a shorter range or a larger height"
        )
    return max(height, 0.0)


def backdrop(scenario: Scenario, detector: Detector, sight: Sight) -> Backdrop:
    """The background in the direction of the line of sight."""
    behind, upward = scenario.background, sight.elevation_deg
    if behind.temperature is not None:
        return Backdrop(
            f"blackbody at {behind.temperature:g} K",
            partial(spectral_radiance, temperature=behind.temperature),
            np.empty(0),
        )
    if behind.ground_temperature is not None and upward < 0:
        return ground(scenario, detector, sight)
    if behind.sky is None and behind.daytime_sky is None:
        raise InputError(
            f"the line of sight looks up, by {upward:g} degrees, where no ground is behind the "
            "target; give [background] a sky"
        )
    has_direction = behind.daytime_sky is not None or has_elevations(behind.sky)
    if has_direction and upward < 0:
        raise InputError(
            f"the line of sight looks down, by {-upward:g} degrees, where no sky is behind "
            "the target; give [background] a temperature or ground_temperature"
        )
    is_higher = sight.slant is not None and sight.beyond_m > 0
    elevation = sight.base_elevation_deg if is_higher else upward
    if behind.daytime_sky is not None:
        table = sunlit_sky(scenario, elevation)
    else:
        table = spectrum(behind.sky, elevation if has_direction else None)
    table.in_band_radiance(detector.band)  # raises InputError if the table does not cover the band
    if has_direction and is_higher:
        table = sight.slant.sky_above(table, elevation, sight.beyond_m)
    return Backdrop(f"sky {table.name}", table.at, table.wavelengths_um)


def sunlit_sky(scenario: Scenario, elevation_deg: float) -> Spectrum:
    """The clear daytime sky in the azimuth in which the sensor looks, and at an elevation."""
    behind = scenario.background
    sky = daytime_sky(behind.daytime_sky)
    # The sensor looks away from where it is seen from the target.
    from_sun = scenario.observer.azimuth_deg + 180 - behind.sun_azimuth_deg
    from_sun = abs((from_sun + 180) % 360 - 180)
    radiance = sky.between(sky.thermal, sky.scattered, elevation_deg, from_sun)
    name = f"{sky.name} by day, {elevation_deg:.4g} deg, azimuth {from_sun:.4g} deg from the sun"
    return Spectrum(name, sky.wavelengths_um, radiance)


def reflected(background: Background) -> list[tuple[float, Spectrum]]:
    """Radiance that white ground reflects diffusely, as spectra with factors that add up.

    It is the mean of the sky, weighted by the cosine to the zenith, and by day also the direct sun.
    """
    if background.daytime_sky is not None:
        sky = daytime_sky(background.daytime_sky)
        sun = sunlight(background.daytime_sky, SUN_ELEVATION_DEG)
        factor = np.sin(np.radians(SUN_ELEVATION_DEG)) / np.pi
        direct = Spectrum(sun.name, sun.wavelengths_um, sun.irradiance)
        return [(1.0, sky.mean_spectrum()), (factor, direct)]
    if not has_elevations(background.sky):
        return [(1.0, spectrum(background.sky))]
    # In the squared sine of the elevation all parts of the mean have the same weight.
    nodes, weights = np.polynomial.legendre.leggauss(SKY_NODES)
    elevations = np.degrees(np.arcsin(np.sqrt((nodes + 1) / 2)))
    return [
        (weight / 2, spectrum(background.sky, elevation))
        for weight, elevation in zip(weights, elevations)
    ]


def ground(scenario: Scenario, detector: Detector, sight: Sight) -> Backdrop:
    """The ground behind the target: it emits, and reflects sky and sun diffusely."""
    behind = scenario.background
    temperature, emissivity = behind.ground_temperature, behind.ground_emissivity
    emitted = partial(spectral_radiance, temperature=temperature)
    name = f"ground at {temperature:g} K, emissivity {emissivity:g}"
    if emissivity == 1:
        return Backdrop(name, emitted, np.empty(0), sight.to_ground)
    light = reflected(behind)
    for _, table in light:
        table.in_band_radiance(detector.band)  # raises InputError if it does not cover the band

    def radiance(wavelengths_um):
        white = sum(factor * table.at(wavelengths_um) for factor, table in light)
        return emissivity * emitted(wavelengths_um) + (1 - emissivity) * white

    rows = np.unique(np.concatenate([table.wavelengths_um for _, table in light]))
    above = behind.sky or f"{behind.daytime_sky} by day"
    return Backdrop(f"{name}, below {above}", radiance, rows, sight.to_ground)

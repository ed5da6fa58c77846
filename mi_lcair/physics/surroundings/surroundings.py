"""Sky and ground around a viewer: what arrives from a direction, and the air before the ground."""

from dataclasses import dataclass
from functools import cached_property, reduce

import numpy as np
from numpy.typing import ArrayLike

from mi_lcair.errors import InputError
from mi_lcair.physics.air.bands import bands
from mi_lcair.physics.air.clear_air import ClearAir, SunDirection, check_height, clear_air
from mi_lcair.physics.air.levels import Weather
from mi_lcair.physics.air.ray import Ray
from mi_lcair.physics.bands import Band
from mi_lcair.physics.spectrum import Spectrum
from mi_lcair.physics.sun.daytime_sky import ClearSky, between_rings
from mi_lcair.physics.sun.sunlight import sunlight
from mi_lcair.physics.surroundings.skies import Blackbody, TableSky, sky_of, through_air

ATMOSPHERE = "us_standard"  # model atmosphere of surroundings that state none
# Angles below the horizon at which ground seen through air is computed [degrees]
GROUND_RINGS_DEG = np.array([0.02, 0.1, 0.3, 1, 2, 4, 8, 15, 28, 50, 90])
# Azimuths from the sun at which sunlight that is scattered before the ground is computed [degrees]
GROUND_AZIMUTHS_DEG = 0, 4, 8, 13, 20, 30, 42, 56, 75, 100, 130, 155, 180
ACROSS_DEG = 90.0  # azimuth from the sun at which its light's way through the air is taken


@dataclass(frozen=True)
class Ground:
    """Flat ground without an end, which reflects diffusely what it does not absorb.

    temperature: [K]. emissivity: 0..1.
    """

    temperature: float
    emissivity: float = 1.0


@dataclass(frozen=True, eq=False)
class Surroundings:
    """Sky and ground around a viewer.

    Directions are elevations from the horizontal, upward, and azimuths from the sun [degrees].
    Radiance from a direction has two components, which depend on different quantities. Above the
    horizon they are what the sky emits, and the sunlight that it scatters. Below it they are what
    the ground emits, and the light of sky, sun and air that comes from there.

    Attributes
    ----------
    sky
        The sky; None for none.
    ground
        The ground; None for none.
    air
        Air between viewer and ground.
    height_m
        Height of the viewer above the ground [m]. None if it is not known: no air is then before
        the ground.
    sun_elevation_deg
        Elevation of the sun that the ground reflects, and whose light the air before it scatters;
        None by night.
    sun_file
        CSV file of the sun's irradiance that the ground reflects; None for that of clear air.
    """

    sky: ClearSky | TableSky | None
    ground: Ground | None
    air: ClearAir
    height_m: float | None = None
    sun_elevation_deg: float | None = None
    sun_file: str | None = None

    @property
    def is_through_air(self) -> bool:
        """Whether there is air between viewer and ground."""
        return self.height_m is not None and self.height_m > 0

    @cached_property
    def horizon_deg(self) -> float:
        """Elevation of the horizon [degrees], 0 or less."""
        return self.air.horizon_deg(self.height_m) if self.is_through_air else 0.0

    def components(self, elevation_deg: float, azimuth_deg: float = 0.0) -> list[Spectrum]:
        """Spectra of the components that arrive from a direction, without those that are 0."""
        if elevation_deg >= self.horizon_deg:
            return [] if self.sky is None else self.sky.components(elevation_deg, azimuth_deg)
        if self.ground is None:
            return []
        along = self.path_to_ground(elevation_deg)
        components = [self.emitted_by_ground(along)]
        other = self.beside_emission(along, azimuth_deg)
        return components if other is None else [*components, other]

    def at(self, elevation_deg: float, azimuth_deg: float = 0.0) -> Spectrum:
        """Spectral radiance from a direction [W m^-2 sr^-1 um^-1].

        Raises InputError for a direction without sky or ground.
        """
        components = self.components(elevation_deg, azimuth_deg)
        if not components:
            missing = "sky" if elevation_deg >= self.horizon_deg else "ground"
            raise InputError(
                f"surroundings: at an elevation of {elevation_deg:g} degrees there is no {missing}"
            )
        if len(components) == 1:
            return components[0]
        no_air = np.zeros(len(bands().columns))
        first, second = (through_air(component, no_air) for component in components)
        return first.plus(second)

    def path_to_ground(self, elevation_deg: float) -> Ray | None:
        """The ray from the viewer to the ground; None without air between them."""
        return self.air.ray(self.height_m, elevation_deg) if self.is_through_air else None

    def emitted_by_ground(self, along: Ray | None) -> Spectrum:
        """What the ground emits, after the air along a ray."""
        light = Blackbody.of(self.ground.temperature).scaled(self.ground.emissivity)
        return light if along is None else through_air(light, along.amounts[-1])

    def beside_emission(
        self, along: Ray | None, azimuth_deg: float | None = None
    ) -> Spectrum | None:
        """What arrives from the ground's direction without being emitted by it; None for nothing.

        It is light that the ground reflects, and that of the air before it. Without an azimuth,
        scattered sunlight is left out.
        """
        parts = list(self.reflected)
        if along is not None:
            parts = [through_air(light, along.amounts[-1]) for light in parts]
            day = self.sun_elevation_deg is not None and azimuth_deg is not None
            sun = SunDirection(self.sun_elevation_deg, azimuth_deg) if day else None
            parts.append(self.air.emitted(along, sun))
        elif len(parts) > 1:
            parts = [through_air(light, np.zeros(len(bands().columns))) for light in parts]
        return reduce(lambda total, part: total.plus(part), parts) if parts else None

    @cached_property
    def reflected(self) -> list[Spectrum]:
        """Light of sky and sun that the ground reflects; it has the same radiance in all
        directions.
        """
        reflectance = 1 - self.ground.emissivity
        if reflectance == 0:
            return []
        lights = [] if self.sky is None else list(self.sky.on_ground)
        if self.sun_elevation_deg is not None:
            air = self.sky.air if isinstance(self.sky, ClearSky) else self.air
            factor = np.sin(np.radians(self.sun_elevation_deg)) / np.pi
            sun = air.sun(0.0, self.sun_elevation_deg)
            if self.sun_file is not None:
                sun = sunlight(self.sun_file)
            lights.append((factor, sun))
        return [light.scaled(reflectance * factor) for factor, light in lights]

    def in_band_components(
        self, band: Band, elevation_deg: ArrayLike, azimuth_deg: ArrayLike = 0.0
    ) -> tuple[np.ndarray, np.ndarray]:
        """In-band radiance of both components from some directions [W m^-2 sr^-1].

        Parameters
        ----------
        band
            Band with the detector's response.
        elevation_deg, azimuth_deg
            Elevations and azimuths from the sun [degrees], arrays of one shape (...).

        Returns
        -------
        tuple of numpy.ndarray
            The two components, (...) each. Between computed elevations they are interpolated.
        """
        elevation, azimuth = np.broadcast_arrays(
            np.asarray(elevation_deg, dtype=float), np.asarray(azimuth_deg, dtype=float)
        )
        result = np.zeros((2, *elevation.shape))
        above = elevation >= self.horizon_deg
        if self.sky is not None and above.any():
            parts = self.sky.in_band_components(band, elevation[above], azimuth[above])
            for k, part in enumerate(parts):
                result[k, above] = part
        if self.ground is not None and not above.all():
            parts = self._below(band, elevation[~above], azimuth[~above])
            for k, part in enumerate(parts):
                result[k, ~above] = part
        return result[0], result[1]

    def in_band_radiance(
        self, band: Band, elevation_deg: ArrayLike, azimuth_deg: ArrayLike = 0.0
    ) -> np.ndarray:
        """In-band radiance from some directions, see `in_band_components`."""
        return sum(self.in_band_components(band, elevation_deg, azimuth_deg))

    def _below(self, band, elevation, azimuth):
        """The two in-band components below the horizon."""

        def in_band(light):
            return 0.0 if light is None else light.in_band_radiance(band)

        if not self.is_through_air:
            return in_band(self.emitted_by_ground(None)), in_band(self.beside_emission(None))
        rings = GROUND_RINGS_DEG * (1 + self.horizon_deg / 90)
        depths = self.horizon_deg - elevation
        paths = [self.path_to_ground(max(self.horizon_deg - ring, -90.0)) for ring in rings]
        emitted, other = (
            between_rings(depths, rings, [in_band(light(path)) for path in paths])
            for light in (self.emitted_by_ground, self.beside_emission)
        )
        if self.sun_elevation_deg is not None:
            scattered = np.array([self._scattered(band, path) for path in paths]).T
            knots = np.log([between_rings(depths, rings, values) for values in scattered])
            from_sun = np.abs((azimuth + 180) % 360 - 180)
            place = np.interp(from_sun, GROUND_AZIMUTHS_DEG, np.arange(len(knots)))
            low = np.minimum(place.astype(int), len(knots) - 2)
            up, column = place - low, np.arange(elevation.size)
            other += np.exp((1 - up) * knots[low, column] + up * knots[low + 1, column])
        return emitted, other

    def _scattered(self, band, along):
        """In-band sunlight that the air along a ray scatters, at GROUND_AZIMUTHS_DEG."""
        sun = SunDirection(self.sun_elevation_deg, ACROSS_DEG)
        through = bands().transmittance(along.amounts + self.air.amounts_to_sun(along, sun))
        sources = self.air.scattering(along, sun, GROUND_AZIMUTHS_DEG)
        return band.integral(bands().wavelengths_um, np.einsum("ank,nk->ak", sources, through))


def surroundings(
    sky: str | float | None,
    ground: Ground | None = None,
    sun_elevation_deg: float | None = None,
    atmosphere: str = ATMOSPHERE,
    height_m: float | None = None,
    weather: Weather = Weather(),
    sun_file: str | None = None,
) -> Surroundings:
    """Sky and ground by their words.

    Parameters
    ----------
    sky
        "clear", "overcast", a temperature [K], a bundled sky or a file, as `skies.sky_of` takes it;
        None for none.
    ground
        The ground; None for none.
    sun_elevation_deg
        Elevation of the sun [degrees]; None by night.
    atmosphere, weather
        Model atmosphere and its weather.
    height_m
        Height of the viewer above the ground [m]. None if it is not known: the sky is then that at
        50 m, and no air is before the ground.
    sun_file
        CSV file of the sun's irradiance at the scene; None for that of the model atmosphere.

    Raises
    ------
    InputError
        If a word is unknown, or a number out of bounds.
    """
    air = clear_air(atmosphere, weather)
    if height_m is not None:
        check_height(height_m)
    above = None if sky is None else sky_of(sky, atmosphere, sun_elevation_deg, height_m, weather)
    if sun_file is not None:
        sunlight(sun_file)  # raises InputError for a file that cannot be used
    return Surroundings(above, ground, air, height_m, sun_elevation_deg, sun_file)

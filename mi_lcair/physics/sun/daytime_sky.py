"""Clear sky by night and by day: its own emission, and sunlight scattered once."""

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np
import scipy
from numpy.typing import ArrayLike

from mi_lcair.errors import InputError
from mi_lcair.physics.air.bands import bands
from mi_lcair.physics.air.clear_air import ClearAir, SunDirection, clear_air
from mi_lcair.physics.air.levels import HEIGHT_M, Weather
from mi_lcair.physics.air.light import AirLight
from mi_lcair.physics.bands import Band
from mi_lcair.physics.sky import air_mass, mean_nodes
from mi_lcair.physics.spectrum import Spectrum

SUN_ELEVATION_DEG = 45.0  # of a sky that states none
# Elevations above the horizon at which the sky is computed [degrees], for any height
RINGS_DEG = 0, 0.1, 0.22, 0.36, 0.55, 0.8, 1.15, 1.7, 2.5, 3.7, 5.5, 9, 14, 22, 34, 52, 72, 90
ANGLES_DEG = np.concatenate([np.arange(0, 20, 1.0), np.arange(20, 181, 4.0)])  # from the sun
MEAN_COLUMNS = 18  # azimuths for the mean over the sky
ABOVE_HORIZON_DEG = 1e-3  # elevation of the lowest ray above the horizon, lest it meet the ground
SMALLEST = 1e-30  # stands for a radiance of 0 in logarithms [W m^-2 sr^-1]


@dataclass(frozen=True)
class ClearSky:
    """A clear sky by night, or by day with the sun, seen from one height.

    Attributes
    ----------
    air
        Clear air.
    height_m
        Height of the viewer above the ground [m].
    sun_elevation_deg
        True elevation of the sun [degrees]; None by night.
    weather
        Weather of the air.
    """

    air: ClearAir
    height_m: float
    sun_elevation_deg: float | None = None
    weather: Weather = Weather()

    temperature = None  # it has not one temperature
    by_elevation = True

    @property
    def by_azimuth(self) -> bool:
        """Whether it depends on the azimuth, as by day."""
        return self.sun_elevation_deg is not None

    @property
    def name(self) -> str:
        """Name of the air."""
        return self.air.name

    @cached_property
    def horizon_deg(self) -> float:
        """Elevation of the horizon [degrees], 0 or less."""
        return self.air.horizon_deg(self.height_m)

    def at(self, elevation_deg: float, azimuth_deg: float = 0.0) -> AirLight:
        """The sky at an elevation and an azimuth from the sun [degrees], as light through air."""
        emitted, *scattered = self.components(elevation_deg, azimuth_deg)
        total = emitted.plus(*scattered) if scattered else emitted
        return replace(total, name=f"{self.name}_clear {elevation_deg:g} deg")

    def components(self, elevation_deg: float, azimuth_deg: float = 0.0) -> list[AirLight]:
        """What the air emits and, by day, the sunlight that it scatters, as in `at`."""
        emitted = self.air.sky(self.height_m, elevation_deg)
        if self.sun_elevation_deg is None:
            return [emitted]
        sun = SunDirection(self.sun_elevation_deg, azimuth_deg)
        along = self.air.ray(self.height_m, elevation_deg)
        return [emitted, self.air.scattered(along, sun)]

    def in_band_components(
        self, band: Band, elevation_deg: ArrayLike, azimuth_deg: ArrayLike = 0.0
    ) -> list[np.ndarray]:
        """In-band radiance of what the air emits and, by day, of the sunlight that it scatters.

        elevation_deg, azimuth_deg: elevation and azimuth from the sun [degrees], arrays of one
        shape. See `in_band_by_angle`.
        """
        elevation, azimuth = np.broadcast_arrays(
            np.asarray(elevation_deg, dtype=float), np.asarray(azimuth_deg, dtype=float)
        )
        is_night = self.sun_elevation_deg is None
        angle = azimuth if is_night else self.from_sun(elevation, azimuth)
        return self.in_band_by_angle(band, elevation, angle)

    def in_band_by_angle(
        self, band: Band, elevation_deg: np.ndarray, angle_deg: np.ndarray
    ) -> list[np.ndarray]:
        """In-band radiance of what the air emits and, by day, of the sunlight that it scatters.

        It is computed at RINGS_DEG. Between them the logarithms are interpolated over that of the
        air mass, see `between_rings`. There is no aureole of multiple scattering.

        Parameters
        ----------
        band
            Band within 3-5 um or 8-12 um.
        elevation_deg, angle_deg
            Elevation, and angle from the sun [degrees], arrays of one shape; the angle may be one
            that no direction at the elevation has.

        Raises InputError if the air is not known in the band.
        """
        what = f"clear sky '{self.name}'"
        band.check_covered(bands().wavelengths_um, what)
        rings = self.horizon_deg + np.array(RINGS_DEG) * (1 - self.horizon_deg / 90)
        rings[[0, -1]] = rings[0] + ABOVE_HORIZON_DEG, 90.0
        emitted, scattered = map(np.array, zip(*(self.ring(band, ring) for ring in rings)))
        above, rings = np.maximum(elevation_deg - self.horizon_deg, 0), rings - self.horizon_deg
        components = [between_rings(above, rings, emitted)]
        if self.sun_elevation_deg is not None:
            places = -np.log(air_mass(rings))
            logarithms = scipy.interpolate.RegularGridInterpolator(
                (places, ANGLES_DEG), np.log(np.maximum(scattered, SMALLEST))
            )
            at = np.clip(-np.log(air_mass(above)), places[0], places[-1])
            components.append(np.exp(logarithms((at, angle_deg))))
        return components

    def from_sun(self, elevation_deg: ArrayLike, azimuth_deg: ArrayLike) -> np.ndarray:
        """Angle between directions and the sun [degrees]."""
        h, s, azimuth = np.radians(elevation_deg), np.radians(self.sun_elevation_deg), azimuth_deg
        cosine = np.sin(h) * np.sin(s) + np.cos(h) * np.cos(s) * np.cos(np.radians(azimuth))
        return np.degrees(np.arccos(np.clip(cosine, -1, 1)))

    def ring(self, band: Band, elevation_deg: float) -> tuple[float, np.ndarray]:
        """In-band emission at an elevation, and light scattered by the angles ANGLES_DEG there.

        The angle from the sun is taken as the same along a ray, as it is without refraction, and
        the way to the sun as that at right angles to the ray's azimuth.
        """
        model = bands()
        weights = band.row_weights(model.wavelengths_um)
        along = self.air.ray(self.height_m, elevation_deg)
        emitted = float(self.air.emitted(along).radiance @ weights)
        scattered = np.zeros(len(ANGLES_DEG))
        if self.sun_elevation_deg is None:
            return emitted, scattered
        to_sun = self.air.amounts_to_sun(along, SunDirection(self.sun_elevation_deg, 90.0))
        through = model.transmittance(along.amounts + to_sun) * model.sun * weights
        for k, amount in enumerate(np.diff(along.amounts, axis=0).T):
            if amount.any() and model.scattering[k].any():
                light = amount @ (through[1:] + through[:-1]) / 2 * model.scattering[k]
                scattered += model.phase(k, ANGLES_DEG) @ light
        return emitted, scattered

    def scattered_by(self, elevation_deg: float, angle_deg: float) -> AirLight:
        """Sunlight that the air at an elevation would scatter from a sun at an angle from there.

        The way to the sun is that at right angles to the ray's azimuth, as in `ring`.
        """
        along = self.air.ray(self.height_m, elevation_deg)
        sources = self.air.scattering(along, SunDirection(elevation_deg + angle_deg), [0.0])[0]
        sun = SunDirection(self.sun_elevation_deg, 90.0)
        amounts = along.amounts + self.air.amounts_to_sun(along, sun)
        return AirLight.of(f"sunlight scattered by {angle_deg:g}", sources, amounts)

    def mean_spectrum(self) -> AirLight:
        """Mean radiance of the sky, weighted by the cosine to the zenith.

        It is the spectral irradiance of the sky on the ground, divided by pi.
        """
        azimuths = (np.arange(MEAN_COLUMNS) + 0.5) * 180 / MEAN_COLUMNS
        mean = None
        for elevation, weight in zip(*mean_nodes()):
            along = self.air.ray(self.height_m, elevation)
            part = self.air.emitted(along)
            if self.sun_elevation_deg is not None:
                sun = SunDirection(self.sun_elevation_deg, 90.0)
                sources = self.air.scattering(along, sun, azimuths).mean(axis=0)
                amounts = along.amounts + self.air.amounts_to_sun(along, sun)
                part = part.plus(AirLight.of("", sources, amounts))
            part = part.scaled(weight)
            mean = part if mean is None else mean.plus(part)
        return replace(mean, name=f"clear sky {self.name}")

    @cached_property
    def on_ground(self) -> list[tuple[float, Spectrum]]:
        """Radiance of the sky that white ground reflects, as spectra with factors that add up."""
        return [(1.0, _mean_spectrum(replace(self, height_m=0.0)))]


@lru_cache(maxsize=16)
def _mean_spectrum(sky: ClearSky) -> AirLight:
    """Mean radiance of a sky, computed once for all scenes under it."""
    return sky.mean_spectrum()


def between_rings(places: np.ndarray, rings: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Values between elevations; their logarithms are smooth over that of the air mass.

    places, rings: elevations above the horizon [degrees], any shape and rising (n,). values: at
    the rings, (n,).
    """
    at, of_rings = -np.log(air_mass(places)), -np.log(air_mass(rings))
    logarithms = scipy.interpolate.PchipInterpolator(of_rings, np.log(np.maximum(values, SMALLEST)))
    return np.exp(logarithms(np.clip(at, of_rings[0], of_rings[-1])))


def azimuth_from_sun(
    elevation_deg: np.ndarray, angle_deg: np.ndarray, sun_elevation_deg: float
) -> np.ndarray:
    """Azimuths from the sun of directions at an angle from it [degrees], or the closest ones."""
    h, s = np.radians(elevation_deg), np.radians(sun_elevation_deg)
    across = np.maximum(np.cos(h) * np.cos(s), SMALLEST)
    cosine = (np.cos(np.radians(angle_deg)) - np.sin(h) * np.sin(s)) / across
    return np.degrees(np.arccos(np.clip(cosine, -1, 1)))


def clear_sky(
    air: str,
    sun_elevation_deg: float | None = None,
    height_m: float = HEIGHT_M,
    weather: Weather = Weather(),
) -> ClearSky:
    """The sky of a clear air, by day with a sun at sun_elevation_deg [degrees].

    height_m: of the viewer above the ground [m]. Raises InputError for an unknown name, and for a
    sun below 1 degree.
    """
    if sun_elevation_deg is not None and not 1 <= sun_elevation_deg <= 90:
        raise InputError(
            f"clear sky '{air}': sun at {sun_elevation_deg:g} degrees; must lie in 1..90"
        )
    return ClearSky(clear_air(air, weather), height_m, sun_elevation_deg, weather)

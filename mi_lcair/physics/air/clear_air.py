"""What a sensor sees of clear air: paths, the sky, the sun, and sunlight that air scatters.

Accuracy against LOWTRAN7 is in docs/validation/air.md.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from mi_lcair.errors import InputError
from mi_lcair.physics.air.bands import bands
from mi_lcair.physics.air.levels import EARTH_KM, TOP_M, Levels, Weather, levels
from mi_lcair.physics.air.light import AirLight
from mi_lcair.physics.air.ray import NODES, WEIGHTS, Ray, ray, ray_end
from mi_lcair.physics.blackbody import spectral_radiance

LOWEST_SUN_DEG = 1.0  # elevation of a sun from which its light has been compared with LOWTRAN7


@dataclass(frozen=True)
class SunDirection:
    """Direction of the sun from a viewer.

    elevation_deg: its true elevation at the viewer [degrees]. azimuth_deg: azimuth of the ray from
    the sun's, 0 toward the sun [degrees].
    """

    elevation_deg: float
    azimuth_deg: float = 0.0


@dataclass(frozen=True, eq=False)
class ClearAir:
    """Clear air of one weather.

    Attributes
    ----------
    name
        Name of the model atmosphere.
    levels
        The air by height.
    """

    name: str
    levels: Levels

    def ray(self, height_m: float, elevation_deg: float, range_m: float = np.inf) -> Ray:
        """The ray from a viewer; it ends at the range [m], at the ground or at the air's top.

        Raises InputError for a height outside 0..100 km or an elevation outside -90..90 degrees.
        """
        check_height(height_m)
        if not -90 <= elevation_deg <= 90:
            raise InputError(f"air '{self.name}': elevation {elevation_deg:g}; must lie in -90..90")
        return ray(self.levels, height_m / 1000, elevation_deg, range_m / 1000)

    def end(
        self, height_m: float, elevation_deg: float, range_m: float
    ) -> tuple[float, float, float]:
        """Length [m], height [m] and elevation [degrees] at the end of a ray, see `ray`."""
        length, height, elevation = ray_end(
            self.levels, height_m / 1000, elevation_deg, range_m / 1000
        )
        return 1000 * length, 1000 * height, elevation

    def horizon_deg(self, height_m: float) -> float:
        """Elevation at which the ray from a height [m] touches the ground [degrees], 0 or less."""
        check_height(height_m)
        heights = np.array([0.0, height_m / 1000])
        index, _ = self.levels.refraction(heights)
        ground, viewer = (1 + index) * (EARTH_KM + heights)  # see `ray.Path`
        return -float(np.degrees(np.arccos(min(ground / viewer, 1.0))))

    def emitted(self, along: Ray, sun: SunDirection | None = None) -> AirLight:
        """Light that the air along a ray sends to the viewer.

        It is the air's emission and, with a sun, the sunlight that it scatters once.

        Returns
        -------
        AirLight
            [W m^-2 sr^-1 um^-1]
        """
        planck = spectral_radiance(bands().wavelengths_um, along.temperatures[:, None])
        edges = np.zeros((1, planck.shape[1]))
        sources = np.diff(np.vstack([edges, planck, edges]), axis=0)
        light = AirLight.of(f"clear air {self.name}", sources, along.amounts)
        return light if sun is None else light.plus(self.scattered(along, sun))

    def sky(
        self, height_m: float, elevation_deg: float, sun: SunDirection | None = None
    ) -> AirLight:
        """The clear sky from a height [m] at an apparent elevation [degrees]; by day with a sun.

        Raises InputError as `ray` does, and for a direction that meets the ground.
        """
        along = self.ray(height_m, elevation_deg)
        if along.heights_km[-1] < TOP_M / 2000:
            raise InputError(
                f"air '{self.name}': from {height_m:g} m at {elevation_deg:g} degrees the line of "
                "sight meets the ground, and no sky"
            )
        return self.emitted(along, sun)

    def sun(self, height_m: float, elevation_deg: float, distance_au: float = 1.0) -> AirLight:
        """Irradiance of the direct sun on a perpendicular plane [W m^-2 um^-1].

        elevation_deg: apparent elevation [degrees]. distance_au: distance in astronomical units.
        Raises InputError for a sun below LOWEST_SUN_DEG.
        """
        if elevation_deg is None or not LOWEST_SUN_DEG <= elevation_deg <= 90:
            raise InputError(
                f"air '{self.name}': solar elevation {elevation_deg} degrees must lie in "
                f"{LOWEST_SUN_DEG:g}..90"
            )
        amounts = self.ray(height_m, elevation_deg).amounts[-1:]
        source = bands().sun[None] / distance_au**2
        return AirLight.of(f"{self.name} {elevation_deg:g} deg", source, amounts)

    def scattered(self, along: Ray, sun: SunDirection) -> AirLight:
        """Sunlight that the air along a ray scatters once to the viewer."""
        (sources,) = self.scattering(along, sun, [sun.azimuth_deg])
        amounts = along.amounts + self.amounts_to_sun(along, sun)
        return AirLight.of("scattered sunlight", sources, amounts)

    def scattering(self, along: Ray, sun: SunDirection, azimuths_deg: ArrayLike) -> np.ndarray:
        """Sources of scattered light at the edges of a ray's layers, (azimuths, n + 1, k).

        A source is the sun's irradiance times the phase functions and scattering amounts. Half of a
        layer's is at each of its edges. azimuths_deg: azimuths of the ray from the sun's [degrees].
        """
        model = bands()
        elevation = along.elevations_deg - along.turned_deg  # in the axes of the viewer
        up = np.radians(sun.elevation_deg)
        elevation = np.radians((elevation[1:] + elevation[:-1]) / 2)
        across = np.cos(np.radians(azimuths_deg))[:, None]
        cosine = np.sin(elevation) * np.sin(up) + np.cos(elevation) * np.cos(up) * across
        angle = np.degrees(np.arccos(np.clip(cosine, -1, 1)))
        total = np.zeros((len(angle), len(elevation), len(model.wavelengths_um)))
        for k, amount in enumerate(np.diff(along.amounts, axis=0).T):
            layers = np.flatnonzero(amount)
            if model.scattering[k].any() and layers.size:
                per_amount = model.phase(k, angle[:, layers]) * model.scattering[k]
                total[:, layers] += per_amount * amount[layers, None]
        half = total * model.sun / 2
        sources = np.zeros((len(angle), len(elevation) + 1, len(model.wavelengths_um)))
        sources[:, :-1] += half
        sources[:, 1:] += half
        return sources

    def amounts_to_sun(self, along: Ray, sun: SunDirection) -> np.ndarray:
        """Amounts of the absorbers between the edges of a ray's layers and the sun, (n + 1, c).

        The way to the sun is straight. The sun's elevation turns along the ray with the horizon.
        """
        turned, up = np.radians(along.turned_deg), np.radians(sun.elevation_deg)
        across = np.cos(up) * np.cos(np.radians(sun.azimuth_deg))
        sine = np.maximum(np.sin(up) * np.cos(turned) + across * np.sin(turned), 0)
        knots, heights = self.levels.heights_km, along.heights_km
        radius = EARTH_KM + heights
        perigee = (radius * np.sqrt(1 - sine**2))[:, None]
        edges = EARTH_KM + np.maximum(knots, heights[:, None])
        chords = np.diff(np.sqrt(np.maximum(edges**2 - perigee**2, 0)), axis=1)
        whole = np.einsum("nl,lc->nc", chords * (knots[:-1] >= heights[:, None]), self.means(knots))
        # The interval of levels that holds the edge counts from the edge upward
        holds = np.clip(np.searchsorted(knots, heights, side="right") - 1, 0, len(knots) - 2)
        part = knots[holds] < heights
        first = self.means_between(heights, knots[holds + 1])
        return whole + (part * chords[np.arange(len(heights)), holds])[:, None] * first

    def means(self, knots: np.ndarray) -> np.ndarray:
        """Mean densities between neighbouring heights [km]."""
        return self.means_between(knots[:-1], knots[1:])

    def means_between(self, lower_km: np.ndarray, upper_km: np.ndarray) -> np.ndarray:
        """Mean densities between pairs of heights [km], (n, c)."""
        heights = lower_km[:, None] + (upper_km - lower_km)[:, None] * NODES
        return np.einsum("ngc,g->nc", self.levels.at(heights)[0], WEIGHTS)


def check_height(height_m: float) -> None:
    """Raise InputError for a height [m] below the ground or above the air."""
    if not 0 <= height_m <= TOP_M:
        raise InputError(f"height {height_m:g} m; must lie in 0..{TOP_M:g} m above the ground")


@lru_cache(maxsize=16)
def clear_air(name: str, weather: Weather = Weather()) -> ClearAir:
    """The clear air of a model atmosphere, `us_standard` or `midlat_summer`, in some weather.

    Raises InputError for an unknown name.
    """
    return ClearAir(name, levels(name, weather))

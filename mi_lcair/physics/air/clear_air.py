"""What a sensor sees of clear air: paths, the sky, the sun, and sunlight that air scatters.

Accuracy against LOWTRAN7 is in docs/validation/air.md.
"""

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
import scipy
from numpy.typing import ArrayLike

from mi_lcair.declared import Bounds
from mi_lcair.errors import InputError
from mi_lcair.physics.air.atmosphere import (
    LIGHT_RANGES,
    PAST_GROUND,
    AirLight,
    Atmosphere,
    LineOfSight,
)
from mi_lcair.physics.air.levels import EARTH_KM, TOP_M, Levels, Weather, bands, levels
from mi_lcair.physics.bands import Spectrum
from mi_lcair.physics.blackbody import spectral_radiance

# Rays through the air, bent by refraction, over a round Earth; layers along them
# -------------------------------------------------------------------------------
# Along a ray n (R + h) cos(elevation) is constant (Bouguer), with the refractive index n at the
# height h. With u = n (R + h) this is u^2 = p^2 + x^2, where x = u sin(elevation) rises along the
# ray from negative values before its lowest point to positive ones after it. The length follows
# from ds = dx / (du/dh), which is smooth at the lowest point, too.

FIRST_KM, GROWTH = 0.005, 0.2  # length of the first layer, and of the others per distance
THICKEST_KM, THICKEST_HIGH_KM, HIGH_KM = 0.5, 2.0, 30.0  # vertical extent of a layer; above HIGH_KM
SAMPLES = 400  # places along a ray from which its layers are chosen
TOP_KM = 100.0
# Nodes and weights over 0..1, in a layer for its amounts, and over a whole ray for its length
(NODES, WEIGHTS), (LONG_NODES, LONG_WEIGHTS) = (
    ((1 + nodes) / 2, weights / 2)
    for nodes, weights in map(np.polynomial.legendre.leggauss, (3, 32))
)


@dataclass(frozen=True, eq=False)
class Ray:
    """A ray from a viewer, in layers that grow with the distance from the viewer.

    Attributes
    ----------
    lengths_km
        Distances of the layers' edges along the ray [km], (n + 1,), from 0.
    heights_km, elevations_deg
        Height above the ground [km] and elevation of the ray [degrees] at the edges, (n + 1,).
    turned_deg
        Angle at the Earth's centre between the viewer and each edge [degrees], (n + 1,).
    temperatures
        Mean temperature of each layer by mass [K], (n,).
    amounts
        Amounts of the absorbers from the viewer to each edge, (n + 1, c).
    """

    lengths_km: np.ndarray
    heights_km: np.ndarray
    elevations_deg: np.ndarray
    turned_deg: np.ndarray
    temperatures: np.ndarray
    amounts: np.ndarray


def ray(levels: Levels, height_km: float, elevation_deg: float, length_km: float = np.inf) -> Ray:
    """The ray from a height in a direction, up to a length, the ground or the top of the air.

    Parameters
    ----------
    levels
        The air.
    height_km
        Height of the viewer [km], 0..100.
    elevation_deg
        Apparent elevation at the viewer [degrees], -90..90.
    length_km
        Length of the ray [km]. The ray ends before if it meets the ground or leaves the air.
    """
    path = Path(levels, height_km, elevation_deg)
    edges = path.edges(length_km)
    starts, steps = edges[:-1], np.diff(edges)
    x = starts[:, None] + steps[:, None] * NODES
    heights, per_x = path.at(x)
    densities, temperature, pressure = levels.at(heights)
    lengths = steps[:, None] * WEIGHTS * per_x
    amounts = np.einsum("ng,ngc->nc", lengths, densities)
    mass = lengths * pressure / temperature
    at_edges, _ = path.at(edges)
    u = np.hypot(path.perigee, edges)
    # d(angle) = cos(elevation) ds / (R + h)
    turned = (lengths * path.perigee / np.hypot(path.perigee, x) / (EARTH_KM + heights)).sum(axis=1)
    return Ray(
        np.append(0, np.cumsum(lengths.sum(axis=1))),
        at_edges,
        np.degrees(np.arcsin(np.clip(edges / u, -1, 1))),
        np.degrees(np.append(0, np.cumsum(turned))),
        (mass * temperature).sum(axis=1) / mass.sum(axis=1),
        np.vstack([np.zeros(amounts.shape[1]), np.cumsum(amounts, axis=0)]),
    )


def ray_end(
    levels: Levels, height_km: float, elevation_deg: float, length_km: float
) -> tuple[float, float, float]:
    """Length [km], height [km] and elevation [degrees] at the end of a ray, see `ray`."""
    path = Path(levels, height_km, elevation_deg)
    x = max(min(path.end(), path.place(length_km)), path.start)
    (height,), _ = path.at(np.array([x]))
    elevation = np.degrees(np.arctan2(x, path.perigee))
    return path.length(x)[0], min(float(height), TOP_KM), float(elevation)


class Path:
    """The way of a ray in its coordinate x, see the module."""

    def __init__(self, levels: Levels, height_km: float, elevation_deg: float):
        self.levels, self.start_km = levels, height_km
        index, _ = levels.refraction(np.array(height_km))
        u = (1 + float(index)) * (EARTH_KM + height_km)
        elevation = np.radians(elevation_deg)
        self.perigee, self.start = u * np.cos(elevation), u * np.sin(elevation)

    def at(self, x) -> tuple[np.ndarray, np.ndarray]:
        """Heights [km] at coordinates x [km], and lengths along the ray per x."""
        u = np.hypot(self.perigee, x)
        heights = u - EARTH_KM
        # u (h) is inverted by Newton's method; refraction lowers the first guess by 2 km at most
        for _ in range(3):
            index, slope = self.levels.refraction(np.clip(heights, 0, TOP_KM))
            per_height = 1 + index + (EARTH_KM + heights) * slope
            heights = heights - ((1 + index) * (EARTH_KM + heights) - u) / per_height
        return np.maximum(heights, 0), 1 / per_height

    def edges(self, length_km: float) -> np.ndarray:
        """Coordinates of the layers' edges [km], (n + 1,), for a ray of at most a length [km]."""
        end = self.end()
        if np.isfinite(length_km):
            end = min(end, self.place(length_km))
        if end <= self.start:
            return np.array([self.start, self.start])
        # Sampling that is fine near the viewer
        share = np.linspace(0, 1, SAMPLES)
        near = FIRST_KM * np.expm1(share * np.log1p((end - self.start) / FIRST_KM))
        x = self.start + np.sort(np.concatenate([near, (end - self.start) * share[1:-1]]))
        heights, per_x = self.at(x)
        thickest = np.where(heights[1:] > HIGH_KM, THICKEST_HIGH_KM, THICKEST_KM)
        distance = np.maximum(x[1:] - self.start, 0)
        layers = np.log1p(GROWTH * distance / FIRST_KM) / np.log1p(GROWTH)
        layers = layers + np.cumsum(np.abs(np.diff(heights)) / thickest)
        layers = np.append(0, layers)
        count = max(int(np.ceil(layers[-1])), 1)
        return np.interp(np.linspace(0, layers[-1], count + 1), layers, x)

    def place(self, length_km: float) -> float:
        """Coordinate x [km] at a length from the viewer."""
        x = self.start + length_km
        for _ in range(3):  # Newton's method; x rises by 0.8..1 per length
            length, per_x = self.length(x)
            x -= (length - length_km) / per_x
        return x

    def length(self, x: float) -> tuple[float, float]:
        """Length from the viewer to the coordinate x [km], and its derivative."""
        _, per_x = self.at(self.start + (x - self.start) * np.append(LONG_NODES, 1.0))
        return float(per_x[:-1] @ LONG_WEIGHTS) * (x - self.start), float(per_x[-1])

    def end(self) -> float:
        """Coordinate at which the ray meets the ground or leaves the air [km]."""
        index, _ = self.levels.refraction(np.array([0.0, TOP_KM]))
        ground, top = (1 + index) * (EARTH_KM + np.array([0.0, TOP_KM]))
        if self.start < 0 and self.perigee < ground:
            return -np.sqrt((ground - self.perigee) * (ground + self.perigee))
        return np.sqrt(max((top - self.perigee) * (top + self.perigee), 0))


# Elevations of a sun of which the light has been compared with LOWTRAN7
ELEVATION = Bounds(lower=1, upper=90, unit="degrees")
HEIGHT = Bounds(lower=0, upper=TOP_M, unit="m")


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
        HEIGHT.check(height_m, "height above the ground")
        Bounds(lower=-90, upper=90).check(elevation_deg, f"air '{self.name}': elevation")
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
        HEIGHT.check(height_m, "height above the ground")
        heights = np.array([0.0, height_m / 1000])
        index, _ = self.levels.refraction(heights)
        ground, viewer = (1 + index) * (EARTH_KM + heights)  # see `Path`
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
                f"air '{self.name}': from {height_m:g} m at {elevation_deg:g} degrees the line "
                "of sight ends at the ground, not in the sky"
            )
        return self.emitted(along, sun)

    def sun(self, height_m: float, elevation_deg: float, distance_au: float = 1.0) -> AirLight:
        """Irradiance of the direct sun on a perpendicular plane [W m^-2 um^-1].

        elevation_deg: apparent elevation [degrees]. distance_au: distance in astronomical units.
        Raises InputError for a sun outside ELEVATION.
        """
        elevation_deg = np.nan if elevation_deg is None else elevation_deg
        ELEVATION.check(elevation_deg, f"air '{self.name}': elevation of the sun")
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


@lru_cache(maxsize=16)
def clear_air(name: str, weather: Weather = Weather()) -> ClearAir:
    """The clear air of a model atmosphere, `us_standard` or `midlat_summer`, in some weather.

    Raises InputError for an unknown name.
    """
    return ClearAir(name, levels(name, weather))


# Clear air along one line of sight, over the range from target to sensor
# -----------------------------------------------------------------------

NEAREST_M, LONGEST_M = 10.0, 200_000.0  # first and last range that is computed
GROUND_KM = 1e-3  # height of a ray's end that counts as the ground
RANGES = 48  # ranges between which the air is interpolated
LEAST_DEPTH = 1e-12  # optical depth that stands for 0 in logarithms


@dataclass(frozen=True, eq=False)
class ClearPaths(Atmosphere):
    """Clear air between target and sensor along one line of sight.

    The lower one of the two stays where it is, and the other one moves with the range. Between
    computed ranges the mean densities of absorbers and the source function are interpolated over
    the logarithm of range. The path radiance is (1 - transmittance) times the source function. At
    `stated_m` the path is computed itself.

    Attributes
    ----------
    name
        Name of the air.
    air
        The air.
    lower_m
        Height of the lower end above the ground [m].
    elevation_deg
        Elevation of the line of sight at its lower end, 0..90 [degrees].
    looks_up
        Whether the sensor is at the lower end.
    stated_m
        Range that is computed without interpolation [m]; None for none.
    sun
        Sun whose light the air scatters, with the azimuth of the line from the sensor; None for
        night.
    """

    name: str
    air: ClearAir
    lower_m: float
    elevation_deg: float
    looks_up: bool
    stated_m: float | None = None
    sun: SunDirection | None = None

    @property
    def wavelengths_um(self) -> np.ndarray:
        """Rising wavelengths [um], (k,)."""
        return bands().wavelengths_um

    @cached_property
    def ranges_m(self) -> np.ndarray:
        """Rising ranges [m] at which the path radiance is computed."""
        return self._with_stated(RANGES)

    def _with_stated(self, count: int) -> np.ndarray:
        """Rising ranges [m], among them the stated one."""
        stated = [] if self.stated_m is None or self.stated_m > LONGEST_M else [self.stated_m]
        return np.union1d(np.geomspace(NEAREST_M, LONGEST_M, count), stated)

    def path(self, range_m: float, extrapolate: bool = False) -> LineOfSight:
        (range_m,) = self._checked([range_m], extrapolate)
        return self._line(float(range_m), False)

    def to_ground(self, range_m: float) -> LineOfSight:
        """The path from the sensor past a target at a range [m] to the ground.

        Between the computed ranges of the target it is interpolated, as `path` is. Raises
        InputError if the line of sight goes past the ground.
        """
        return self._line(range_m, True)

    def _line(self, range_m: float, to_ground: bool) -> LineOfSight:
        shares = None
        if range_m == self.stated_m or range_m > LONGEST_M:
            length, amounts, radiance = self._computed(range_m, to_ground)
        else:
            (length,), (amounts,), (source,) = self._between(np.array([range_m]), to_ground)
            radiance = -np.expm1(-bands().depth(amounts)) * source

            def shares(light: AirLight) -> np.ndarray:
                return self._share(light, np.array([range_m]), to_ground)[0]

        transmittance = bands().transmittance(amounts)
        x = self.wavelengths_um
        return LineOfSight(float(length), x, transmittance, radiance, amounts, shares)

    def along(self, ranges_m, rows):
        _, amounts, source = self._between(ranges_m, False)
        transmittance = bands().transmittance(amounts)[:, rows]
        return transmittance, (1 - transmittance) * source[:, rows]

    def light_transmittance(self, light: Spectrum, ranges_m, rows):
        if not isinstance(light, AirLight):
            return super().light_transmittance(light, ranges_m, rows)
        return self._share(light, ranges_m, False)[:, rows]

    def ray(self, range_m: float, to_ground: bool = False) -> Ray:
        """The ray from the sensor to the target, and from there no further, or to the ground."""
        if self.looks_up and not to_ground:
            return self.air.ray(self.lower_m, self.elevation_deg, range_m)
        length, height, elevation = self.air.end(self.lower_m, self.elevation_deg, range_m)
        along = self.air.ray(height, -elevation, np.inf if to_ground else length)
        if to_ground and (self.looks_up or along.heights_km[-1] > GROUND_KM):
            raise InputError(PAST_GROUND)
        return along

    @cached_property
    def _kept(self) -> dict:
        """What was computed before, by its arguments. A search asks again and again."""
        return {}

    def _computed(self, range_m: float, to_ground: bool) -> tuple[float, np.ndarray, np.ndarray]:
        """Length [m], amounts (c,) and radiance (k,) of a path."""
        if (range_m, to_ground) not in self._kept:
            along = self.ray(range_m, to_ground)
            length = 1000 * along.lengths_km[-1] if to_ground else range_m
            radiance = self.air.emitted(along, self.sun).radiance
            self._kept[range_m, to_ground] = length, along.amounts[-1], radiance
        return self._kept[range_m, to_ground]

    def _between(self, ranges_m: np.ndarray, to_ground: bool) -> tuple[np.ndarray, ...]:
        """Lengths [m], amounts (r, c) and source functions (r, k) of paths, interpolated."""
        if to_ground not in self._kept:
            paths = [self._computed(range_m, to_ground) for range_m in self.ranges_m]
            lengths, amounts, radiance = (np.array(values) for values in zip(*paths))
            source = radiance / np.maximum(-np.expm1(-bands().depth(amounts)), 1e-300)
            rows = np.column_stack(
                [lengths - self.ranges_m, amounts / np.array(lengths)[:, None], source]
            )
            self._kept[to_ground] = scipy.interpolate.PchipInterpolator(np.log(self.ranges_m), rows)
        rows = self._kept[to_ground](np.log(np.clip(ranges_m, NEAREST_M, LONGEST_M)))
        lengths, count = ranges_m + rows[:, 0], 1 + len(bands().columns)
        return lengths, rows[:, 1:count] * lengths[:, None], rows[:, count:]

    def _share(self, light: AirLight, ranges_m: np.ndarray, to_ground: bool) -> np.ndarray:
        """Transmittance for light that has crossed air, (r, k), between LIGHT_RANGES."""
        if (light, to_ground) not in self._kept:
            at = self._with_stated(LIGHT_RANGES)
            table = [light.transmittance(amounts) for amounts in self._between(at, to_ground)[1]]
            depths = -np.log(np.clip(table, 1e-300, 1 - LEAST_DEPTH))
            values = scipy.interpolate.PchipInterpolator(np.log(at), np.log(depths))
            self._kept[light, to_ground] = values
        at = np.clip(ranges_m, NEAREST_M, LONGEST_M)
        depths = np.exp(self._kept[light, to_ground](np.log(at)))
        return np.exp(-depths * np.minimum(ranges_m / at, 1)[:, None])

"""Clear air along one line of sight, over the range from target to sensor."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy

from mi_lcair.errors import InputError
from mi_lcair.physics.air.atmosphere import LIGHT_RANGES, PAST_GROUND, Atmosphere, LineOfSight
from mi_lcair.physics.air.bands import bands
from mi_lcair.physics.air.clear_air import ClearAir, SunDirection
from mi_lcair.physics.air.light import AirLight
from mi_lcair.physics.spectrum import Spectrum

NEAREST_M, LONGEST_M = 10.0, 200_000.0  # first and last range that is computed
SAME_RANGE = 1e-3  # relative difference of two ranges of which one is enough
GROUND_KM = 1e-3  # height of a ray's end that counts as the ground
RANGES = 48  # ranges between which the air is interpolated
LEAST_DEPTH = 1e-12  # optical depth that stands for 0 in logarithms


@dataclass(frozen=True, eq=False)
class ClearPaths(Atmosphere):
    """Clear air between target and sensor along one line of sight.

    The lower one of the two stays where it is, and the other one moves with the range. Between
    computed ranges the amounts of absorbers are powers of range, and the path radiance is
    (1 - transmittance) times a source function that is interpolated over the logarithm of range. At
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
        stated = [] if self.stated_m is None or self.stated_m > LONGEST_M else [self.stated_m]
        return np.union1d(np.geomspace(NEAREST_M, LONGEST_M, RANGES), stated)

    def path(self, range_m: float, extrapolate: bool = False) -> LineOfSight:
        (range_m,) = self._checked([range_m], extrapolate)
        shares = None
        if range_m == self.stated_m:
            amounts, radiance = self._stated
        elif range_m > LONGEST_M:
            amounts, radiance = self._computed(range_m)
        else:
            (amounts,) = self.amounts(np.array([range_m]))
            (radiance,) = self.along(np.array([range_m]), slice(None))[1]
            shares = self._shares(self.amounts, range_m)
        transmittance = bands().transmittance(amounts)
        x = self.wavelengths_um
        return LineOfSight(float(range_m), x, transmittance, radiance, amounts, shares)

    def _shares(self, amounts_at: Callable, range_m: float) -> Callable | None:
        """Function of a light that gives its transmittance at a range [m], between LIGHT_RANGES.

        amounts_at: function of ranges [m] that gives the amounts. A search over many ranges asks
        for the same light again and again, which may have hundreds of sources.
        """
        if range_m < NEAREST_M:
            return None

        def shares(light: AirLight) -> np.ndarray:
            key = amounts_at.__name__, light
            if key not in self._lights:
                at = np.geomspace(NEAREST_M, LONGEST_M, LIGHT_RANGES)
                table = [light.transmittance(amounts) for amounts in amounts_at(at)]
                depths = -np.log(np.clip(table, 1e-300, 1 - LEAST_DEPTH))
                self._lights[key] = scipy.interpolate.PchipInterpolator(np.log(at), np.log(depths))
            return np.exp(-np.exp(self._lights[key](np.log(range_m))))

        return shares

    @cached_property
    def _lights(self) -> dict:
        """Logarithms of optical depths for lights, over that of range."""
        return {}

    def along(self, ranges_m, rows):
        transmittance = bands().transmittance(self.amounts(ranges_m))[:, rows]
        within = np.log(np.maximum(ranges_m, self.ranges_m[0]))
        return transmittance, (1 - transmittance) * self._source(within)[:, rows]

    def light_transmittance(self, light: Spectrum, ranges_m, rows):
        if not isinstance(light, AirLight):
            return super().light_transmittance(light, ranges_m, rows)
        at, place = np.unique(ranges_m, return_inverse=True)
        is_few = len(at) <= LIGHT_RANGES
        if not is_few:
            at = np.geomspace(at[0], at[-1], LIGHT_RANGES)
        shares = np.array([light.transmittance(amounts) for amounts in self.amounts(at)])[:, rows]
        if is_few:
            return shares[place]
        depths = np.log(np.maximum(-np.log(np.maximum(shares, 1e-300)), LEAST_DEPTH))
        place = np.interp(np.log(ranges_m), np.log(at), np.arange(len(at)))
        low = np.minimum(place.astype(int), len(at) - 2)
        share = (place - low)[:, None]
        return np.exp(-np.exp((1 - share) * depths[low] + share * depths[low + 1]))

    def amounts(self, ranges_m: np.ndarray) -> np.ndarray:
        """Amounts of the absorbers along paths of some lengths [m], (r, c)."""
        lengths, amounts = self._way
        place = np.interp(np.log(ranges_m), np.log(lengths), np.arange(len(lengths)))
        low = np.minimum(place.astype(int), len(lengths) - 2)
        share = (place - low)[:, None]
        logarithms = np.log(np.maximum(amounts, 1e-300))
        values = np.exp((1 - share) * logarithms[low] + share * logarithms[low + 1])
        # Below the first length the amounts are proportional to the range
        return values * np.minimum(ranges_m / lengths[0], 1)[:, None]

    def ray(self, range_m: float):
        """The ray from the sensor to the target, and from there no further."""
        if self.looks_up:
            return self.air.ray(self.lower_m, self.elevation_deg, range_m)
        length, height, elevation = self.air.end(self.lower_m, self.elevation_deg, range_m)
        return self.air.ray(height, -elevation, length)

    def to_ground(self, range_m: float) -> LineOfSight:
        """The path from the sensor past a target at a range [m] to the ground.

        Between the computed ranges of the target it is interpolated, as `path` is. Raises
        InputError if the line of sight goes past the ground.
        """
        shares = None
        if range_m == self.stated_m:
            length, amounts, radiance = self._stated_to_ground
        elif range_m > LONGEST_M:
            length, amounts, radiance = self._to_ground(range_m)
        else:
            shares = self._shares(self.ground_amounts, range_m)
            place = np.log(max(range_m, self.ranges_m[0]))
            length, amounts, source = (np.exp(values(place)) for values in self._grounds)
            radiance = -np.expm1(-bands().depth(amounts)) * source
        transmittance = bands().transmittance(amounts)
        x = self.wavelengths_um
        return LineOfSight(float(length), x, transmittance, radiance, amounts, shares)

    def ground_amounts(self, ranges_m: np.ndarray) -> np.ndarray:
        """Amounts of the absorbers from the sensor to the ground, for ranges of a target [m]."""
        return np.exp(self._grounds[1](np.log(ranges_m)))

    def _to_ground(self, range_m: float) -> tuple[float, np.ndarray, np.ndarray]:
        """Length [m], amounts (c,) and radiance (k,) of the path to the ground."""
        _, height, elevation = self.air.end(self.lower_m, self.elevation_deg, range_m)
        along = self.air.ray(height, -elevation)
        if self.looks_up or along.heights_km[-1] > GROUND_KM:
            raise InputError(PAST_GROUND)
        radiance = self.air.emitted(along, self.sun).radiance
        return 1000 * along.lengths_km[-1], along.amounts[-1], radiance

    @cached_property
    def _grounds(self):
        """Logarithms of what `_to_ground` gives over that of range, the radiance as its source."""
        paths = [self._to_ground(range_m) for range_m in self.ranges_m]
        lengths, amounts, radiance = (np.array(values) for values in zip(*paths))
        source = radiance / np.maximum(-np.expm1(-bands().depth(amounts)), 1e-300)
        return [
            scipy.interpolate.PchipInterpolator(
                np.log(self.ranges_m), np.log(np.maximum(values, 1e-300))
            )
            for values in (lengths, amounts, source)
        ]

    def _computed(self, range_m: float) -> tuple[np.ndarray, np.ndarray]:
        """Amounts (c,) and path radiance (k,) at a range [m]."""
        along = self.ray(range_m)
        return along.amounts[-1], self.air.emitted(along, self.sun).radiance

    @cached_property
    def _stated(self):
        return self._computed(self.stated_m)

    @cached_property
    def _stated_to_ground(self):
        return self._to_ground(self.stated_m)

    @cached_property
    def _way(self):
        """Lengths from the lower end upward [m], (n,), and the amounts up to there, (n, c)."""
        up = self.air.ray(self.lower_m, self.elevation_deg, LONGEST_M)
        lengths, amounts = 1000 * up.lengths_km[1:], up.amounts[1:]
        if self.stated_m is not None:  # met as it is
            other = abs(lengths / self.stated_m - 1) > SAME_RANGE
            lengths, amounts = lengths[other], amounts[other]
            place = np.searchsorted(lengths, self.stated_m)
            lengths = np.insert(lengths, place, self.stated_m)
            amounts = np.insert(amounts, place, self._stated[0], axis=0)
        return lengths, amounts

    @cached_property
    def _source(self):
        """Path radiance / (1 - transmittance) as a function of the logarithm of range."""
        pairs = [
            self._stated if range_m == self.stated_m else self._computed(range_m)
            for range_m in self.ranges_m
        ]
        amounts, radiance = (np.array(values) for values in zip(*pairs))
        emissivity = -np.expm1(-bands().depth(amounts))
        source = radiance / np.maximum(emissivity, 1e-300)
        return scipy.interpolate.PchipInterpolator(np.log(self.ranges_m), source)

"""Clear air along one line of sight, over the range from target to sensor."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy

from mi_lcair.errors import InputError
from mi_lcair.physics.air.atmosphere import LIGHT_RANGES, PAST_GROUND, Atmosphere, LineOfSight
from mi_lcair.physics.air.bands import bands
from mi_lcair.physics.air.clear_air import ClearAir, SunDirection
from mi_lcair.physics.air.light import AirLight
from mi_lcair.physics.air.ray import Ray
from mi_lcair.physics.spectrum import Spectrum

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

"""Air along slant paths: transmittance and path radiance by elevation and range.

A table holds paths that begin at one height near the ground. Its transmittance T is the same in
both directions. Its path radiance is seen from below, looking up, or from above, looking down.
`SlantAir.along` gives the air along one line of sight as an `Atmosphere`, a table over range.

Between the table's elevations and ranges, and below its first range, a model carries the shape:
absorbers whose density falls with height (`mi_lcair.physics.slant.absorbers`), fitted to the table
at each wavelength, and air that emits at the temperature of its height. The ratio of the table's
optical depth -ln T to the model's, and that of its source function L / (1 - T) to the model's, are
interpolated: the first in its logarithm, both linearly in the logarithm of range and in the root of
the sine of the elevation. At its entries the table is met exactly. Below the first range the ratios
stay, and the optical depth goes to 0 with the model's amounts. A row that is left out of the
bundled tables is predicted within 0.7 % of its in-band transmittance and 1.7 % of its path radiance
(docs/validation/slant.md).

A path that begins above the table's lower end follows from the same model, with the ratios of the
path from the lower end through it to its upper end. The page compares some of these paths, too.
"""

import os
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path

import numpy as np

from mi_lcair.errors import InputError, unknown
from mi_lcair.files import revision
from mi_lcair.physics.atmosphere import (
    CLEAR,
    RANGE,
    SMALLEST_EMISSIVITY,
    TRANSMITTANCE,
    Atmosphere,
    plausible,
)
from mi_lcair.physics.blackbody import C1, C2, spectral_radiance
from mi_lcair.physics.slant.absorbers import Absorbers
from mi_lcair.physics.slant.geometry import height_along
from mi_lcair.physics.spectral_table import LONGEST_UM, SHORTEST_UM, WAVELENGTH
from mi_lcair.physics.spectrum import BUNDLED, ELEVATION, Spectrum
from mi_lcair.table import LARGEST, read_table

PREFIX = "slant_"
UP, DOWN = "path_radiance_up_W_m2_sr_um", "path_radiance_down_W_m2_sr_um"
LOWER_END_M = 50.0  # height at which the paths of a CSV begin
OPAQUE = 1e-12  # transmittance below which the bundled tables print 0
DARK = 1e-3  # transmittance below which rounding hides what lies behind a path
NEAREST_M = 20.0  # shortest range of the air along a line of sight
RANGES = 64  # ranges of the air along a line of sight, besides the table's
COLDEST_K, WARMEST_K = 100.0, 400.0  # limits of the temperatures of air that a table shows


@dataclass(frozen=True, eq=False)
class SlantAir:
    """A table of transmittance and path radiance over elevation, range and wavelength.

    Attributes
    ----------
    name
        Name or path with which the table was read.
    lower_m
        Height at which all paths begin [m].
    elevations_deg
        Rising elevations of the paths at their lower end, 0..90 degrees, (e,).
    ranges_m
        Rising lengths of the paths [m], (r,).
    wavelengths_um
        Rising wavelengths [um], (k,).
    transmittance
        Transmittance, 0..1, (e, r, k).
    up, down
        Path radiance seen from the lower end and from the upper end [W m^-2 sr^-1 um^-1],
        (e, r, k).
    """

    name: str
    lower_m: float
    elevations_deg: np.ndarray
    ranges_m: np.ndarray
    wavelengths_um: np.ndarray
    transmittance: np.ndarray
    up: np.ndarray
    down: np.ndarray

    def along(self, elevation_deg: float, looks_up: bool, start_m: float = 0.0) -> Atmosphere:
        """The air along a line of sight, over the range from one of its ends.

        Parameters
        ----------
        elevation_deg
            Elevation at the table's height `lower_m` [degrees]. For a line that begins higher it is
            that of the line's extension downward.
        looks_up
            Whether the sensor is at the lower end and looks up. Otherwise it is at the upper end.
        start_m
            Length along the line from the height `lower_m` to the line's lower end [m], from which
            the ranges are counted.

        Returns
        -------
        Atmosphere
            Its ranges end where the table's longest path ends.

        Raises
        ------
        InputError
            If the elevation or the start is outside the table.
        """
        first, last = self.elevations_deg[[0, -1]]
        # A line that is computed from heights may miss the table's first elevation by rounding.
        if not first - 1e-9 <= elevation_deg <= last + 1e-9:
            raise InputError(
                f"atmosphere '{self.name}': the line of sight's elevation of {elevation_deg:.4g} "
                f"degrees at {self.lower_m:g} m is outside its {first:g}-{last:g} degrees; choose "
                "one within, or a table of horizontal paths for a lower one"
            )
        end = self.ranges_m[-1]
        if not 0 <= start_m < end - NEAREST_M:
            raise InputError(
                f"atmosphere '{self.name}': the path begins {start_m:.6g} m along the line of "
                f"sight from {self.lower_m:g} m, where its last range is {end:g} m; choose lower "
                "heights"
            )
        of_table = self.ranges_m[self.ranges_m > start_m + NEAREST_M]
        between = start_m + np.geomspace(NEAREST_M, end - start_m, RANGES)
        apart = abs(between[:, None] - of_table).min(axis=1) > NEAREST_M / 2
        ends = np.sort(np.concatenate([of_table, between[apart]]))
        depths = self._model.depths(elevation_deg, start_m, ends)
        depths = depths * np.exp(self._interpolated(self._ratios[0], elevation_deg, ends))
        ratios = self._interpolated(self._ratios[1 if looks_up else 2], elevation_deg, ends)
        source = ratios * self._model.source(elevation_deg, start_m, ends, looks_up, self._emitted)
        transmittance = np.exp(-depths)
        return Atmosphere(
            f"{self.name} at {elevation_deg:.4g} degrees, looking {'up' if looks_up else 'down'}",
            ends - start_m,
            self.wavelengths_um,
            transmittance,
            -np.expm1(-depths) * source,
        )

    def sky_above(self, sky: Spectrum, elevation_deg: float, start_m: float) -> Spectrum:
        """A sky as it is seen from higher up the line of sight than the table's lower end.

        The air below is taken out: what is left of the sky's radiance beyond the table's longest
        path is seen through the shorter rest of that path. Where that path lets nearly nothing
        through, it is at most a blackbody at the temperature of the air there.

        Parameters
        ----------
        sky
            Sky at the height `lower_m`, in air of this kind without clouds below the sensor.
        elevation_deg, start_m
            As for `along`.
        """
        end = self.ranges_m[-1]
        x = self.wavelengths_um
        whole = self.along(elevation_deg, True).path(end)
        rest_air = self.along(elevation_deg, True, start_m)
        rest = rest_air.path(rest_air.ranges_m[-1])
        through = np.maximum(sky.at(x) - whole.radiance, 0)
        most = self._emitted(height_along(self.lower_m, elevation_deg, end))
        beyond = through / np.maximum(whole.transmittance, 1e-300)
        beyond = np.where(whole.transmittance > DARK, beyond, np.minimum(beyond, most))
        name = f"{sky.name}, from {height_along(self.lower_m, elevation_deg, start_m):.4g} m"
        return Spectrum(name, x, rest.radiance + rest.transmittance * beyond)

    @cached_property
    def _paths(self):
        """Elevations [degrees] and lengths [m] of the table's entries, (e, r) each."""
        return np.meshgrid(self.elevations_deg, self.ranges_m, indexing="ij")

    @cached_property
    def _depths(self) -> np.ndarray:
        """Optical depths, (e, r, k). Those of opaque entries are lower bounds."""
        return -np.log(np.clip(self.transmittance, OPAQUE, 1 - CLEAR))

    @cached_property
    def _model(self) -> Absorbers:
        elevations, lengths = self._paths
        depths = self._depths.reshape(elevations.size, -1)
        return Absorbers.fitted(self.lower_m, elevations.ravel(), lengths.ravel(), depths)

    @cached_property
    def _temperatures(self):
        """Rising heights [m] and the air's temperatures there [K], as the table shows them.

        Opaque air that is seen from above radiates as a blackbody at the temperature at the path's
        upper end. The most opaque wavelength is used.
        """
        row = int(np.argmax(self._depths.sum(axis=(0, 1))))
        emissivity = -np.expm1(-self._depths[..., row])
        radiance = np.maximum(self.down[..., row] / emissivity, 1e-300)
        x = self.wavelengths_um[row]
        temperatures = C2 / x / np.log1p(C1 / x**5 / radiance)
        heights = height_along(self.lower_m, *self._paths).ravel()
        order = np.argsort(heights)
        return heights[order], np.clip(temperatures.ravel()[order], COLDEST_K, WARMEST_K)

    def _emitted(self, heights_m) -> np.ndarray:
        """Planck's law at the air's temperature, (..., k)."""
        temperatures = np.interp(heights_m, *self._temperatures)
        return spectral_radiance(self.wavelengths_um, temperatures[..., None])

    @cached_property
    def _ratios(self):
        """Table over model: logarithm of the depths' ratio, ratio of the sources up and down."""
        elevations, lengths = self._paths
        model = self._model.depths(elevations, 0.0, lengths)
        # A lower bound of the depth says nothing about a model that lies above it.
        bounded = (self.transmittance <= OPAQUE) & (model > self._depths)
        depths = np.log(np.where(bounded, model, self._depths) / np.maximum(model, CLEAR / 2))
        emissivity = 1 - self.transmittance
        sources = []
        for radiance, from_below in ((self.up, True), (self.down, False)):
            expected = self._model.source(
                elevations.ravel(), 0.0, lengths.ravel(), from_below, self._emitted
            ).reshape(radiance.shape)
            known = (emissivity > SMALLEST_EMISSIVITY) & (expected > 0)
            below = np.where(known, emissivity * expected, 1)
            sources.append(np.where(known, radiance / below, 1))
        return depths, *sources

    def _interpolated(self, values, elevation_deg: float, lengths_m) -> np.ndarray:
        """Values of the table's grid (e, r, k) at an elevation and at lengths, (lengths, k)."""
        *roots, root = np.sqrt(np.sin(np.radians([*self.elevations_deg, elevation_deg])))
        low, high, share = _between(np.array(roots), root)
        at_elevation = (1 - share) * values[low] + share * values[high]
        low, high, share = _between(np.log(self.ranges_m), np.log(lengths_m))
        share = share[:, None]
        return (1 - share) * at_elevation[low] + share * at_elevation[high]


def _between(knots, x):
    """Indices of the knots on both sides of x, and the share of the upper one, within 0..1."""
    low = np.clip(np.searchsorted(knots, x) - 1, 0, max(len(knots) - 2, 0))
    high = np.minimum(low + 1, len(knots) - 1)
    width = np.where(high > low, knots[high] - knots[low], 1)
    return low, high, np.clip((x - knots[low]) / width, 0, 1)


def slant_names() -> list[str]:
    """Names of the bundled slant tables, which were computed with LOWTRAN7.

    The headers of their files say how.
    """
    return sorted(file.stem for file in BUNDLED.glob(f"{PREFIX}*.csv"))


def is_slant(source) -> bool:
    """Whether `source` is a bundled slant table, or a CSV with a column of elevations."""
    if str(source) in slant_names():
        return True
    path = Path(source)
    if path.suffix != ".csv" or not os.path.isfile(path):
        return False
    with path.open(encoding="utf-8", errors="replace") as lines:
        header = next((line for line in lines if not line.lstrip().startswith("#")), "")
    return ELEVATION in header and TRANSMITTANCE in header


def slant_air(source) -> SlantAir:
    """Read a table of slant paths by its name or from a file.

    Parameters
    ----------
    source
        One of `slant_names()`, or a CSV file with the columns elevation_deg, range_km,
        wavelength_um, transmittance, path_radiance_up_W_m2_sr_um and path_radiance_down_W_m2_sr_um.
        Its paths begin 50 m above the ground. Every elevation has the same ranges, and every range
        the same wavelengths, in rising order.

    Returns
    -------
    SlantAir
        The table.

    Raises
    ------
    InputError
        If the name is unknown or the file holds no such table.
    """
    if isinstance(source, SlantAir):
        return source
    path = Path(source)
    if str(source) in slant_names():
        path = BUNDLED / f"{source}.csv"
    elif not path.suffix and not os.path.exists(path):
        raise unknown("slant table", str(source), slant_names())
    return _read(str(source), path, revision(path))


@lru_cache(maxsize=4)
def _read(name, path, revision) -> SlantAir:
    limits = {  # smallest and largest value of each column
        ELEVATION: (0, 90),
        RANGE: (0, LARGEST),
        WAVELENGTH: (SHORTEST_UM, LONGEST_UM),
        TRANSMITTANCE: (0, 1),
        UP: (0, LARGEST),
        DOWN: (0, LARGEST),
    }
    file = read_table(path, list(limits), "atmosphere")
    table = file.numbers(limits)
    for column, (lowest, highest) in limits.items():
        file.check_range(column, table[column], lowest, highest)
    keys = [np.unique(table[column]) for column in (ELEVATION, RANGE, WAVELENGTH)]
    for column, values in zip((ELEVATION, RANGE), keys):
        if values[0] == 0:
            raise InputError(f"atmosphere {path}: {column} 0; must be positive")
    shape = tuple(len(values) for values in keys)
    places = [
        np.searchsorted(values, table[column])
        for values, column in zip(keys, (ELEVATION, RANGE, WAVELENGTH))
    ]
    order = np.ravel_multi_index(places, shape)
    if len(order) != np.prod(shape) or len(np.unique(order)) != len(order):
        raise InputError(
            f"atmosphere {path}: {len(order)} rows for {shape[0]} elevations, {shape[1]} ranges "
            f"and {shape[2]} wavelengths; each combination must have one row"
        )
    grid = {
        column: table[column][np.argsort(order)].reshape(shape)
        for column in (TRANSMITTANCE, UP, DOWN)
    }
    for elevation, values, *radiances in zip(keys[0], *grid.values()):
        for radiance in radiances:
            at = f"{name} at {elevation:g} degrees"
            plausible(Atmosphere(at, 1000 * keys[1], keys[2], values, radiance))
    return SlantAir(name, LOWER_END_M, keys[0], 1000 * keys[1], keys[2], *grid.values())

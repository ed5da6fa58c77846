"""Atmospheres: transmittance and path radiance of the air between target and sensor.

Both are functions of range and wavelength.
"""

import os
import warnings
from dataclasses import dataclass
from functools import cached_property
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from mi_lcair.errors import InputError, unknown
from mi_lcair.physics import tape7
from mi_lcair.physics.bands import Band
from mi_lcair.physics.spectral_table import spectral_table
from mi_lcair.physics.spectrum import BUNDLED
from mi_lcair.table import LARGEST

VACUUM = "vacuum"
RANGE, TRANSMITTANCE, PATH_RADIANCE = "range_km", "transmittance", "path_radiance_W_m2_sr_um"
# Upper bound of a transmittance that is printed as 0 with six decimals.
SMALLEST_TRANSMITTANCE = 5e-7
# Smallest emissivity of a path from which its source function is computed. Columns with six
# decimals then give the source function to 1 %.
SMALLEST_EMISSIVITY = 1e-4
# Optical depth of a row with transmittance 1. It is above 0, so that its logarithm is finite.
CLEAR = 1e-12
# Tolerance for the rounding of a printed table: rise of the transmittance with range, or radiance
# at transmittance 1 as a share of the largest radiance.
ROUNDING = 1e-3
SAME_ELEVATION_DEG = 0.25  # largest difference of elevations that count as one
RANGES_AT_ONCE = 1024  # ranges of a long list that are computed together, to bound the memory


@dataclass(frozen=True, eq=False)
class LineOfSight:
    """Transmittance and path radiance of one line of sight between target and sensor.

    Attributes
    ----------
    range_m
        Length of the path [m].
    wavelengths_um
        Rising wavelengths [um], (n,); empty for vacuum, as are the other arrays.
    transmittance
        Transmittance of the path, 0..1, (n,).
    radiance
        Radiance that the path itself emits and scatters to the sensor [W m^-2 sr^-1 um^-1], (n,).
    """

    range_m: float
    wavelengths_um: np.ndarray
    transmittance: np.ndarray
    radiance: np.ndarray

    def at(self, wavelengths_um: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        """Interpolate transmittance and radiance linearly at these wavelengths [um].

        Raises InputError for wavelengths outside the table. Gaps between its rows are not checked
        here; `Atmosphere.check_covers` checks them for a band.
        """
        x = np.asarray(wavelengths_um, dtype=float)
        if not self.wavelengths_um.size:
            return np.ones(x.shape), np.zeros(x.shape)
        first, last = self.wavelengths_um[[0, -1]]
        if x.size and not (first <= x.min() and x.max() <= last):
            raise InputError(
                f"atmosphere: wavelengths {x.min():g}-{x.max():g} um are outside its "
                f"{first:.4g}-{last:.4g} um"
            )
        return tuple(
            np.interp(x, self.wavelengths_um, values)
            for values in (self.transmittance, self.radiance)
        )


@dataclass(frozen=True, eq=False)
class Atmosphere:
    """A table of transmittance and path radiance over range and wavelength.

    Between the tabulated ranges, and from the first one down to 0, the optical depth at each
    wavelength is a power of range. The power is 1 where Bouguer's law holds. It is smaller, down to
    1/2, in a band of unresolved lines whose strong lines saturate (Goody and Yung 1989, 4.5). The
    path radiance is (1 - transmittance) times a source function that is linear in range. In air
    that only emits, the source function is Planck's function at the air's temperature.

    Attributes
    ----------
    name
        Name or path with which the atmosphere was read.
    ranges_m
        Rising ranges [m], (n,). For vacuum all arrays are empty; vacuum covers every band and
        range.
    wavelengths_um
        Rising wavelengths [um], (k,).
    transmittance
        Transmittance, 0..1, (n, k).
    path_radiance
        Path radiance [W m^-2 sr^-1 um^-1], (n, k).
    """

    name: str
    ranges_m: np.ndarray
    wavelengths_um: np.ndarray
    transmittance: np.ndarray
    path_radiance: np.ndarray

    @property
    def is_vacuum(self) -> bool:
        """Whether this is vacuum, which transmits everything and emits nothing."""
        return self.wavelengths_um.size == 0

    def path(self, range_m: float, extrapolate: bool = False) -> LineOfSight:
        """The line of sight of length `range_m` [m].

        Raises InputError for a range that is not positive, or that lies beyond the last one of the
        table. With `extrapolate`, the optical depth beyond the table follows its last power of
        range instead, and a Python warning says so.
        """
        ranges = self._checked([range_m], extrapolate)
        transmittance, radiance = self._along(ranges, slice(None))
        return LineOfSight(float(ranges[0]), self.wavelengths_um, transmittance[0], radiance[0])

    def check_covers(self, band: Band) -> None:
        """Raise InputError if the table does not cover the band.

        The band `total` has no wavelengths and is always refused, except by vacuum.
        """
        if self.is_vacuum:
            return
        if band.is_total:
            raise InputError(
                f"atmosphere '{self.name}': band total has no wavelengths that it could act on; "
                f"choose a band with limits, or atmosphere {VACUUM}"
            )
        band.check_covered(self.wavelengths_um, f"atmosphere '{self.name}'")

    def transmittance_mean(self, band: Band, range_m: float, extrapolate: bool = False) -> float:
        """Mean transmittance in the band, weighted by the detector's response only.

        range_m and extrapolate are those of `path`.
        """
        mean = self.band_transmittance(
            band, np.ones((1, len(self.wavelengths_um))), [range_m], extrapolate
        )
        return float(mean[0, 0])

    def band_transmittance(
        self, band: Band, spectra: ArrayLike, ranges_m: ArrayLike, extrapolate: bool = False
    ) -> np.ndarray:
        """Mean transmittance in the band at many ranges, weighted by response and spectrum.

        Parameters
        ----------
        band
            Band with the detector's response.
        spectra
            Source spectra in any unit, (s, k), at the atmosphere's wavelengths_um. A spectrum that
            is 0 in the whole band is replaced by a constant one.
        ranges_m
            Ranges [m], (r,).
        extrapolate
            Whether ranges beyond the table are allowed; see `path`.

        Returns
        -------
        numpy.ndarray
            Mean transmittances, 0..1, (s, r).

        Raises
        ------
        InputError
            If the table does not cover the band or a range.
        """
        spectra = np.atleast_2d(np.asarray(spectra, dtype=float))
        if self.is_vacuum:
            return np.ones((len(spectra), len(self._checked(ranges_m, extrapolate))))
        rows, weights = self._rows(band)
        of_spectra = spectra[:, rows] * weights
        of_spectra[of_spectra.sum(axis=1) == 0] = weights
        of_spectra /= of_spectra.sum(axis=1, keepdims=True)
        return self._in_pieces(
            ranges_m, extrapolate, lambda ranges: self._along(ranges, rows)[0] @ of_spectra.T
        ).T

    def band_path_radiance(
        self, band: Band, ranges_m: ArrayLike, extrapolate: bool = False
    ) -> np.ndarray:
        """In-band path radiance, weighted by the response, at many ranges.

        Parameters
        ----------
        band
            Band with the detector's response.
        ranges_m
            Ranges [m], (r,).
        extrapolate
            Whether ranges beyond the table are allowed; see `path`.

        Returns
        -------
        numpy.ndarray
            In-band path radiances [W m^-2 sr^-1], (r,).

        Raises
        ------
        InputError
            If the table does not cover the band or a range.
        """
        if self.is_vacuum:
            return np.zeros(len(self._checked(ranges_m, extrapolate)))
        rows, weights = self._rows(band)
        return self._in_pieces(
            ranges_m, extrapolate, lambda ranges: self._along(ranges, rows)[1] @ weights
        )

    def _rows(self, band):
        """Indices of the wavelengths with a weight in the band, and their weights [um]."""
        self.check_covers(band)
        weights = band.row_weights(self.wavelengths_um)
        rows = np.flatnonzero(weights)
        return rows, weights[rows]

    def _in_pieces(self, ranges_m, extrapolate, function):
        """Values of `function` at checked ranges [m], computed for RANGES_AT_ONCE at a time."""
        ranges = self._checked(ranges_m, extrapolate)
        return np.concatenate(
            [
                function(ranges[start : start + RANGES_AT_ONCE])
                for start in range(0, max(len(ranges), 1), RANGES_AT_ONCE)
            ]
        )

    def _checked(self, ranges_m, extrapolate) -> np.ndarray:
        """The ranges [m] as an array; see `path` for what is refused."""
        ranges = np.asarray(ranges_m, dtype=float)
        usable = (ranges > 0) & np.isfinite(ranges)
        if not usable.all():
            wrong = ranges[~usable][0]
            raise InputError(
                f"atmosphere '{self.name}': "
                f"{'zero range' if wrong == 0 else f'range {wrong:g} m'}; "
                "the range to the target must be positive and finite, in metres"
            )
        if not self.is_vacuum and ranges.size and ranges.max() > (last := self.ranges_m[-1]):
            beyond = (
                f"atmosphere '{self.name}': range {ranges.max():g} m is beyond its last one, "
                f"{last:g} m"
            )
            if not extrapolate:
                raise InputError(
                    f"{beyond}; choose a shorter one, or in a scenario set extrapolate = true of "
                    "[atmosphere]"
                )
            warnings.warn(
                f"{beyond}: its optical depth is extrapolated with its last power of range",
                stacklevel=3,
            )
        return ranges

    @cached_property
    def _knots(self):
        """Optical depths and source functions (n, k), and the depths' powers of range (n + 1, k).

        The depths and source functions are those at the tabulated ranges. The powers are those
        below the first range, between neighbouring ranges, and beyond the last range.
        """
        positive = self.transmittance[self.transmittance > 0]
        # A printed transmittance of 0 gives only a lower bound of the optical depth. The bound is
        # used, from a transmittance smaller than that of every other entry.
        smallest = min([SMALLEST_TRANSMITTANCE, *([positive.min() / 2] if positive.size else [])])
        depths = -np.log(np.clip(self.transmittance, smallest, 1 - CLEAR))
        powers = np.diff(np.log(depths), axis=0) / np.diff(np.log(self.ranges_m))[:, None]
        if len(powers):
            first, last = np.clip(powers[0], 0.5, 1), np.clip(powers[-1], 0, 1)
            # A path that is opaque at the first range does not show its power below that range.
            first[self.transmittance[0] <= smallest] = 1
        else:
            first = last = np.ones(depths.shape[1])
        emissivity = 1 - self.transmittance
        source = self.path_radiance / np.where(emissivity > 0, emissivity, np.inf)
        # A path that is too clear gives no source function. It takes that of the next longer path.
        for n in range(len(source) - 2, -1, -1):
            source[n] = np.where(emissivity[n] > SMALLEST_EMISSIVITY, source[n], source[n + 1])
        return depths, source, np.vstack([first, powers, last])

    def _along(self, ranges, rows):
        """Transmittance and path radiance at ranges [m] and wavelength indices, (ranges, rows)."""
        if self.is_vacuum:
            return np.ones((len(ranges), 0)), np.zeros((len(ranges), 0))
        depths, source, powers = (values[:, rows] for values in self._knots)
        knots = self.ranges_m
        interval = np.searchsorted(knots, ranges)  # 0 for ranges below the first one
        before = np.maximum(interval - 1, 0)
        beyond = np.minimum(interval, len(knots) - 1)
        depth = depths[before] * (ranges / knots[before])[:, None] ** powers[interval]
        transmittance = np.where(depth > 2 * CLEAR, np.exp(-depth), 1)
        share = (ranges - knots[before]) / np.maximum(knots[beyond] - knots[before], 1e-300)
        share = np.clip(share, 0, 1)[:, None]
        return transmittance, (1 - transmittance) * (
            source[before] + share * (source[beyond] - source[before])
        )


def atmosphere_names() -> list[str]:
    """Names of the bundled atmospheres, and "vacuum".

    The bundled ones are horizontal paths near the ground, computed with LOWTRAN7. The headers of
    their files say how they were made.
    """
    return [*sorted(file.stem.removeprefix("path_") for file in BUNDLED.glob("path_*.csv")), VACUUM]


def atmosphere(
    source: Atmosphere | str | PathLike[str],
    ranges_m: ArrayLike | None = None,
    elevation_deg: float | None = None,
) -> Atmosphere:
    """Read an atmosphere by its name or from a file.

    Parameters
    ----------
    source
        One of `atmosphere_names()`, the path of a CSV file, or the path of a MODTRAN tape7. The CSV
        has the columns range_km, wavelength_um, transmittance and path_radiance_W_m2_sr_um in any
        order, with the same wavelengths for every range. The blocks of the tape7 (see
        `mi_lcair.physics.tape7`) have the same wavelengths at each range; several blocks at one
        range are joined. An `Atmosphere` is returned as it is.
    ranges_m
        Range [m] of each block of a tape7. It replaces the ranges in the file.
    elevation_deg
        Elevation of the line of sight, upward from the sensor [degrees]. It is used for a tape7
        whose blocks have several: the logarithm of the optical depth and the source function are
        then linear in the sine of the elevation.

    Returns
    -------
    Atmosphere
        The table.

    Raises
    ------
    InputError
        If the name is unknown or the file holds no atmosphere.
    """
    if isinstance(source, Atmosphere):
        return source
    path = Path(source)
    if str(source) in atmosphere_names():
        path = BUNDLED / f"path_{source}.csv"
    elif not path.suffix and not os.path.exists(path):
        slant = sorted(file.stem for file in BUNDLED.glob("slant_*.csv"))
        if str(source) in slant:
            raise InputError(
                f"atmosphere '{source}' holds slant paths, among which the line of sight of a "
                f"scenario chooses; known here: {', '.join(atmosphere_names())}"
            )
        raise unknown("atmosphere", str(source), [*atmosphere_names(), *slant, "a file"])
    elif tape7.is_tape7(path):
        return _from_tape7(str(source), path, ranges_m, elevation_deg)
    if ranges_m is not None:
        raise InputError(
            f"atmosphere '{source}': ranges_m are for the blocks of a MODTRAN tape7 only; leave "
            "them out"
        )
    if str(source) == VACUUM:
        return Atmosphere(VACUUM, *np.zeros((2, 0)), *np.zeros((2, 0, 0)))
    return _from_csv(str(source), path)


def _from_csv(name, path) -> Atmosphere:
    columns = (TRANSMITTANCE, 1.0), (PATH_RADIANCE, LARGEST)
    table = spectral_table(path, "atmosphere", columns, key=RANGE)
    if table.keys[0] == 0:
        raise InputError(
            f"atmosphere {path}: {RANGE} 0; ranges must be positive (at range 0 nothing is lost)"
        )
    return plausible(Atmosphere(name, 1000 * table.keys, table.wavelengths_um, *table.columns))


def plausible(air: Atmosphere) -> Atmosphere:
    """Return the atmosphere if it is physically possible, else raise InputError.

    Refused are a transmittance that rises with range, and a path radiance where the transmittance
    is 1. Deviations within the rounding of a printed table are accepted.
    """
    rise = np.diff(air.transmittance, axis=0)
    if rise.size and rise.max() > ROUNDING:
        n, k = np.unravel_index(np.argmax(rise), rise.shape)
        raise InputError(
            f"atmosphere '{air.name}': at {air.wavelengths_um[k]:.6g} um the transmittance rises "
            f"from {air.transmittance[n, k]:g} at {air.ranges_m[n]:g} m to "
            f"{air.transmittance[n + 1, k]:g} at {air.ranges_m[n + 1]:g} m; it must fall with range"
        )
    glow = np.where(air.transmittance == 1, air.path_radiance, 0)
    if glow.max() > ROUNDING * air.path_radiance.max():
        n, k = np.unravel_index(np.argmax(glow), glow.shape)
        raise InputError(
            f"atmosphere '{air.name}': at {air.wavelengths_um[k]:.6g} um and "
            f"{air.ranges_m[n]:g} m the transmittance is 1 and the path radiance {glow[n, k]:g}; "
            "air that absorbs nothing emits nothing"
        )
    return air


def _from_tape7(name, path, ranges_m, elevation_deg) -> Atmosphere:
    blocks = tape7.blocks(path)
    if ranges_m is None:
        for block in blocks:
            if block.to_space or block.range_m is None:
                why = (
                    "is a path to space or the ground (ITYPE 3), to no target"
                    if block.to_space
                    else "states no range on card 3"
                )
                raise InputError(
                    f"atmosphere {path}: the block with the header in line {block.line} {why}; "
                    "in a scenario give ranges_m of [atmosphere], one for each block"
                )
        ranges_m = [block.range_m for block in blocks]
    ranges = np.asarray(ranges_m, dtype=float)
    if ranges.shape != (len(blocks),) or not np.all((ranges > 0) & np.isfinite(ranges)):
        raise InputError(
            f"atmosphere {path}: ranges_m = {ranges_m}; must be a positive number of metres for "
            f"each of its {len(blocks)} blocks"
        )
    elevations = np.array([block.elevation_deg for block in blocks])
    # Sensors at several heights see one line of sight at slightly different elevations.
    order = np.sort(np.unique(elevations))
    groups = np.split(order, np.flatnonzero(np.diff(order) > SAME_ELEVATION_DEG) + 1)
    airs = []
    for group in groups:
        numbers = [n for n, elevation in enumerate(elevations) if elevation in group]
        airs.append(_over_ranges(name, path, [blocks[n] for n in numbers], ranges[numbers]))
    if len(airs) == 1:
        return airs[0]
    return _between(path, np.array([group.mean() for group in groups]), airs, elevation_deg)


def _between(path, elevations_deg, airs, elevation_deg) -> Atmosphere:
    """The air at an elevation, from airs at rising elevations [degrees]."""
    first, last = elevations_deg[0], elevations_deg[-1]
    if elevation_deg is None:
        raise InputError(
            f"atmosphere {path}: holds paths of {len(airs)} elevations, {first:g}..{last:g} "
            "degrees, one of which the line of sight of a scenario chooses; keep the blocks of one"
        )
    if not first - SAME_ELEVATION_DEG <= elevation_deg <= last + SAME_ELEVATION_DEG:
        raise InputError(
            f"atmosphere {path}: the line of sight's elevation of {elevation_deg:g} degrees is "
            f"outside its {first:g}..{last:g} degrees; run MODTRAN for it"
        )
    for air in airs[1:]:
        for grid in ("ranges_m", "wavelengths_um"):
            if not np.array_equal(getattr(air, grid), getattr(airs[0], grid)):
                what = grid.split("_")[0]
                raise InputError(
                    f"atmosphere {path}: its elevations have different {what}; run every "
                    f"elevation with the same {what}"
                )
    knots, x = np.sin(np.radians(elevations_deg)), np.sin(np.radians(elevation_deg))
    low = int(np.clip(np.searchsorted(knots, x) - 1, 0, len(knots) - 2))
    share = np.clip((x - knots[low]) / (knots[low + 1] - knots[low]), 0, 1)
    (depth, source, _), (next_depth, next_source, _) = airs[low]._knots, airs[low + 1]._knots
    transmittance = np.exp(-(depth ** (1 - share)) * next_depth**share)
    radiance = (1 - transmittance) * ((1 - share) * source + share * next_source)
    first = airs[0]
    return Atmosphere(
        f"{first.name} at {elevation_deg:g} degrees",
        first.ranges_m,
        first.wavelengths_um,
        transmittance,
        radiance,
    )


def _over_ranges(name, path, blocks, ranges) -> Atmosphere:
    """The air of the blocks of one elevation."""
    lines_of_sight = [
        tape7.joined(path, [block for block, length in zip(blocks, ranges) if length == distinct])
        for distinct in np.unique(ranges)
    ]
    first = lines_of_sight[0]
    for block in lines_of_sight[1:]:
        if not np.array_equal(block.wavelengths_um, first.wavelengths_um):
            raise InputError(
                f"atmosphere {path}: the ranges of the blocks with headers in lines {first.line} "
                f"and {block.line} have different wavelengths; run every range with the same ones"
            )
    return plausible(
        Atmosphere(
            name,
            np.unique(ranges),
            first.wavelengths_um,
            np.array([block.transmittance for block in lines_of_sight]),
            np.array([block.path_radiance for block in lines_of_sight]),
        )
    )

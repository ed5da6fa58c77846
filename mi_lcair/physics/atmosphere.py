"""Atmospheres: transmittance and path radiance of the air between target and sensor.

Both are functions of range and wavelength.
"""

import os
from dataclasses import dataclass
from functools import cached_property
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from mi_lcair.errors import InputError, unknown
from mi_lcair.physics.air import tape7
from mi_lcair.physics.air.atmosphere import VACUUM, Atmosphere
from mi_lcair.physics.air.clear_air import ClearPaths, clear_air
from mi_lcair.physics.air.levels import HEIGHT_M, model_names
from mi_lcair.physics.spectral_table import spectral_table
from mi_lcair.table import LARGEST

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


@dataclass(frozen=True, eq=False)
class AtmosphereTable(Atmosphere):
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

    def along(self, ranges_m, rows):
        """Transmittance and path radiance at ranges [m] and wavelength indices, (ranges, rows)."""
        if self.is_vacuum:
            return np.ones((len(ranges_m), 0)), np.zeros((len(ranges_m), 0))
        depths, source, powers = (values[:, rows] for values in self._knots)
        knots = self.ranges_m
        interval = np.searchsorted(knots, ranges_m)  # 0 for ranges below the first one
        before = np.maximum(interval - 1, 0)
        beyond = np.minimum(interval, len(knots) - 1)
        depth = depths[before] * (ranges_m / knots[before])[:, None] ** powers[interval]
        transmittance = np.where(depth > 2 * CLEAR, np.exp(-depth), 1)
        share = (ranges_m - knots[before]) / np.maximum(knots[beyond] - knots[before], 1e-300)
        share = np.clip(share, 0, 1)[:, None]
        return transmittance, (1 - transmittance) * (
            source[before] + share * (source[beyond] - source[before])
        )


def atmosphere_names() -> list[str]:
    """Names of the clear airs of LOWTRAN7's band model, and "vacuum"."""
    return [*model_names(), VACUUM]


def clear_air_name(source: object) -> str | None:
    """Name of the model atmosphere that `source` names; None for another atmosphere."""
    return str(source) if str(source) in model_names() else None


def atmosphere(
    source: Atmosphere | str | PathLike[str],
    ranges_m: ArrayLike | None = None,
    elevation_deg: float | None = None,
    air_temperature: float | None = None,
) -> Atmosphere:
    """Read an atmosphere by its name or from a file.

    Parameters
    ----------
    source
        One of `atmosphere_names()`, the path of a CSV file, or the path of a MODTRAN tape7. A name
        of clear air stands for horizontal paths 50 m above the ground; in a scenario, for the air
        along its line of sight. The CSV has the columns range_km, wavelength_um, transmittance and
        path_radiance_W_m2_sr_um in any order, with the same wavelengths for every range. The blocks
        of the tape7 (see `physics.air.tape7`) have the same wavelengths at each range; several
        blocks at one range are joined. An `Atmosphere` is returned as it is.
    ranges_m
        Range [m] of each block of a tape7. It replaces the ranges in the file.
    elevation_deg
        Elevation of the line of sight, upward from the sensor [degrees]. It is used for a tape7
        whose blocks have several: the logarithm of the optical depth and the source function are
        then linear in the sine of the elevation.
    air_temperature
        Temperature [K] of the air of a tape7 that holds transmittances alone.

    Returns
    -------
    Atmosphere
        The air.

    Raises
    ------
    InputError
        If the name is unknown or the file holds no atmosphere.
    """
    if isinstance(source, Atmosphere):
        return source
    path, name = Path(source), clear_air_name(source)
    if name is None and str(source) != VACUUM:
        if not path.suffix and not os.path.exists(path):
            raise unknown("atmosphere", str(source), [*atmosphere_names(), "a file"])
        if tape7.is_tape7(path):
            return _from_tape7(str(source), path, ranges_m, elevation_deg, air_temperature)
    for key, given in (("ranges_m", ranges_m), ("air_temperature", air_temperature)):
        if given is not None:
            raise InputError(
                f"atmosphere '{source}': {key} is for the blocks of a MODTRAN tape7 only; leave it "
                "out"
            )
    if name is not None:
        return ClearPaths(str(source), clear_air(name), HEIGHT_M, 0.0, True)
    if str(source) == VACUUM:
        return AtmosphereTable(VACUUM, *np.zeros((2, 0)), *np.zeros((2, 0, 0)))
    return _from_csv(str(source), path)


def _from_csv(name, path) -> Atmosphere:
    columns = (TRANSMITTANCE, 1.0), (PATH_RADIANCE, LARGEST)
    table = spectral_table(path, "atmosphere", columns, (RANGE,))
    ranges = table.keys[RANGE]
    if ranges[0] == 0:
        raise InputError(
            f"atmosphere {path}: {RANGE} 0; ranges must be positive (at range 0 nothing is lost)"
        )
    return plausible(AtmosphereTable(name, 1000 * ranges, table.wavelengths_um, *table.columns))


def plausible(air: AtmosphereTable) -> AtmosphereTable:
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


def _from_tape7(name, path, ranges_m, elevation_deg, air_temperature) -> Atmosphere:
    blocks = tape7.blocks(path, air_temperature)
    if ranges_m is None:
        for block in blocks:
            if block.to_space or block.range_m is None:
                why = (
                    "is a path to space or the ground (ITYPE 3), to no target"
                    if block.to_space
                    else "has no range on card 3"
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
    return between_elevations(
        path, np.array([group.mean() for group in groups]), airs, elevation_deg
    )


def between_elevations(path, elevations_deg, airs, elevation_deg) -> AtmosphereTable:
    """The air at an elevation, from airs at rising elevations [degrees]."""
    first, last = elevations_deg[0], elevations_deg[-1]
    if elevation_deg is None:
        raise InputError(
            f"atmosphere {path}: has paths of {len(airs)} elevations, {first:g}..{last:g} "
            "degrees, and only a scenario selects one by its line of sight; keep the blocks of "
            "one"
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
    name, grid = (
        f"{first.name} at {elevation_deg:g} degrees",
        (first.ranges_m, first.wavelengths_um),
    )
    return AtmosphereTable(name, *grid, transmittance, radiance)


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
    transmittance = np.array([block.transmittance for block in lines_of_sight])
    radiance = np.array([block.path_radiance for block in lines_of_sight])
    grid = np.unique(ranges), first.wavelengths_um
    return plausible(AtmosphereTable(name, *grid, transmittance, radiance))

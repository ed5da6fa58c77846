"""A user's table of slant paths: transmittance and path radiance by elevation and range.

Its paths begin 50 m above the ground. Between its elevations the logarithm of the optical depth and
the source function are linear in the sine of the elevation; over the range it is a table as any
other. Clear air of the band model needs no table.
"""

import os
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.files import revision
from mi_lcair.physics.atmosphere import (
    HEIGHT_M,
    RANGE,
    TRANSMITTANCE,
    AtmosphereTable,
    between_elevations,
    plausible,
)
from mi_lcair.physics.sky import ELEVATION
from mi_lcair.physics.spectral_table import spectral_table
from mi_lcair.table import LARGEST

UP, DOWN = "path_radiance_up_W_m2_sr_um", "path_radiance_down_W_m2_sr_um"
HIGHEST_M = 150.0  # largest height of a path's lower end, which the table has at 50 m


@dataclass(frozen=True, eq=False)
class SlantTable:
    """Air by elevation and range.

    Attributes
    ----------
    path
        The file.
    elevations_deg
        Rising elevations of the paths at their lower end, 0..90 degrees, (e,).
    up, down
        The air at each elevation, over the range, seen from the lower end and from the upper end.
    """

    path: Path
    elevations_deg: np.ndarray
    up: tuple[AtmosphereTable, ...]
    down: tuple[AtmosphereTable, ...]

    def along(
        self, elevation_deg: float, looks_up: bool, lower_m: float = HEIGHT_M
    ) -> AtmosphereTable:
        """The air along a line of sight, over the range from one of its ends.

        elevation_deg: at the lower end [degrees]. looks_up: whether the sensor is at the lower end.
        lower_m: height of the lower end [m]. Raises InputError outside the table.
        """
        if lower_m > HIGHEST_M:
            raise InputError(
                f"atmosphere '{self.path}': its paths begin {HEIGHT_M:g} m above the ground, and "
                f"the line of sight at {lower_m:.6g} m; us_standard and midlat_summer know every "
                "height"
            )
        first, last = self.elevations_deg[[0, -1]]
        # A line that is computed from heights may miss the table's first elevation by rounding.
        if not first - 1e-9 <= elevation_deg <= last + 1e-9:
            raise InputError(
                f"atmosphere '{self.path}': the line of sight's elevation of {elevation_deg:.4g} "
                f"degrees is outside its {first:g}-{last:g} degrees; choose one within, or a table "
                "of horizontal paths for a lower one"
            )
        airs = self.up if looks_up else self.down
        if len(airs) == 1:
            return airs[0]
        return between_elevations(self.path, self.elevations_deg, airs, elevation_deg)


def is_slant(source) -> bool:
    """Whether `source` is a CSV with a column of elevations and one of transmittances."""
    path = Path(source)
    if path.suffix != ".csv" or not os.path.isfile(path):
        return False
    with path.open(encoding="utf-8", errors="replace") as lines:
        header = next((line for line in lines if not line.lstrip().startswith("#")), "")
    return ELEVATION in header and TRANSMITTANCE in header


def slant_table(source) -> SlantTable:
    """Read a table of slant paths.

    Parameters
    ----------
    source
        CSV file with the columns elevation_deg, range_km, wavelength_um, transmittance,
        path_radiance_up_W_m2_sr_um and path_radiance_down_W_m2_sr_um. Every elevation has the same
        ranges, and every range the same wavelengths, in rising order.

    Returns
    -------
    SlantTable

    Raises
    ------
    InputError
        If the file holds no such table.
    """
    return _read(Path(source), revision(source))


@lru_cache(maxsize=4)
def _read(path, revision) -> SlantTable:
    columns = (TRANSMITTANCE, 1.0), (UP, LARGEST), (DOWN, LARGEST)
    table = spectral_table(path, "atmosphere", columns, (ELEVATION, RANGE))
    (elevations, ranges), grid = table.grid(f"atmosphere {path}")
    for column, values in ((ELEVATION, elevations), (RANGE, ranges)):
        if values[0] == 0:
            raise InputError(f"atmosphere {path}: {column} 0; must be positive")
    x, transmittance = table.wavelengths_um, grid[0]
    up, down = (
        tuple(
            plausible(AtmosphereTable(f"{path} at {elevation:g} degrees", 1000 * ranges, x, *air))
            for elevation, *air in zip(elevations, transmittance, radiance)
        )
        for radiance in grid[1:]
    )
    return SlantTable(path, elevations, up, down)

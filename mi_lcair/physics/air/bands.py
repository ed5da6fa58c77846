"""Spectral coefficients of LOWTRAN7's band model: from amounts of absorbers to optical depths.

The optical depth is the sum of (coefficient * amount)^exponent over the absorbers, with the amounts
of the whole path. The exponent is below 1 where unresolved lines saturate.
"""

from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path

import numpy as np

from mi_lcair.table import read_table, rows_at

TABLES = Path(__file__).with_name("tables")
WAVELENGTH = "wavelength_um"
# Phase function of molecules, of the square of the cosine of the angle, as LOWTRAN7 has it [1/sr].
RAYLEIGH = 0.06050402, 0.0572197
ROWS = 16  # of a product of matrices that OpenBLAS calculates in one thread


@dataclass(frozen=True, eq=False)
class Bands:
    """Coefficients of the absorbers at each wavelength.

    Attributes
    ----------
    columns
        Names of the absorbers, (c,).
    wavelengths_um
        Rising wavelengths [um], (k,).
    exponents
        Exponents of the amounts, (c,).
    coefficients
        Coefficients raised to the exponents, (c, k); 0 where an absorber has no band.
    scattering
        Scattered part of the optical depth per amount, (c, k); 0 for gases that absorb.
    sun
        Irradiance of the sun outside the air at 1 astronomical unit [W m^-2 um^-1], (k,).
    """

    columns: tuple[str, ...]
    wavelengths_um: np.ndarray
    exponents: np.ndarray
    coefficients: np.ndarray
    scattering: np.ndarray
    sun: np.ndarray

    def depth(self, amounts: np.ndarray) -> np.ndarray:
        """Optical depth, (..., k), of amounts of absorbers (..., c) along whole paths.

        Amounts are densities of the table of levels times km.
        """
        powers = (np.maximum(amounts, 0) ** self.exponents).reshape(-1, len(self.exponents))
        depth = np.empty((len(powers), len(self.wavelengths_um)))
        # Threads of a BLAS wait for each other on a busy machine; for few rows it uses none.
        for first in range(0, len(powers), ROWS):
            rows = slice(first, first + ROWS)
            np.matmul(powers[rows], self.coefficients, out=depth[rows])
        return depth.reshape(*np.shape(amounts)[:-1], -1)

    def transmittance(self, amounts: np.ndarray) -> np.ndarray:
        """Transmittance 0..1, (..., k), of amounts of absorbers (..., c) along whole paths."""
        return np.exp(-self.depth(amounts))

    def phase(self, column: int, angle_deg: np.ndarray) -> np.ndarray:
        """Phase function of an absorber that scatters, (..., k) [1/sr].

        column: its number. angle_deg: angles between the directions before and after, (...).
        """
        name = self.columns[column]
        if name == "rayleigh":
            floor, slope = RAYLEIGH
            square = np.cos(np.radians(angle_deg)) ** 2
            return (floor + slope * square)[..., None] * np.ones(len(self.wavelengths_um))
        return np.exp(rows_at(angle_deg, *self._phases[name]))

    @cached_property
    def _phases(self) -> dict:
        """Angles [degrees] and logarithms of the phase functions (angles, k), by column."""
        names = "column", WAVELENGTH, "angle_deg", "phase_sr"
        file = read_table(TABLES / "band_phase.csv", names, "phase functions")
        of_column = np.array([cells[file.columns.index("column")] for _, cells in file.rows])
        table = file.numbers(names[1:])
        phases = {}
        for name in np.unique(of_column):
            wavelengths, angles, values = (table[key][of_column == name] for key in names[1:])
            wavelengths, angles = np.unique(wavelengths), np.unique(angles)
            # The rows are ordered by wavelength and angle
            logarithms = np.log(values).reshape(len(wavelengths), len(angles))
            phases[str(name)] = angles, rows_at(self.wavelengths_um, wavelengths, logarithms).T
        return phases


@lru_cache(maxsize=1)
def bands() -> Bands:
    """The coefficients of the bundled tables."""
    names = WAVELENGTH, "coefficient", "exponent", "scattered_share"
    file = read_table(TABLES / "band_terms.csv", ("column", *names), "band model")
    place = file.columns.index("column")
    of_row = [cells[place] for _, cells in file.rows]
    columns = tuple(dict.fromkeys(of_row))
    table = file.numbers(names)
    sun = read_table(TABLES / "band_sun.csv", (WAVELENGTH, "irradiance_W_m2_um"), "sun")
    wavelengths, irradiance = sun.numbers((WAVELENGTH, "irradiance_W_m2_um")).values()
    rows = [columns.index(name) for name in of_row]
    at = np.searchsorted(wavelengths, table[WAVELENGTH])
    exponents = np.zeros(len(columns))
    exponents[rows] = table["exponent"]  # every absorber has one exponent at all wavelengths
    coefficients, scattering = np.zeros((2, len(columns), len(wavelengths)))
    coefficients[rows, at] = table["coefficient"] ** table["exponent"]
    scattering[rows, at] = table["coefficient"] * table["scattered_share"]
    return Bands(columns, wavelengths, exponents, coefficients, scattering, irradiance)

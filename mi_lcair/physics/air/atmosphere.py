"""Base class of atmospheres, and one line of sight through an atmosphere."""

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from mi_lcair.declared import Bounds
from mi_lcair.errors import InputError
from mi_lcair.physics.air.levels import bands
from mi_lcair.physics.bands import Band, Spectrum

# Light that has crossed air, and what is left of it after more air
# -----------------------------------------------------------------
# Where light crosses two paths one after the other, the amounts of absorbers add, because the lines
# that the first path has blackened are the lines of the second. The product of the transmittances
# of both paths is too small for light that has crossed air, and too large for light that air emits.

MOST_SHARES = 64  # transmittances of one light that are kept
RANGE_M = Bounds(is_positive=True, unit="m")  # to the target
SMALLEST_SHARE = 1e-9  # of the largest radiance, below which a transmittance is not computed


@dataclass(frozen=True, eq=False)
class AirLight(Spectrum):
    """Spectrum of light that has crossed air: sum of sources * transmittance(amounts).

    The emission of layers, B_1 (1 - t_1) + B_2 (t_1 - t_2) + ..., is a sum of this kind, too, with
    sources B_1, B_2 - B_1, ..., which may be negative.

    Attributes
    ----------
    sources
        Radiance of each source before the air [W m^-2 sr^-1 um^-1], (m, k).
    amounts
        Amounts of the absorbers that each source has crossed, (m, c).
    """

    sources: np.ndarray
    amounts: np.ndarray

    @staticmethod
    def of(name: str, sources: np.ndarray, amounts: np.ndarray) -> "AirLight":
        """The light of some sources (m, k) after amounts of absorbers (m, c)."""
        radiance = (sources * bands().transmittance(amounts)).sum(axis=0)
        radiance = np.maximum(radiance, 0)
        return AirLight(name, bands().wavelengths_um, radiance, sources, amounts)

    def scaled(self, factor: float) -> "AirLight":
        """The light times a factor."""
        return replace(self, radiance=self.radiance * factor, sources=self.sources * factor)

    def plus(self, other: "AirLight") -> "AirLight":
        """The sum of two lights."""
        return AirLight(
            self.name,
            self.wavelengths_um,
            self.radiance + other.radiance,
            np.vstack([self.sources, other.sources]),
            np.vstack([self.amounts, other.amounts]),
        )

    def through(self, amounts: np.ndarray) -> np.ndarray:
        """Spectrum after more air [W m^-2 sr^-1 um^-1], (k,); amounts: of its absorbers, (c,)."""
        rest = self.sources * bands().transmittance(self.amounts + amounts)
        return np.maximum(rest.sum(axis=0), 0)

    def transmittance(self, amounts: np.ndarray) -> np.ndarray:
        """Share 0..1 of the light that more air transmits, (k,); amounts: of its absorbers, (c,).

        Where there is no light, the share is that of light that has crossed no air.
        """
        key = amounts.tobytes()
        if key not in self._shares:
            if len(self._shares) > MOST_SHARES:
                self._shares.clear()
            known = self.radiance > SMALLEST_SHARE * self.radiance.max()
            plain = bands().transmittance(amounts)
            self._shares[key] = np.divide(
                self.through(amounts), self.radiance, out=plain, where=known
            )
        return self._shares[key]

    @cached_property
    def _shares(self) -> dict:
        """Transmittances for amounts, which searches and tolerances ask for again and again."""
        return {}


VACUUM = "vacuum"
PAST_GROUND = (
    "the line of sight goes past the ground; lower elevation_deg of [observer], or give "
    "[background] a sky or a temperature"
)
RANGES_AT_ONCE = 1024  # ranges of a long list that are computed together, to bound the memory
LIGHT_RANGES = 32  # ranges at which light that has crossed air is computed, others between them


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
    amounts
        Amounts of absorbers along the path, (c,), see `mi_lcair.physics.air.levels`; None for a
        table, which does not know them.
    shares
        Function that gives the transmittance for light that has crossed air before, (n,). None if
        it is computed from the amounts.
    """

    range_m: float
    wavelengths_um: np.ndarray
    transmittance: np.ndarray
    radiance: np.ndarray
    amounts: np.ndarray | None = None
    shares: Callable[[AirLight], np.ndarray] | None = None

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

    def share(self, light: Spectrum | None, wavelengths_um: ArrayLike) -> np.ndarray:
        """Transmittance for a light at some wavelengths [um].

        Light that has crossed air before gets the amounts of both paths. For other light, and on
        the path of a table, it is the transmittance of the path.
        """
        light = light and (light.bin_of or light)
        if self.amounts is None or not isinstance(light, AirLight):
            return self.at(wavelengths_um)[0]
        share = light.transmittance(self.amounts) if self.shares is None else self.shares(light)
        return np.interp(wavelengths_um, self.wavelengths_um, share)


class Atmosphere:
    """Transmittance and path radiance of the air between target and sensor, over the range.

    A subclass sets the attributes and defines `along`.

    Attributes
    ----------
    name : str
        Name or path with which the atmosphere was read.
    ranges_m : ndarray, shape (n,)
        Rising ranges [m] between which values are interpolated. The last one is the longest. Empty
        for vacuum, which covers every band and range.
    wavelengths_um : ndarray, shape (k,)
        Rising wavelengths [um]; empty for vacuum.
    """

    name: str
    ranges_m: np.ndarray
    wavelengths_um: np.ndarray

    @property
    def is_vacuum(self) -> bool:
        """Whether this is vacuum, which transmits everything and emits nothing."""
        return self.wavelengths_um.size == 0

    def along(self, ranges_m: np.ndarray, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Transmittance and path radiance at ranges [m] and wavelength indices, (ranges, rows)."""
        raise NotImplementedError

    def light_transmittance(
        self, light: Spectrum, ranges_m: np.ndarray, rows: np.ndarray
    ) -> np.ndarray:
        """Transmittance for light that has crossed air before, (ranges, rows)."""
        return self.along(ranges_m, rows)[0]

    def path(self, range_m: float, extrapolate: bool = False) -> LineOfSight:
        """The line of sight of length `range_m` [m].

        Raises InputError for a range that is not positive, or that lies beyond the last one. With
        `extrapolate`, the optical depth beyond a table follows its last power of range instead,
        and a Python warning says so.
        """
        ranges = self._checked([range_m], extrapolate)
        transmittance, radiance = self.along(ranges, slice(None))
        return LineOfSight(float(ranges[0]), self.wavelengths_um, transmittance[0], radiance[0])

    def check_covers(self, band: Band) -> None:
        """Raise InputError if the table does not cover the band.

        The band `total` has no wavelengths and is always refused, except by vacuum.
        """
        if not self.is_vacuum:
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
        self,
        band: Band,
        spectra: Sequence[Spectrum | np.ndarray],
        ranges_m: ArrayLike,
        extrapolate: bool = False,
    ) -> np.ndarray:
        """Mean transmittance in the band at many ranges, weighted by response and spectrum.

        Parameters
        ----------
        band
            Band with the detector's response.
        spectra
            Source spectra in any unit: (k,) at the atmosphere's wavelengths_um, or a `Spectrum`. A
            spectrum that is 0 in the whole band is replaced by a constant one.
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
        if self.is_vacuum:
            return np.ones((len(spectra), len(self._checked(ranges_m, extrapolate))))
        rows, weights = self._rows(band)
        values = [
            spectrum.at(self.wavelengths_um) if isinstance(spectrum, Spectrum) else spectrum
            for spectrum in spectra
        ]
        of_spectra = np.asarray(values, dtype=float)[:, rows] * weights
        of_spectra[of_spectra.sum(axis=1) == 0] = weights
        of_spectra /= of_spectra.sum(axis=1, keepdims=True)
        means = self._in_pieces(
            ranges_m, extrapolate, lambda ranges: self.along(ranges, rows)[0] @ of_spectra.T
        ).T
        for mean, spectrum, share in zip(means, spectra, of_spectra):
            light = getattr(spectrum, "bin_of", None) or spectrum
            if isinstance(light, AirLight):
                mean[:] = self._in_pieces(
                    ranges_m,
                    extrapolate,
                    lambda ranges: self.light_transmittance(light, ranges, rows) @ share,
                )
        return means

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
            ranges_m, extrapolate, lambda ranges: self.along(ranges, rows)[1] @ weights
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
        starts = range(0, max(len(ranges), 1), RANGES_AT_ONCE)
        return np.concatenate([function(ranges[k : k + RANGES_AT_ONCE]) for k in starts])

    def _checked(self, ranges_m, extrapolate) -> np.ndarray:
        """The ranges [m] as an array; see `path` for what is refused."""
        ranges = np.asarray(ranges_m, dtype=float)
        RANGE_M.check_all(ranges.ravel(), lambda k: f"atmosphere '{self.name}': range")
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
                f"{beyond}: the optical depth is extrapolated with the last power of range",
                stacklevel=3,
            )
        return ranges

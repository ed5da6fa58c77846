"""Clear daytime sky in 3-5 um: its own emission and sunlight scattered once."""

from dataclasses import dataclass

import numpy as np

from mi_lcair.errors import InputError, unknown
from mi_lcair.physics.bands import Band
from mi_lcair.physics.spectrum import BUNDLED, Spectrum
from mi_lcair.physics.sun.sunlight import air_mass
from mi_lcair.table import read_table

SUN_ELEVATION_DEG = 45.0  # of the tables
ELEVATION, AZIMUTH, WAVELENGTH = "elevation_deg", "relative_azimuth_deg", "wavelength_um"
SMALLEST = 1e-15  # stands for a radiance of 0 in logarithms [W m^-2 sr^-1 um^-1]
MEAN_ROWS, MEAN_COLUMNS = 24, 36  # directions for the mean over the sky
RADIANCE, THERMAL = "radiance_W_m2_sr_um", "thermal_W_m2_sr_um"


@dataclass(frozen=True, eq=False)
class DaytimeSky:
    """Spectral radiance of a clear sky with the sun at SUN_ELEVATION_DEG.

    Attributes
    ----------
    name
        Name of the air.
    elevations_deg, azimuths_deg
        Tabulated elevations, (e,), and azimuths from the sun, 0 toward it, (a,) [degrees].
    wavelengths_um
        Rising wavelengths [um], (n,).
    thermal, scattered
        Emission of the air, (e, n), and sunlight scattered once, (e, a, n) [W m^-2 sr^-1 um^-1].
    """

    name: str
    elevations_deg: np.ndarray
    azimuths_deg: np.ndarray
    wavelengths_um: np.ndarray
    thermal: np.ndarray
    scattered: np.ndarray

    def in_band_radiance(self, band: Band, elevation_deg, azimuth_deg) -> np.ndarray:
        """In-band radiance toward directions above the horizon [W m^-2 sr^-1].

        The logarithm of the emission is interpolated over that of the air mass. The logarithm of
        the scattered light is interpolated over the angle from the sun, and then over the logarithm
        of the air mass. Within 10 degrees of the sun, where the tables do not resolve the aureole,
        it is about that at 10 degrees. Below the lowest elevation of the tables, the sky is that
        at this elevation. With one elevation left out of the tables, the radiance in 3-5 um is
        found to 3.1 % away from the sun and to 5 % toward it, except within 10 degrees of the sun,
        where it is up to 23 % too small.

        Parameters
        ----------
        band
            Band that the tables cover.
        elevation_deg, azimuth_deg
            Elevation and azimuth from the sun [degrees], arrays of one shape.

        Raises InputError if the tables do not cover the band.
        """
        if band.is_total:
            raise InputError(f"daytime sky '{self.name}': does not cover band total; choose MWIR")
        band.check_covered(self.wavelengths_um, f"daytime sky '{self.name}'")
        thermal, scattered = (
            band.integral(self.wavelengths_um, part) for part in (self.thermal, self.scattered)
        )
        return self.between(thermal[:, None], scattered[:, :, None], elevation_deg, azimuth_deg)[
            ..., 0
        ]

    def between(self, thermal, scattered, elevation_deg, azimuth_deg) -> np.ndarray:
        """Sum of emission and scattered light between the rows, (..., n).

        thermal, scattered: values at the rows, (e, n) and (e, a, n). elevation_deg, azimuth_deg:
        directions as for `in_band_radiance`, (...).
        """
        thermal, scattered = (np.log(np.maximum(part, SMALLEST)) for part in (thermal, scattered))
        first, last = self.elevations_deg[[0, -1]]
        elevation = np.clip(np.asarray(elevation_deg, dtype=float), first, last)
        angle = from_sun(elevation, azimuth_deg)
        of_rows = []
        for row, values in zip(self.elevations_deg, scattered):
            # At the zenith all azimuths are the same direction
            nodes, places = np.unique(from_sun(row, self.azimuths_deg).round(6), return_index=True)
            of_rows.append(at_places(values[places], np.interp(angle, nodes, range(len(nodes)))))
        masses = -np.log(air_mass(self.elevations_deg))
        x = np.interp(-np.log(air_mass(elevation)), masses, range(len(masses)))
        k = np.minimum(x.astype(int), len(masses) - 2)
        below, above = (
            np.take_along_axis(np.array(of_rows), (k + step)[None, ..., None], axis=0)[0]
            for step in (0, 1)
        )
        share = (x - k)[..., None]
        return np.exp(at_places(thermal, x)) + np.exp((1 - share) * below + share * above)

    def mean_spectrum(self) -> Spectrum:
        """Mean radiance of the sky, weighted by the cosine to the zenith.

        It is the spectral irradiance of the sky on the ground, divided by pi.
        """
        x, weights = np.polynomial.legendre.leggauss(MEAN_ROWS)
        elevation = np.degrees(np.arcsin(np.sqrt((x + 1) / 2)))
        azimuth = (np.arange(MEAN_COLUMNS) + 0.5) * 180 / MEAN_COLUMNS
        directions = np.meshgrid(elevation, azimuth, indexing="ij")
        radiance = self.between(self.thermal, self.scattered, *directions)
        mean = weights / 2 @ radiance.mean(axis=1)
        return Spectrum(f"daytime sky {self.name}", self.wavelengths_um, mean)


def at_places(rows, places) -> np.ndarray:
    """Rows (k, n), linear between them, at places 0..k - 1 (...); (..., n)."""
    k = places.astype(int)
    share = (places - k)[..., None]
    return (1 - share) * rows[k] + share * rows[np.minimum(k + 1, len(rows) - 1)]


def from_sun(elevation_deg, azimuth_deg) -> np.ndarray:
    """Angle between a direction and the sun [degrees]."""
    h, s, azimuth = (
        np.radians(elevation_deg),
        np.radians(SUN_ELEVATION_DEG),
        np.radians(azimuth_deg),
    )
    cos = np.sin(h) * np.sin(s) + np.cos(h) * np.cos(s) * np.cos(azimuth)
    return np.degrees(np.arccos(np.clip(cos, -1, 1)))


def sky_air_names() -> list[str]:
    """Names of the bundled airs whose daytime sky is known."""
    names = (file.stem for file in BUNDLED.glob("skysun_*_clear.csv"))
    return sorted(name.removeprefix("skysun_").removesuffix("_clear") for name in names)


def daytime_sky(air: str) -> DaytimeSky:
    """The daytime sky of a bundled air; raises InputError for an unknown name."""
    if air not in sky_air_names():
        raise unknown("air", air, sky_air_names())
    columns = ELEVATION, AZIMUTH, WAVELENGTH, RADIANCE, THERMAL
    table = read_table(BUNDLED / f"skysun_{air}_clear.csv", columns, "daytime sky").numbers(columns)
    elevations, azimuths, wavelengths = (np.unique(table[name]) for name in columns[:3])
    # The rows are ordered by elevation, azimuth and wavelength
    shape = len(elevations), len(azimuths), len(wavelengths)
    radiance, thermal = (table[name].reshape(shape) for name in columns[3:])
    scattered = np.maximum(radiance - thermal, 0)
    return DaytimeSky(air, elevations, azimuths, wavelengths, thermal[:, 0], scattered)

"""Skies by their words: clear, overcast, a temperature, or a table."""

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
import scipy
from numpy.typing import ArrayLike

from mi_lcair.errors import InputError, unknown
from mi_lcair.physics.air.bands import bands
from mi_lcair.physics.air.levels import HEIGHT_M, Weather
from mi_lcair.physics.air.light import AirLight
from mi_lcair.physics.bands import Band
from mi_lcair.physics.blackbody import in_band_radiance, spectral_radiance
from mi_lcair.physics.sky import (
    SkyTable,
    air_mass,
    check_brightness,
    clear_name,
    has_azimuths,
    has_elevations,
    mean_nodes,
    sky_names,
    spectrum,
    tables_by_azimuth,
)
from mi_lcair.physics.spectrum import Spectrum
from mi_lcair.physics.sun.daytime_sky import (
    MEAN_COLUMNS,
    RINGS_DEG,
    SMALLEST,
    ClearSky,
    azimuth_from_sun,
    between_rings,
    clear_sky,
)
from mi_lcair.table import rows_at

CLEAR, OVERCAST = "clear", "overcast"
HOTTEST_K = 1e4  # largest temperature of a sky, above that of the sun's surface
CLOSE_DEG = 2.0  # largest step between azimuths at which the in-band sky of a file is computed
CLOUD = "stratus"  # cloud of an overcast sky, the lowest one of the tables


@dataclass(frozen=True, eq=False)
class Blackbody(Spectrum):
    """Spectrum of a blackbody at `temperature` [K], times `factor`; it covers every wavelength."""

    temperature: float
    factor: float = 1.0

    @staticmethod
    def of(temperature: float) -> "Blackbody":
        """The spectrum of a blackbody at a temperature [K]."""
        x = bands().wavelengths_um
        return Blackbody(f"{temperature:g} K", x, spectral_radiance(x, temperature), temperature)

    def at(self, wavelengths_um):
        return self.factor * spectral_radiance(wavelengths_um, self.temperature)

    def scaled(self, factor):
        return replace(self, radiance=self.radiance * factor, factor=self.factor * factor)

    def in_band_radiance(self, band):
        return self.factor * float(in_band_radiance(band, self.temperature))


def through_air(light: Spectrum, amounts: np.ndarray) -> AirLight:
    """Light after more air, whose absorbers have these amounts (c,).

    Light that is not known to have crossed air counts as if it had crossed none. It is 0 at
    wavelengths that it does not cover.
    """
    if isinstance(light, AirLight):
        return AirLight.of(light.name, light.sources, light.amounts + amounts)
    x = bands().wavelengths_um
    covered = isinstance(light, Blackbody) | (light.wavelengths_um[0] <= x) & (
        x <= light.wavelengths_um[-1]
    )
    return AirLight.of(light.name, np.where(covered, light.at(x), 0)[None], amounts[None])


class TableSky:
    """A sky from a table, or of one temperature; it knows no sun and no height.

    source: bundled name or file, or a temperature [K].
    """

    horizon_deg = 0.0  # elevation of the horizon [degrees]
    by_azimuth = False

    def __init__(self, source: str | float):
        self.source = source
        self.temperature = source if isinstance(source, float) else None
        self.by_elevation = self.temperature is None and has_elevations(source)
        self.name = f"{source:g} K" if self.temperature else str(source)
        light = self.at(45.0)
        if np.any(light.radiance > spectral_radiance(light.wavelengths_um, HOTTEST_K)):
            raise InputError(
                f"surroundings: sky {self.name} is brighter than the sun's surface; its radiance "
                "must be in W m^-2 sr^-1 um^-1"
            )
        if self.temperature is None:
            check_brightness(source)

    def components(self, elevation_deg: float, azimuth_deg: float = 0.0) -> list[Spectrum]:
        """Spectrum at an elevation [degrees]."""
        if self.temperature is not None:
            return [Blackbody.of(self.temperature)]
        return [spectrum(self.source, np.clip(elevation_deg, 0, 90) if self.by_elevation else None)]

    def at(self, elevation_deg: float, azimuth_deg: float = 0.0) -> Spectrum:
        """Spectrum at an elevation and, by day, an azimuth from the sun [degrees]."""
        first, *rest = self.components(elevation_deg, azimuth_deg)
        return replace(first, radiance=first.radiance + rest[0].radiance) if rest else first

    def in_band_components(
        self, band: Band, elevation_deg: ArrayLike, azimuth_deg: ArrayLike = 0.0
    ) -> list[np.ndarray]:
        """In-band radiance at elevations [degrees] [W m^-2 sr^-1]."""
        elevation, _ = np.broadcast_arrays(np.asarray(elevation_deg, dtype=float), azimuth_deg)
        if not self.by_elevation:
            value = self.components(0)[0].in_band_radiance(band)
            return [np.full(elevation.shape, value)]
        rings = np.array(RINGS_DEG, dtype=float)
        values = np.array([self.components(ring)[0].in_band_radiance(band) for ring in rings])
        return [between_rings(np.maximum(elevation, 0), rings, values)]

    @cached_property
    def on_ground(self) -> list[tuple[float, Spectrum]]:
        """Radiance of the sky that white ground reflects, as spectra with factors that add up."""
        if not self.by_elevation:
            return [(1.0, *self.components(0))]
        return [(weight, *self.components(ring)) for ring, weight in zip(*mean_nodes())]


class SunlitTable(TableSky):
    """A sky by day, from a file with azimuths from the sun, on whose sides the sky is the same.

    Its components are the least radiance over the azimuth, and the rest, which is mainly sunlight.
    Between azimuths the logarithms are linear. sun_elevation_deg: true elevation of the sun.
    """

    by_azimuth = True

    def __init__(self, source: str, sun_elevation_deg: float):
        super().__init__(source)
        self.sun_elevation_deg = sun_elevation_deg

    @cached_property
    def tables(self) -> tuple[np.ndarray, list[SkyTable]]:
        """Azimuths from the sun [degrees], and the sky at each."""
        return tables_by_azimuth(self.source)

    def spectra(self, elevation_deg: float, azimuths_deg: ArrayLike) -> np.ndarray:
        """Spectral radiance at azimuths from the sun, (a, k); see `at`."""
        azimuths, tables = self.tables
        elevation = float(np.clip(elevation_deg, 0, 90))
        rows = np.array([table.at(elevation).radiance for table in tables])
        from_sun = abs((np.asarray(azimuths_deg, dtype=float) + 180) % 360 - 180)
        return np.exp(rows_at(from_sun, azimuths, np.log(np.maximum(rows, SMALLEST))))

    def components(self, elevation_deg, azimuth_deg=0.0):
        azimuths, (table, *_) = self.tables
        name, x = f"{self.name} {elevation_deg:g} deg", table.wavelengths_um
        spectra = self.spectra(elevation_deg, [*azimuths, azimuth_deg])
        least = spectra.min(axis=0)
        return [Spectrum(name, x, least), Spectrum(name, x, spectra[-1] - least)]

    def scattered_by(self, elevation_deg: float, angle_deg: float) -> Spectrum:
        """Mean over the azimuth of the second component, whose shape stands for all angles."""
        mean, least = self.mean(elevation_deg), self.components(elevation_deg)[0]
        return replace(mean, radiance=np.maximum(mean.radiance - least.radiance, 0))

    def mean(self, elevation_deg: float) -> Spectrum:
        """Mean over the azimuth."""
        middles = (np.arange(MEAN_COLUMNS) + 0.5) * 180 / MEAN_COLUMNS
        light = self.spectra(elevation_deg, middles).mean(axis=0)
        return replace(self.components(elevation_deg)[0], radiance=light)

    def in_band_components(self, band, elevation_deg, azimuth_deg=0.0):
        azimuths, (table, *_) = self.tables
        x = table.wavelengths_um
        band.check_covered(x, f"sky '{self.name}'")
        rings = np.union1d(RINGS_DEG, table.elevations_deg)
        azimuths = np.union1d(azimuths, np.arange(0, 180 + CLOSE_DEG, CLOSE_DEG))
        total = np.array([self.spectra(ring, azimuths) for ring in rings])
        least = np.broadcast_to(total.min(axis=1, keepdims=True), total.shape)
        values = np.stack([band.integral(x, least), band.integral(x, total)], axis=-1)
        between = scipy.interpolate.RegularGridInterpolator(
            (-np.log(air_mass(rings)), azimuths), np.log(values)
        )
        from_sun = abs((np.asarray(azimuth_deg, dtype=float) + 180) % 360 - 180)
        least, total = np.exp(
            between((-np.log(air_mass(np.clip(elevation_deg, 0, 90))), from_sun))
        ).T
        return [least.T, (total - least).T]

    def in_band_by_angle(self, band, elevation_deg, angle_deg):
        azimuth = azimuth_from_sun(elevation_deg, angle_deg, self.sun_elevation_deg)
        return self.in_band_components(band, elevation_deg, azimuth)

    @cached_property
    def on_ground(self):
        return [(weight, self.mean(ring)) for ring, weight in zip(*mean_nodes())]


def sky_name(word: str, atmosphere: str) -> str:
    """The bundled sky that "clear" or "overcast" stands for; any other word is returned."""
    return {CLEAR: f"{atmosphere}_clear", OVERCAST: f"{atmosphere}_{CLOUD}"}.get(word, word)


def sky_of(
    word: str | float | Path,
    atmosphere: str,
    sun_elevation_deg: float | None = None,
    height_m: float | None = None,
    weather: Weather = Weather(),
) -> TableSky | ClearSky:
    """The sky that a word describes.

    Parameters
    ----------
    word
        "clear"; "overcast", a full cover of low clouds; a temperature [K], of an even black sky; a
        bundled sky, or a file as `physics.sky.spectrum` takes it.
    atmosphere
        Model atmosphere, us_standard or midlat_summer.
    sun_elevation_deg
        Elevation of a sun that lights a clear sky [degrees]; None by night.
    height_m, weather
        Height of the viewer above the ground [m], 50 for None, and weather, for a clear sky.

    Raises
    ------
    InputError
        If the word names no sky, or the sun lights a sky that it cannot.
    """
    text = sky_name(str(word), atmosphere)
    name = clear_name(text)
    if name is not None:
        height_m = HEIGHT_M if height_m is None else height_m
        return clear_sky(
            name, sun_elevation_deg, height_m, weather if name == atmosphere else Weather()
        )
    if str(word) == OVERCAST and sun_elevation_deg is not None:
        raise InputError(
            "surroundings: an overcast sky hides the sun; leave the sun out, or choose a clear sky"
        )
    if has_azimuths(text):
        if sun_elevation_deg is None:
            raise InputError(f"surroundings: sky {text} has azimuths from the sun; give the sun")
        return SunlitTable(text, sun_elevation_deg)
    try:
        kelvin = float(text)
    except ValueError:
        known = sky_names()
        if text not in known and not Path(text).suffix and not Path(text).exists():
            words = CLEAR, OVERCAST, "a temperature in K", *known, "a CSV file"
            raise unknown("sky table", text, words) from None
        return TableSky(text)
    if not 0 < kelvin < HOTTEST_K:
        raise InputError(f"surroundings: sky {text}; a temperature must lie in 0..10000 K")
    return TableSky(kelvin)

"""Sky and ground around a scene: spectral and in-band radiance that arrives from any direction."""

from dataclasses import dataclass, replace
from functools import cached_property, reduce
from pathlib import Path

import numpy as np
import scipy
from numpy.typing import ArrayLike

from mi_lcair.declared import Described, entry, given, rule
from mi_lcair.errors import InputError, unknown
from mi_lcair.physics.air.atmosphere import AirLight
from mi_lcair.physics.air.clear_air import HEIGHT, ClearAir, Ray, SunDirection, clear_air
from mi_lcair.physics.air.levels import HEIGHT_M, Weather, bands
from mi_lcair.physics.bands import Band, Spectrum
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
from mi_lcair.physics.sun import (
    MEAN_COLUMNS,
    RINGS_DEG,
    SMALLEST,
    ClearSky,
    azimuth_from_sun,
    between_rings,
    clear_sky,
    sunlight,
)
from mi_lcair.table import rows_at

# Skies by their words: clear, overcast, a temperature, or a table
# ----------------------------------------------------------------

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
                f"sky {self.name} is brighter than the sun's surface; its radiance "
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


def turned(azimuths_deg: ArrayLike) -> np.ndarray:
    """Angles between azimuths and that of the sun, 0..180 [degrees]."""
    turn = np.abs(np.asarray(azimuths_deg, dtype=float)) % 360
    return np.minimum(turn, 360 - turn)


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
        return np.exp(rows_at(turned(azimuths_deg), azimuths, np.log(np.maximum(rows, SMALLEST))))

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
        places = -np.log(air_mass(np.clip(elevation_deg, 0, 90))), turned(azimuth_deg)
        least, total = np.exp(between(places)).T
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
        raise InputError("an overcast sky hides the sun; leave the sun out, or choose a clear sky")
    if has_azimuths(text):
        if sun_elevation_deg is None:
            raise InputError(f"sky {text} has azimuths from the sun; give the sun")
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
        raise InputError(f"sky {text}; a temperature must lie in 0..10000 K")
    return TableSky(kelvin)


# Sky and ground around a viewer: what arrives from a direction, and the air before the ground
# --------------------------------------------------------------------------------------------

ATMOSPHERE = "us_standard"  # model atmosphere of surroundings that state none
# Angles below the horizon at which ground seen through air is computed [degrees]
GROUND_RINGS_DEG = np.array([0.02, 0.1, 0.3, 1, 2, 4, 8, 15, 28, 50, 90])
# Azimuths from the sun at which sunlight that is scattered before the ground is computed [degrees]
GROUND_AZIMUTHS_DEG = 0, 4, 8, 13, 20, 30, 42, 56, 75, 100, 130, 155, 180
ACROSS_DEG = 90.0  # azimuth from the sun at which its light's way through the air is taken


@dataclass(frozen=True)
class Ground:
    """Flat ground without an end, which reflects diffusely what it does not absorb.

    temperature: [K]. emissivity: 0..1.
    """

    temperature: float
    emissivity: float = 1.0


@dataclass(frozen=True, eq=False)
class Surroundings:
    """Sky and ground around a viewer.

    Directions are elevations from the horizontal, upward, and azimuths from the sun [degrees].
    Radiance from a direction has two components, which depend on different quantities. Above the
    horizon they are what the sky emits, and the sunlight that it scatters. Below it they are what
    the ground emits, and the light of sky, sun and air that comes from there.

    Attributes
    ----------
    sky
        The sky; None for none.
    ground
        The ground; None for none.
    air
        Air between viewer and ground.
    height_m
        Height of the viewer above the ground [m]. None if it is not known: no air is then before
        the ground.
    sun_elevation_deg
        Elevation of the sun that the ground reflects, and whose light the air before it scatters;
        None by night.
    sun_file
        CSV file of the sun's irradiance that the ground reflects; None for that of clear air.
    """

    sky: ClearSky | TableSky | None
    ground: Ground | None
    air: ClearAir
    height_m: float | None = None
    sun_elevation_deg: float | None = None
    sun_file: str | None = None

    @property
    def is_through_air(self) -> bool:
        """Whether there is air between viewer and ground."""
        return self.height_m is not None and self.height_m > 0

    @cached_property
    def horizon_deg(self) -> float:
        """Elevation of the horizon [degrees], 0 or less."""
        return self.air.horizon_deg(self.height_m) if self.is_through_air else 0.0

    def components(self, elevation_deg: float, azimuth_deg: float = 0.0) -> list[Spectrum]:
        """Spectra of the components that arrive from a direction, without those that are 0."""
        if elevation_deg >= self.horizon_deg:
            return [] if self.sky is None else self.sky.components(elevation_deg, azimuth_deg)
        if self.ground is None:
            return []
        along = self.path_to_ground(elevation_deg)
        components = [self.emitted_by_ground(along)]
        other = self.beside_emission(along, azimuth_deg)
        return components if other is None else [*components, other]

    def at(self, elevation_deg: float, azimuth_deg: float = 0.0) -> Spectrum:
        """Spectral radiance from a direction [W m^-2 sr^-1 um^-1].

        Raises InputError for a direction without sky or ground.
        """
        components = self.components(elevation_deg, azimuth_deg)
        if not components:
            missing = "sky" if elevation_deg >= self.horizon_deg else "ground"
            raise InputError(
                f"surroundings: at an elevation of {elevation_deg:g} degrees there is no {missing}"
            )
        if len(components) == 1:
            return components[0]
        no_air = np.zeros(len(bands().columns))
        first, second = (through_air(component, no_air) for component in components)
        return first.plus(second)

    def path_to_ground(self, elevation_deg: float) -> Ray | None:
        """The ray from the viewer to the ground; None without air between them."""
        return self.air.ray(self.height_m, elevation_deg) if self.is_through_air else None

    def emitted_by_ground(self, along: Ray | None) -> Spectrum:
        """What the ground emits, after the air along a ray."""
        light = Blackbody.of(self.ground.temperature).scaled(self.ground.emissivity)
        return light if along is None else through_air(light, along.amounts[-1])

    def beside_emission(
        self, along: Ray | None, azimuth_deg: float | None = None
    ) -> Spectrum | None:
        """What arrives from the ground's direction without being emitted by it; None for nothing.

        It is light that the ground reflects, and that of the air before it. Without an azimuth,
        scattered sunlight is left out.
        """
        parts = list(self.reflected)
        if along is not None:
            parts = [through_air(light, along.amounts[-1]) for light in parts]
            day = self.sun_elevation_deg is not None and azimuth_deg is not None
            sun = SunDirection(self.sun_elevation_deg, azimuth_deg) if day else None
            parts.append(self.air.emitted(along, sun))
        elif len(parts) > 1:
            parts = [through_air(light, np.zeros(len(bands().columns))) for light in parts]
        return reduce(lambda total, part: total.plus(part), parts) if parts else None

    @cached_property
    def reflected(self) -> list[Spectrum]:
        """Light of sky and sun that the ground reflects; it has the same radiance in all
        directions.
        """
        reflectance = 1 - self.ground.emissivity
        if reflectance == 0:
            return []
        lights = [] if self.sky is None else list(self.sky.on_ground)
        if self.sun_elevation_deg is not None:
            air = self.sky.air if isinstance(self.sky, ClearSky) else self.air
            factor = np.sin(np.radians(self.sun_elevation_deg)) / np.pi
            sun = air.sun(0.0, self.sun_elevation_deg)
            if self.sun_file is not None:
                sun = sunlight(self.sun_file)
            lights.append((factor, sun))
        return [light.scaled(reflectance * factor) for factor, light in lights]

    def in_band_components(
        self, band: Band, elevation_deg: ArrayLike, azimuth_deg: ArrayLike = 0.0
    ) -> tuple[np.ndarray, np.ndarray]:
        """In-band radiance of both components from some directions [W m^-2 sr^-1].

        Parameters
        ----------
        band
            Band with the detector's response.
        elevation_deg, azimuth_deg
            Elevations and azimuths from the sun [degrees], arrays of one shape (...).

        Returns
        -------
        tuple of numpy.ndarray
            The two components, (...) each. Between computed elevations they are interpolated.
        """
        elevation, azimuth = np.broadcast_arrays(
            np.asarray(elevation_deg, dtype=float), np.asarray(azimuth_deg, dtype=float)
        )
        result = np.zeros((2, *elevation.shape))
        above = elevation >= self.horizon_deg
        if self.sky is not None and above.any():
            parts = self.sky.in_band_components(band, elevation[above], azimuth[above])
            for k, part in enumerate(parts):
                result[k, above] = part
        if self.ground is not None and not above.all():
            parts = self._below(band, elevation[~above], azimuth[~above])
            for k, part in enumerate(parts):
                result[k, ~above] = part
        return result[0], result[1]

    def in_band_radiance(
        self, band: Band, elevation_deg: ArrayLike, azimuth_deg: ArrayLike = 0.0
    ) -> np.ndarray:
        """In-band radiance from some directions, see `in_band_components`."""
        return sum(self.in_band_components(band, elevation_deg, azimuth_deg))

    def _below(self, band, elevation, azimuth):
        """The two in-band components below the horizon."""

        def in_band(light):
            return 0.0 if light is None else light.in_band_radiance(band)

        if not self.is_through_air:
            return in_band(self.emitted_by_ground(None)), in_band(self.beside_emission(None))
        rings = GROUND_RINGS_DEG * (1 + self.horizon_deg / 90)
        depths = self.horizon_deg - elevation
        paths = [self.path_to_ground(max(self.horizon_deg - ring, -90.0)) for ring in rings]
        emitted, other = (
            between_rings(depths, rings, [in_band(light(path)) for path in paths])
            for light in (self.emitted_by_ground, self.beside_emission)
        )
        if self.sun_elevation_deg is not None:
            scattered = np.array([self._scattered(band, path) for path in paths]).T
            knots = np.log([between_rings(depths, rings, values) for values in scattered])
            place = np.interp(turned(azimuth), GROUND_AZIMUTHS_DEG, np.arange(len(knots)))
            low = np.minimum(place.astype(int), len(knots) - 2)
            up, column = place - low, np.arange(elevation.size)
            other += np.exp((1 - up) * knots[low, column] + up * knots[low + 1, column])
        return emitted, other

    def _scattered(self, band, along):
        """In-band sunlight that the air along a ray scatters, at GROUND_AZIMUTHS_DEG."""
        sun = SunDirection(self.sun_elevation_deg, ACROSS_DEG)
        through = bands().transmittance(along.amounts + self.air.amounts_to_sun(along, sun))
        sources = self.air.scattering(along, sun, GROUND_AZIMUTHS_DEG)
        return band.integral(bands().wavelengths_um, np.einsum("ank,nk->ak", sources, through))


def surroundings(
    sky: str | float | None,
    ground: Ground | None = None,
    sun_elevation_deg: float | None = None,
    atmosphere: str = ATMOSPHERE,
    height_m: float | None = None,
    weather: Weather = Weather(),
    sun_file: str | None = None,
) -> Surroundings:
    """Sky and ground by their words.

    Parameters
    ----------
    sky
        "clear", "overcast", a temperature [K], a bundled sky or a file, as `sky_of` takes it;
        None for none.
    ground
        The ground; None for none.
    sun_elevation_deg
        Elevation of the sun [degrees]; None by night.
    atmosphere, weather
        Model atmosphere and its weather.
    height_m
        Height of the viewer above the ground [m]. None if it is not known: the sky is then that at
        50 m, and no air is before the ground.
    sun_file
        CSV file of the sun's irradiance at the scene; None for that of the model atmosphere.

    Raises
    ------
    InputError
        If a word is unknown, or a number out of bounds.
    """
    air = clear_air(atmosphere, weather)
    if height_m is not None:
        HEIGHT.check(height_m, "height above the ground")
    above = None if sky is None else sky_of(sky, atmosphere, sun_elevation_deg, height_m, weather)
    if sun_file is not None:
        sunlight(sun_file)  # raises InputError for a file that cannot be used
    return Surroundings(above, ground, air, height_m, sun_elevation_deg, sun_file)


# Surroundings as commands and scenarios state them, and the emitters of scenes that they are
# -------------------------------------------------------------------------------------------

BLACK = "1"  # emissivity of ground that states none


@dataclass(frozen=True)
class Words(
    Described,
    rules=(
        rule(
            lambda t: given(t, ("sky", "ground")),
            "sky and ground are missing; give one of them, or both",
        ),
    ),
):
    """Table [surroundings] of a scenario, and the options of `mi-lcair import`.

    Attributes
    ----------
    sky : str, optional
        "clear", "overcast", the temperature of a uniform black sky, K, a bundled sky or a file. A
        model that is imported with sky facets that have elevation_deg=... in their label takes
        their spectra from it.
    ground : str, optional
        KELVIN or KELVIN,EMISSIVITY or KELVIN,MATERIAL: temperature of the ground, K, and its
        emissivity (1), or a material, whose hemispherical emissivity is used.
    sun : str, optional
        ELEVATION, ELEVATION,AZIMUTH or ELEVATION,AZIMUTH,FILE: the sun in the scene's axes,
        degrees; azimuth 0 is +x, and 90 is +y. FILE is a CSV wavelength_um,irradiance_W_m2_um with
        the irradiance at the scene, in place of that of clear air. Without a sun, it is night.
    atmosphere : str
        Clear air of sky, sun and ground: us_standard (the default) or midlat_summer. A scenario
        without it takes the clear air of its path.
    """

    sky: str | None = entry(None, is_file=True)
    ground: str | None = None
    sun: str | None = None
    atmosphere: str = ATMOSPHERE

    def complete(self) -> None:
        self.at_height(None)  # raises InputError for what cannot be used

    def at_height(self, height_m: float | None) -> Surroundings:
        """The `Surroundings` at a height [m]; the ground is black if it has a material."""
        ground = None
        if self.ground is not None:
            temperature, material = self.ground_parts
            ground = Ground(temperature, number(material) or 1.0)
        elevation = None if self.sun is None else self.sun_parts[0]
        of_sky = self.sky, ground, elevation, self.atmosphere, height_m
        return surroundings(*of_sky, sun_file=self.sun_file)

    @cached_property
    def ground_parts(self) -> tuple[float, str]:
        """Temperature of the ground [K], and its emissivity or material."""
        kelvin, _, material = self.ground.partition(",")
        temperature, material = number(kelvin), material.strip() or BLACK
        emissivity = number(material)
        if temperature is None or not 0 < temperature <= 1e5:
            raise InputError(
                f"ground {self.ground}: must be KELVIN, KELVIN,EMISSIVITY or KELVIN,MATERIAL, such "
                "as 288,0.95"
            )
        if emissivity is not None and not 0 < emissivity <= 1:
            raise InputError(f"ground {self.ground}: an emissivity must lie in 0..1, above 0")
        return temperature, material

    @cached_property
    def sun_parts(self) -> tuple[float, float]:
        """Elevation and azimuth of the sun [degrees]."""
        parts = [number(part) for part in self.sun.split(",")[:2]]
        if None in parts or number(self.sun_file or "") is not None or not 1 <= parts[0] <= 90:
            raise InputError(
                f"sun {self.sun}: must be ELEVATION, ELEVATION,AZIMUTH or ELEVATION,AZIMUTH,FILE, "
                "in degrees and with an elevation in 1..90, such as 45,120"
            )
        return parts[0], ([*parts, 0.0])[1]

    @property
    def sun_file(self) -> str | None:
        """The file of the sun's irradiance; None for the sun of clear air."""
        parts = [] if self.sun is None else self.sun.split(",", 2)
        return (parts[2].strip() or None) if len(parts) == 3 else None

    @property
    def sky_file(self) -> str | None:
        """The file of the sky; None for a sky without one."""
        known = self.sky in (None, CLEAR, OVERCAST, *sky_names()) or number(self.sky) is not None
        return None if known else self.sky

    def emitters(self, band: str) -> list[dict]:
        """Properties of the emitters `sky` and `sun` of a scene in a band."""
        sky = {"type": "sky", "band": band, "sky": self.sky or "none"}
        sky["atmosphere"] = self.atmosphere
        if self.ground is not None:
            temperature, material = self.ground_parts
            sky |= {"ground_temperature": temperature, "ground_material": material}
        if self.sun is None:
            return [sky]
        elevation, azimuth = self.sun_parts
        sun = {"type": "sun", "band": band, "air": self.sun_file or self.atmosphere}
        sun |= {"elevation_deg": elevation, "azimuth_deg": azimuth}
        sky |= {} if self.sun_file is None else {"sun_file": self.sun_file}
        return [sky | {"sun_elevation_deg": elevation, "sun_azimuth_deg": azimuth}, sun]


def number(text: str) -> float | None:
    """The finite number that a text is; None for another text."""
    try:
        value = float(text)
    except ValueError:
        return None
    return value if abs(value) < 1e30 else None

"""The sun: its position, its light through the air, and the sky that it lights."""

import os
import warnings
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from functools import cached_property, lru_cache
from pathlib import Path

import numpy as np
import scipy
from numpy.typing import ArrayLike

from mi_lcair.errors import InputError, unknown
from mi_lcair.physics.air.atmosphere import AirLight
from mi_lcair.physics.air.clear_air import ELEVATION, ClearAir, SunDirection, clear_air
from mi_lcair.physics.air.levels import HEIGHT_M, Weather, bands, model_names
from mi_lcair.physics.bands import BUNDLED, Band, Spectrum
from mi_lcair.physics.sky import air_mass, mean_nodes
from mi_lcair.physics.spectral_table import spectral_table
from mi_lcair.table import LARGEST

# Clear sky by night and by day: its own emission, and sunlight scattered once
# ----------------------------------------------------------------------------

SUN_ELEVATION_DEG = 45.0  # of a sky that states none
# Elevations above the horizon at which the sky is computed [degrees], for any height
RINGS_DEG = 0, 0.1, 0.22, 0.36, 0.55, 0.8, 1.15, 1.7, 2.5, 3.7, 5.5, 9, 14, 22, 34, 52, 72, 90
ANGLES_DEG = np.concatenate([np.arange(0, 20, 1.0), np.arange(20, 181, 4.0)])  # from the sun
MEAN_COLUMNS = 18  # azimuths for the mean over the sky
ABOVE_HORIZON_DEG = 1e-3  # elevation of the lowest ray above the horizon, lest it meet the ground
SMALLEST = 1e-30  # stands for a radiance of 0 in logarithms [W m^-2 sr^-1]


@dataclass(frozen=True)
class ClearSky:
    """A clear sky by night, or by day with the sun, seen from one height.

    Attributes
    ----------
    air
        Clear air.
    height_m
        Height of the viewer above the ground [m].
    sun_elevation_deg
        True elevation of the sun [degrees]; None by night.
    weather
        Weather of the air.
    """

    air: ClearAir
    height_m: float
    sun_elevation_deg: float | None = None
    weather: Weather = Weather()

    temperature = None  # it has not one temperature
    by_elevation = True

    @property
    def by_azimuth(self) -> bool:
        """Whether it depends on the azimuth, as by day."""
        return self.sun_elevation_deg is not None

    @property
    def name(self) -> str:
        """Name of the air."""
        return self.air.name

    @cached_property
    def horizon_deg(self) -> float:
        """Elevation of the horizon [degrees], 0 or less."""
        return self.air.horizon_deg(self.height_m)

    def at(self, elevation_deg: float, azimuth_deg: float = 0.0) -> AirLight:
        """The sky at an elevation and an azimuth from the sun [degrees], as light through air."""
        emitted, *scattered = self.components(elevation_deg, azimuth_deg)
        total = emitted.plus(*scattered) if scattered else emitted
        return replace(total, name=f"{self.name}_clear {elevation_deg:g} deg")

    def components(self, elevation_deg: float, azimuth_deg: float = 0.0) -> list[AirLight]:
        """What the air emits and, by day, the sunlight that it scatters, as in `at`."""
        emitted = self.air.sky(self.height_m, elevation_deg)
        if self.sun_elevation_deg is None:
            return [emitted]
        sun = SunDirection(self.sun_elevation_deg, azimuth_deg)
        along = self.air.ray(self.height_m, elevation_deg)
        return [emitted, self.air.scattered(along, sun)]

    def in_band_components(
        self, band: Band, elevation_deg: ArrayLike, azimuth_deg: ArrayLike = 0.0
    ) -> list[np.ndarray]:
        """In-band radiance of what the air emits and, by day, of the sunlight that it scatters.

        elevation_deg, azimuth_deg: elevation and azimuth from the sun [degrees], arrays of one
        shape. See `in_band_by_angle`.
        """
        elevation, azimuth = np.broadcast_arrays(
            np.asarray(elevation_deg, dtype=float), np.asarray(azimuth_deg, dtype=float)
        )
        is_night = self.sun_elevation_deg is None
        angle = azimuth if is_night else self.from_sun(elevation, azimuth)
        return self.in_band_by_angle(band, elevation, angle)

    def in_band_by_angle(
        self, band: Band, elevation_deg: np.ndarray, angle_deg: np.ndarray
    ) -> list[np.ndarray]:
        """In-band radiance of what the air emits and, by day, of the sunlight that it scatters.

        It is computed at RINGS_DEG. Between them the logarithms are interpolated over that of the
        air mass, see `between_rings`. There is no aureole of multiple scattering.

        Parameters
        ----------
        band
            Band within 3-5 um or 7-14 um.
        elevation_deg, angle_deg
            Elevation, and angle from the sun [degrees], arrays of one shape; the angle may be one
            that no direction at the elevation has.

        Raises InputError if the air is not known in the band.
        """
        what = f"clear sky '{self.name}'"
        band.check_covered(bands().wavelengths_um, what)
        rings = self.horizon_deg + np.array(RINGS_DEG) * (1 - self.horizon_deg / 90)
        rings[[0, -1]] = rings[0] + ABOVE_HORIZON_DEG, 90.0
        emitted, scattered = map(np.array, zip(*(self.ring(band, ring) for ring in rings)))
        above, rings = np.maximum(elevation_deg - self.horizon_deg, 0), rings - self.horizon_deg
        components = [between_rings(above, rings, emitted)]
        if self.sun_elevation_deg is not None:
            places = -np.log(air_mass(rings))
            logarithms = scipy.interpolate.RegularGridInterpolator(
                (places, ANGLES_DEG), np.log(np.maximum(scattered, SMALLEST))
            )
            at = np.clip(-np.log(air_mass(above)), places[0], places[-1])
            components.append(np.exp(logarithms((at, angle_deg))))
        return components

    def from_sun(self, elevation_deg: ArrayLike, azimuth_deg: ArrayLike) -> np.ndarray:
        """Angle between directions and the sun [degrees]."""
        h, s, azimuth = np.radians(elevation_deg), np.radians(self.sun_elevation_deg), azimuth_deg
        cosine = np.sin(h) * np.sin(s) + np.cos(h) * np.cos(s) * np.cos(np.radians(azimuth))
        return np.degrees(np.arccos(np.clip(cosine, -1, 1)))

    def ring(self, band: Band, elevation_deg: float) -> tuple[float, np.ndarray]:
        """In-band emission at an elevation, and light scattered by the angles ANGLES_DEG there.

        The angle from the sun is taken as the same along a ray, as it is without refraction, and
        the way to the sun as that at right angles to the ray's azimuth.
        """
        model = bands()
        weights = band.row_weights(model.wavelengths_um)
        along = self.air.ray(self.height_m, elevation_deg)
        emitted = float(self.air.emitted(along).radiance @ weights)
        scattered = np.zeros(len(ANGLES_DEG))
        if self.sun_elevation_deg is None:
            return emitted, scattered
        to_sun = self.air.amounts_to_sun(along, SunDirection(self.sun_elevation_deg, 90.0))
        through = model.transmittance(along.amounts + to_sun) * model.sun * weights
        for k, amount in enumerate(np.diff(along.amounts, axis=0).T):
            if amount.any() and model.scattering[k].any():
                light = amount @ (through[1:] + through[:-1]) / 2 * model.scattering[k]
                scattered += model.phase(k, ANGLES_DEG) @ light
        return emitted, scattered

    def scattered_by(self, elevation_deg: float, angle_deg: float) -> AirLight:
        """Sunlight that the air at an elevation would scatter from a sun at an angle from there.

        The way to the sun is that at right angles to the ray's azimuth, as in `ring`.
        """
        along = self.air.ray(self.height_m, elevation_deg)
        sources = self.air.scattering(along, SunDirection(elevation_deg + angle_deg), [0.0])[0]
        sun = SunDirection(self.sun_elevation_deg, 90.0)
        amounts = along.amounts + self.air.amounts_to_sun(along, sun)
        return AirLight.of(f"sunlight scattered by {angle_deg:g}", sources, amounts)

    def mean_spectrum(self) -> AirLight:
        """Mean radiance of the sky, weighted by the cosine to the zenith.

        It is the spectral irradiance of the sky on the ground, divided by pi.
        """
        azimuths = (np.arange(MEAN_COLUMNS) + 0.5) * 180 / MEAN_COLUMNS
        mean = None
        for elevation, weight in zip(*mean_nodes()):
            along = self.air.ray(self.height_m, elevation)
            part = self.air.emitted(along)
            if self.sun_elevation_deg is not None:
                sun = SunDirection(self.sun_elevation_deg, 90.0)
                sources = self.air.scattering(along, sun, azimuths).mean(axis=0)
                amounts = along.amounts + self.air.amounts_to_sun(along, sun)
                part = part.plus(AirLight.of("", sources, amounts))
            part = part.scaled(weight)
            mean = part if mean is None else mean.plus(part)
        return replace(mean, name=f"clear sky {self.name}")

    @cached_property
    def on_ground(self) -> list[tuple[float, Spectrum]]:
        """Radiance of the sky that white ground reflects, as spectra with factors that add up."""
        return [(1.0, _mean_spectrum(replace(self, height_m=0.0)))]


@lru_cache(maxsize=16)
def _mean_spectrum(sky: ClearSky) -> AirLight:
    """Mean radiance of a sky, computed once for all scenes under it."""
    return sky.mean_spectrum()


def between_rings(places: np.ndarray, rings: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Values between elevations; their logarithms are smooth over that of the air mass.

    places, rings: elevations above the horizon [degrees], any shape and rising (n,). values: at
    the rings, (n,).
    """
    at, of_rings = -np.log(air_mass(places)), -np.log(air_mass(rings))
    logarithms = scipy.interpolate.PchipInterpolator(of_rings, np.log(np.maximum(values, SMALLEST)))
    return np.exp(logarithms(np.clip(at, of_rings[0], of_rings[-1])))


def azimuth_from_sun(
    elevation_deg: np.ndarray, angle_deg: np.ndarray, sun_elevation_deg: float
) -> np.ndarray:
    """Azimuths from the sun of directions at an angle from it [degrees], or the closest ones."""
    h, s = np.radians(elevation_deg), np.radians(sun_elevation_deg)
    across = np.maximum(np.cos(h) * np.cos(s), SMALLEST)
    cosine = (np.cos(np.radians(angle_deg)) - np.sin(h) * np.sin(s)) / across
    return np.degrees(np.arccos(np.clip(cosine, -1, 1)))


def clear_sky(
    air: str,
    sun_elevation_deg: float | None = None,
    height_m: float = HEIGHT_M,
    weather: Weather = Weather(),
) -> ClearSky:
    """The sky of a clear air, by day with a sun at sun_elevation_deg [degrees].

    height_m: of the viewer above the ground [m]. Raises InputError for an unknown name, and for a
    sun below 1 degree.
    """
    if sun_elevation_deg is not None:
        ELEVATION.check(sun_elevation_deg, f"clear sky '{air}': elevation of the sun")
    return ClearSky(clear_air(air, weather), height_m, sun_elevation_deg, weather)


# Position of the sun in the sky, by place and time; needs the optional library astropy
# -------------------------------------------------------------------------------------

FIRST_YEAR, LAST_YEAR = 1900, 2100  # in which the Earth's rotation is known well enough
# Air near the ground, for the refraction of the sun's rays: pressure [hPa], temperature [deg C],
# relative humidity, and wavelength [um], on which refraction hardly depends in the infrared.
PRESSURE_HPA, TEMPERATURE_C, HUMIDITY, WAVELENGTH_UM = 1013.25, 15.0, 0.5, 4.0


@dataclass(frozen=True)
class SunPosition:
    """Direction toward the sun, and its distance.

    compass_deg: azimuth from north through east [degrees]. elevation_deg: apparent elevation,
    raised by refraction [degrees]. distance_au: [astronomical units].
    """

    compass_deg: float
    elevation_deg: float
    distance_au: float


def sun_position(latitude_deg: float, longitude_deg: float, time: str) -> SunPosition:
    """The sun at a place and time.

    Parameters
    ----------
    latitude_deg, longitude_deg : float
        Place, positive to the north and to the east [degrees].
    time : str
        ISO 8601 with a time zone, such as 2026-06-21T12:00:00Z or 2026-06-21T14:00+02:00.

    Returns
    -------
    SunPosition

    Raises
    ------
    InputError
        If the time cannot be read or lies outside 1900..2100, or astropy is not installed.
    """
    moment = utc(time)
    try:
        from astropy import coordinates, units
        from astropy.time import Time
        from astropy.utils import iers
    except ImportError:
        raise InputError(
            "a sun by place and time needs astropy; pip install 'mi_lcair[place]', or give "
            "azimuth_deg and elevation_deg"
        ) from None
    # The tables of the Earth's rotation that come with astropy are enough; nothing is downloaded.
    # Outside them the sun is known to 0.01 degrees.
    with (
        iers.conf.set_temp("auto_download", False),
        iers.conf.set_temp("auto_max_age", None),
        iers.conf.set_temp("iers_degraded_accuracy", "ignore"),
        warnings.catch_warnings(),
    ):
        warnings.simplefilter("ignore")
        when = Time(moment.replace(tzinfo=None), scale="utc")
        sky = coordinates.AltAz(
            obstime=when,
            location=coordinates.EarthLocation.from_geodetic(longitude_deg, latitude_deg),
            pressure=PRESSURE_HPA * units.hPa,
            temperature=TEMPERATURE_C * units.deg_C,
            relative_humidity=HUMIDITY,
            obswl=WAVELENGTH_UM * units.um,
        )
        sun = coordinates.get_sun(when)
        seen = sun.transform_to(sky)
    return SunPosition(float(seen.az.deg), float(seen.alt.deg), float(sun.distance.au))


def utc(time: str) -> datetime:
    """The moment that a text names; raises InputError if it names none."""
    try:
        moment = datetime.fromisoformat(time)
    except ValueError:
        moment = None
    if moment is None or moment.tzinfo is None:
        raise InputError(
            f"time '{time}' must be a date and time with a time zone, such as 2026-06-21T12:00:00Z"
        )
    if not FIRST_YEAR < moment.year < LAST_YEAR:
        raise InputError(f"time '{time}' must lie between the years {FIRST_YEAR} and {LAST_YEAR}")
    return moment.astimezone(UTC)


# Sunlight: spectral irradiance of the sun outside the air, through clear air, or measured
# ----------------------------------------------------------------------------------------
# The irradiance is that of the direct sun on a plane perpendicular to it. It is also the radiance
# of an even disc whose projected solid angle is 1 sr.

NO_AIR = "none"
OUTSIDE_AIR = "E490"  # name of the spectrum outside the air
IRRADIANCE = "irradiance_W_m2_um"
# Rows between those of ASTM E490, whose own rows are up to 1 um apart at 10 um. On straight lines
# between rows in these steps, a curve that is straight in logarithms has an error below 1e-5.
STEP = 0.002
LONGEST_UM = 30.0  # the last row outside the air; beyond it the steps would become gaps


def air_names() -> list[str]:
    """Names of the clear airs through which the sun shines, and "none" for no air."""
    return [*model_names(), NO_AIR]


def sunlight(
    air=NO_AIR,
    elevation_deg=None,
    distance_au: float | None = None,
    height_m: float = HEIGHT_M,
    weather: Weather = Weather(),
) -> Spectrum:
    """The sunlight through an air, as the radiance of a disc of 1 sr.

    Parameters
    ----------
    air : str or Path
        "none": outside the air, ASTM E490-00a, interpolated in logarithms. "midlat_summer" or
        "us_standard": through that clear air, with LOWTRAN7's own sun. Or the path of a CSV file
        wavelength_um,irradiance_W_m2_um with the irradiance at the scene.
    elevation_deg : float or None
        Apparent elevation of the sun above the horizon, 1..90 [degrees]; only a clear air needs it.
    distance_au : float or None
        Distance of the sun [astronomical units]; None for 1.
    height_m : float
        Height of the scene above the ground [m], for a clear air.
    weather : Weather
        Weather of a clear air.

    Returns
    -------
    Spectrum
        An `AirLight` through a clear air.

    Raises
    ------
    InputError
        If the name is unknown, the file holds no irradiance, a distance is given for a file, or the
        height or the elevation is out of bounds.
    """
    path = Path(air)
    if str(air) == NO_AIR:
        x, irradiance = outside_air()
    elif str(air) in air_names():
        return clear_air(str(air), weather).sun(height_m, elevation_deg, distance_au or 1.0)
    elif not path.suffix and not os.path.exists(path):
        raise unknown("air", str(air), [*air_names(), "a CSV file"])
    else:
        table = spectral_table(path, "sunlight", ((IRRADIANCE, LARGEST),))
        if distance_au is not None:
            raise InputError(
                f"sunlight {path}: distance_au = {distance_au:g}, but a file contains the "
                "irradiance at the scene; leave the distance out"
            )
        return Spectrum(str(air), table.wavelengths_um, table.columns[0])
    return Spectrum(OUTSIDE_AIR, x, irradiance / (distance_au or 1) ** 2)


def outside_air() -> tuple[np.ndarray, np.ndarray]:
    """Wavelengths [um] and irradiance [W m^-2 um^-1] of ASTM E490-00a in steps of STEP or less."""
    file = BUNDLED / "solar_e490.csv"
    table = spectral_table(file, "sunlight", ((IRRADIANCE, LARGEST),))
    x, irradiance = table.wavelengths_um, table.columns[0]
    between = np.exp(np.arange(np.log(x[0]), np.log(LONGEST_UM), STEP))
    fine = np.union1d(between, x[x <= LONGEST_UM])
    return fine, np.exp(np.interp(np.log(fine), np.log(x), np.log(irradiance)))

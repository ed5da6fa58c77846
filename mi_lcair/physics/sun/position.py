"""Position of the sun in the sky, by place and time; needs the optional library astropy."""

import warnings
from dataclasses import dataclass
from datetime import UTC, datetime

from mi_lcair.errors import InputError

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

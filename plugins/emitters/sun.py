r"""Emitter `sun`: a disc of even radiance at infinity, with the sun's spectrum."""

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.physics.air.levels import HEIGHT_M, Weather, model_names
from mi_lcair.physics.bands import Spectrum
from mi_lcair.physics.sun import NO_AIR, air_names, sun_position, sunlight
from mi_lcair.plugins.emission.source import Source
from mi_lcair.plugins.emitters.distant_emitter import DistantEmitter
from mi_lcair.plugins.properties import Property

DIRECTION = "azimuth_deg", "elevation_deg"
PLACE = "latitude_deg", "longitude_deg", "time", "north_deg"


class Sun(DistantEmitter):
    r"""The sun. All surfaces except the sky cast shadows.

    ============= ======= ==========================================================================
    azimuth_deg   float   direction toward the sun: azimuth from +x (the nose of a model that is
                          not turned) toward +y (its left side)
    elevation_deg float   elevation above the x-y plane
    latitude_deg  float   in place of a direction: latitude of the scene, positive to the north
    longitude_deg float   its longitude, positive to the east
    time          string  date and time with a time zone, such as 2026-06-21T12:00:00Z
    north_deg     float   azimuth of north; 90 where +x points to the east
    diameter_deg  float   diameter of the disc, at most 10                                    (0.53)
    band          string  MWIR, LWIR, "a-b" in um, or the CSV file of a response
    air           string  none: ASTM E490 outside the air; midlat_summer, us_standard: through
                          that clear air, for an elevation of 1 or more; or a CSV file
                          wavelength_um,irradiance_W_m2_um with the irradiance at the scene   (none)
    height_m      float   height of the scene above the ground in clear air; a scenario that states
                          the height of its target replaces the default                      (50.0)
    distance_au   float   distance in astronomical units, 1 or that of the time; not for a file
    group         string  label of the sun, `[A-Za-z0-9_-]+`, at most 64 characters            (sun)
    ============= ======= ==========================================================================

    .. code-block:: xml

        <emitter type="sun">
            <float name="azimuth_deg" value="120"/> <float name="elevation_deg" value="45"/>
            <string name="band" value="MWIR"/> <string name="air" value="midlat_summer"/>
        </emitter>

    Give the direction either by `azimuth_deg` and `elevation_deg`, or by `latitude_deg`,
    `longitude_deg`, `time` and `north_deg`. The second way needs astropy (the extra `place`).

    The in-band irradiance on a plane perpendicular to the sun becomes the differentiable parameter
    `irradiance`. Its radiance is the same over the whole disc: there is no limb darkening, and no
    light scattered around the disc.

    `bounce_path` samples directions toward the sun for any value of `emitter_sampling`, because a
    reflected ray almost never points into so small a disc. A ray that points into it by chance is
    also used, with multiple importance sampling. Narrow lobes and mirrors therefore show the glint.
    Surfaces with facet_type = sky represent infinity and do not hide the sun. A scene has at most
    one sun. Mitsuba's own integrators see the sun only with emitter sampling.
    """

    PROPERTIES = (
        Property("azimuth_deg", "float"),
        Property("elevation_deg", "float", lower=-90, upper=90),
        Property("latitude_deg", "float", lower=-90, upper=90),
        Property("longitude_deg", "float", lower=-180, upper=180),
        Property("time", "string"),
        Property("north_deg", "float"),
        Property("diameter_deg", "float", 0.53, is_positive=True, upper=10),
        Property("band", "string", is_file=True),
        Property("air", "string", NO_AIR, is_file=True),
        Property("height_m", "float", lower=0, upper=100_000),
        Property("distance_au", "float", is_positive=True, upper=100),
        Property("group", "string", "sun", is_label=True),
    )

    SCALE, SCALE_UNIT = "irradiance", "W m^-2"
    is_sun = True

    def __init__(self, props):
        super().__init__(props)
        # Mitsuba takes an infinite emitter without a delta flag for the scene's environment
        self.m_flags = mi.EmitterFlags.Infinite | mi.EmitterFlags.DeltaDirection
        azimuth_deg, elevation_deg, self.distance_au = position(self.values)
        radius = np.radians(self.values["diameter_deg"]) / 2
        self.sin_radius, self.sin_half_radius = float(np.sin(radius)), float(np.sin(radius / 2))
        self.solid_angle = 4 * np.pi * self.sin_half_radius**2  # of the disc [sr]
        self.projected_angle = np.pi * self.sin_radius**2  # on a plane perpendicular to it [sr]
        self.stand_at(azimuth_deg, elevation_deg)
        self.height_m = HEIGHT_M if self.values["height_m"] is None else self.values["height_m"]
        self.through_air, self.scale = 1.0, mi.Float(1.0)
        self.shine()

    def stand_at(self, azimuth_deg: float, elevation_deg: float) -> None:
        """Set the position of the sun, without its light, see `shine`."""
        self.azimuth_deg, self.elevation_deg = azimuth_deg, elevation_deg
        # The direction toward the disc's centre, and two unit vectors perpendicular to it. Float32
        # resolves a place on the disc by its offsets along these, but not by its angle's cosine.
        azimuth, elevation = np.radians([self.azimuth_deg, self.elevation_deg])
        sin, cos = np.sin(elevation), np.cos(elevation)
        x, y = np.cos(azimuth), np.sin(azimuth)
        self.centre, self.right, self.up = (
            mi.Vector3f(*map(float, vector))
            for vector in ((cos * x, cos * y, sin), (-y, x, 0), (-sin * x, -sin * y, cos))
        )

    def light(self, weather: Weather) -> Spectrum:
        """Its irradiance in a weather, as the radiance of a disc of 1 sr."""
        elevation_deg = 90 - abs(90 - self.elevation_deg)  # also beyond the zenith
        place = elevation_deg, self.distance_au, self.height_m
        return sunlight(self.values["air"], *place, weather)

    def shine(self) -> None:
        """Set irradiance and spectrum to those of its air; a factor of the irradiance stays."""
        light, before = self.light(self.weather), self.through_air
        self.through_air = float(light.in_band_radiance(self.band))
        # A new array, since motions keep the old one
        self.scale = self.scale * (self.through_air / before)
        self.spectrum = light.scaled(1 / self.projected_angle)

    def move_to(self, azimuth_deg: float, elevation_deg: float) -> None:
        """Let it shine from another direction; a factor of its irradiance stays."""
        self.stand_at(azimuth_deg, elevation_deg)
        self.shine()

    @property
    def clear_air(self) -> str | None:
        return self.values["air"] if self.values["air"] in model_names() else None

    def in_air(self, height_m, weather):
        if self.values["height_m"] is not None or height_m is None:
            height_m = self.height_m
        if self.clear_air and (height_m, weather) != (self.height_m, self.weather):
            self.height_m, self.weather = height_m, weather
            self.shine()

    def spectra_in(self, weather):
        factor = float(self.scale[0]) / self.through_air
        light = self.light(weather).scaled(factor / self.projected_angle)
        in_band = light.in_band_radiance(self.band)
        return [Source(self.group, self.spectrum.name, in_band, spectrum=light)]

    @property
    def radiance(self):
        """In-band radiance of the disc [W m^-2 sr^-1]."""
        return self.scale / self.projected_angle

    def facet_radiance(self):
        return self.radiance

    def refresh(self) -> None:
        super().refresh()
        dr.make_opaque(self.centre, self.right, self.up)

    def covers(self, d):
        """Whether a direction points into the disc."""
        offset = dr.square(dr.dot(d, self.right)) + dr.square(dr.dot(d, self.up))
        return (offset < self.sin_radius**2) & (dr.dot(d, self.centre) > 0)

    def along(self, d, active):
        """Radiance from the direction `d`; 0 outside the disc [W m^-2 sr^-1]."""
        return mi.Spectrum(dr.select(active & self.covers(d), self.radiance, 0))

    # ---------------------------------------------------------------- Directions

    def eval(self, si, active=True):
        return mi.Spectrum(0)  # no ray meets the emitter; `bounce_path` asks `along`

    def drawn(self, sample):
        """A direction toward the disc, uniform over its solid angle."""
        # The square of the sine of half the angle from the centre is uniform
        half = mi.warp.square_to_uniform_disk_concentric(sample) * self.sin_half_radius
        sin2 = dr.squared_norm(half)
        offset = 2 * dr.sqrt(1 - sin2) * half
        return offset.x * self.right + offset.y * self.up + (1 - 2 * sin2) * self.centre

    def density(self, d):
        return dr.select(self.covers(d), mi.Float(1 / self.solid_angle), 0)

    def sample_direction(self, it, sample, active=True):
        # Rounding may put a direction at the disc's edge outside, which counts nevertheless
        ds = self.toward(it, self.drawn(sample), mi.Float(1 / self.solid_angle))
        return ds, mi.Spectrum(dr.select(active, self.radiance * self.solid_angle, 0))

    def eval_direction(self, it, ds, active=True):
        return mi.Spectrum(dr.select(active, self.radiance, 0))

    def to_string(self):
        return (
            f"Sun[azimuth_deg = {self.azimuth_deg:g}, elevation_deg = {self.elevation_deg:g}, "
            f"solid_angle = {self.solid_angle:g}, irradiance = {self.scale}]"
        )


def position(values: dict) -> tuple[float, float, float | None]:
    """Azimuth and elevation [degrees] and distance [au] of the sun from its properties.

    Raises InputError if neither a direction nor a place and time is given, or parts of both.
    """
    given = [name for name in (*DIRECTION, *PLACE) if values[name] is not None]
    if given == [*DIRECTION]:
        return values["azimuth_deg"], values["elevation_deg"], values["distance_au"]
    if given != [*PLACE]:
        raise InputError(
            f"sun: give {' and '.join(DIRECTION)}, or {', '.join(PLACE)}; "
            f"found {', '.join(given) or 'none'}"
        )
    sun = sun_position(values["latitude_deg"], values["longitude_deg"], values["time"])
    if sun.elevation_deg <= 0:
        raise InputError(
            f"sun: at this place and time it is {-sun.elevation_deg:.2f} degrees below the "
            "horizon; choose another time"
        )
    distance_au = values["distance_au"]
    if distance_au is None and values["air"] in air_names():
        distance_au = sun.distance_au
    return values["north_deg"] - sun.compass_deg, sun.elevation_deg, distance_au

"""Clear daytime sky: its own emission and sunlight scattered once."""

from dataclasses import dataclass, replace

import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.physics.air.bands import bands
from mi_lcair.physics.air.clear_air import ClearAir, SunDirection, clear_air
from mi_lcair.physics.air.levels import Weather, model_names
from mi_lcair.physics.air.light import AirLight
from mi_lcair.physics.bands import Band
from mi_lcair.physics.sky import HEIGHT_M, air_mass, mean_nodes

SUN_ELEVATION_DEG = 45.0  # of a sky that states none
# Elevations at which the sky is computed [degrees]; the radiance between them is interpolated
RINGS_DEG = 0, 0.5, 1, 1.5, 2.5, 4, 6, 8, 11, 15, 20, 26, 34, 43, 53, 65, 78, 90
ANGLES_DEG = np.concatenate([np.arange(0, 20, 1.0), np.arange(20, 181, 4.0)])  # from the sun
MEAN_COLUMNS = 18  # azimuths for the mean over the sky
SMALLEST = 1e-30  # stands for a radiance of 0 in logarithms [W m^-2 sr^-1]


@dataclass(frozen=True)
class DaytimeSky:
    """A clear sky with the sun, seen from one height.

    Attributes
    ----------
    air
        Clear air.
    height_m
        Height of the viewer above the ground [m].
    sun_elevation_deg
        True elevation of the sun [degrees].
    """

    air: ClearAir
    height_m: float
    sun_elevation_deg: float

    @property
    def name(self) -> str:
        """Name of the air."""
        return self.air.name

    def at(self, elevation_deg: float, azimuth_deg: float) -> AirLight:
        """The sky at an elevation and an azimuth from the sun [degrees], as light through air."""
        sun = SunDirection(self.sun_elevation_deg, azimuth_deg)
        return self.air.sky(self.height_m, elevation_deg, sun)

    def in_band_radiance(self, band: Band, elevation_deg, azimuth_deg) -> np.ndarray:
        """In-band radiance toward directions above the horizon [W m^-2 sr^-1].

        It is computed at RINGS_DEG. Between them the logarithms of emission and of scattered light
        are interpolated over that of the air mass. There is no aureole of multiple scattering.

        Parameters
        ----------
        band
            Band within 3-5 um or 8-12 um.
        elevation_deg, azimuth_deg
            Elevation and azimuth from the sun [degrees], arrays of one shape.

        Raises InputError if the air is not known in the band.
        """
        what = f"daytime sky '{self.name}'"
        if band.is_total:
            raise InputError(f"{what}: does not cover band total; choose MWIR or LWIR")
        band.check_covered(bands().wavelengths_um, what)
        elevation, azimuth = np.broadcast_arrays(
            np.asarray(elevation_deg, dtype=float), np.asarray(azimuth_deg, dtype=float)
        )
        thermal, scattered = map(np.array, zip(*(self.ring(band, ring) for ring in RINGS_DEG)))
        thermal, scattered = np.log(thermal), np.log(np.maximum(scattered, SMALLEST))
        places = -np.log(air_mass(np.array(RINGS_DEG)))
        place = np.interp(-np.log(air_mass(elevation)), places, np.arange(len(places)))
        low = np.minimum(place.astype(int), len(places) - 2)
        up = place - low
        place = np.interp(self.from_sun(elevation, azimuth), ANGLES_DEG, np.arange(len(ANGLES_DEG)))
        near = np.minimum(place.astype(int), len(ANGLES_DEG) - 2)
        off = place - near
        of_ring = lambda ring: (1 - off) * scattered[ring, near] + off * scattered[ring, near + 1]
        return np.exp((1 - up) * thermal[low] + up * thermal[low + 1]) + np.exp(
            (1 - up) * of_ring(low) + up * of_ring(low + 1)
        )

    def from_sun(self, elevation_deg, azimuth_deg) -> np.ndarray:
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
        to_sun = self.air.amounts_to_sun(along, SunDirection(self.sun_elevation_deg, 90.0))
        through = model.transmittance(along.amounts + to_sun) * model.sun * weights
        scattered = np.zeros(len(ANGLES_DEG))
        for k, amount in enumerate(np.diff(along.amounts, axis=0).T):
            if amount.any() and model.scattering[k].any():
                light = amount @ (through[1:] + through[:-1]) / 2 * model.scattering[k]
                scattered += model.phase(k, ANGLES_DEG) @ light
        return float(self.air.emitted(along).radiance @ weights), scattered

    def mean_spectrum(self) -> AirLight:
        """Mean radiance of the sky, weighted by the cosine to the zenith.

        It is the spectral irradiance of the sky on the ground, divided by pi.
        """
        azimuths = (np.arange(MEAN_COLUMNS) + 0.5) * 180 / MEAN_COLUMNS
        sun = SunDirection(self.sun_elevation_deg, 90.0)
        mean = None
        for elevation, weight in zip(*mean_nodes()):
            along = self.air.ray(self.height_m, elevation)
            scattered = AirLight.of(
                "",
                self.air.scattering(along, sun, azimuths).mean(axis=0),
                along.amounts + self.air.amounts_to_sun(along, sun),
            )
            part = self.air.emitted(along).plus(scattered).scaled(weight)
            mean = part if mean is None else mean.plus(part)
        return replace(mean, name=f"daytime sky {self.name}")


def sky_air_names() -> list[str]:
    """Names of the clear airs whose daytime sky is known."""
    return model_names()


def daytime_sky(
    air: str,
    sun_elevation_deg: float = SUN_ELEVATION_DEG,
    height_m: float = HEIGHT_M,
    weather: Weather = Weather(),
) -> DaytimeSky:
    """The daytime sky of a clear air, with a sun at sun_elevation_deg [degrees].

    height_m: of the viewer above the ground [m]. Raises InputError for an unknown name, and for a
    sun below 1 degree.
    """
    if not 1 <= sun_elevation_deg <= 90:
        raise InputError(
            f"daytime sky '{air}': sun at {sun_elevation_deg:g} degrees; must lie in 1..90"
        )
    return DaytimeSky(clear_air(air, weather), height_m, sun_elevation_deg)

r"""Emitter `sky_dome`: the clear daytime sky, as a source at infinity without a mesh."""

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.physics.sun.daytime_sky import HEIGHT_M, SUN_ELEVATION_DEG, daytime_sky, sky_air_names
from mi_lcair.plugins.emitters.distant_emitter import DistantEmitter
from mi_lcair.plugins.emitters.one_sun import check_fits
from mi_lcair.plugins.properties import Property

# Cells of the table of radiances over the sine of the elevation and over the azimuth from the sun,
# 0 to 180 degrees. Between its nodes the radiance is bilinear.
ROWS, COLUMNS = 128, 90


class SkyDome(DistantEmitter):
    r"""Clear daytime sky above the horizon, with sunlight scattered once.

    ================= ====== =======================================================================
    sun_azimuth_deg   float  azimuth of the sun, from +x toward +y                            (0.0)
    sun_elevation_deg float  elevation of the sun, 1 or more                                 (45.0)
    band              string MWIR, LWIR, or a band within one of them
    air               string midlat_summer or us_standard                           (midlat_summer)
    height_m          float  height of the scene above the ground; a scenario that states the
                             height of its target replaces the default                       (50.0)
    group             string label of the sky, `[A-Za-z0-9_-]+`, at most 64 characters        (sky)
    ================= ====== =======================================================================

    .. code-block:: xml

        <emitter type="sky_dome"> <string name="band" value="MWIR"/> </emitter>

    Rays that escape see the dome, in directions with z > 0; below the horizon it is black. It is
    the environment of the scene, of which there can be one. The parameter `scale` multiplies its
    radiance. With `emitter_sampling`, its directions are drawn, uniformly over the hemisphere.

    A scene may also have a `sun` at the dome's azimuth, and within 5 degrees of its elevation. The
    aureole of multiple scattering around the sun is missing, see `DaytimeSky.in_band_radiance`.
    Where sources are told apart by their spectra, the whole dome has the spectrum of its irradiance
    on the ground.
    """

    PROPERTIES = (
        Property("sun_azimuth_deg", "float", 0.0),
        Property("sun_elevation_deg", "float", SUN_ELEVATION_DEG, lower=1, upper=90),
        Property("height_m", "float", lower=0, upper=100_000),
        Property("band", "string", is_file=True),
        Property("air", "string", "midlat_summer", choices=tuple(sky_air_names())),
        Property("group", "string", "sky", is_label=True),
    )

    def __init__(self, props):
        super().__init__(props)
        self.sun_azimuth_deg = self.values["sun_azimuth_deg"]
        self.sun_elevation_deg = self.values["sun_elevation_deg"]
        self.shine(HEIGHT_M if self.values["height_m"] is None else self.values["height_m"])
        x, y = np.cos(np.radians(self.sun_azimuth_deg)), np.sin(np.radians(self.sun_azimuth_deg))
        self.toward_sun = mi.Vector2f(float(x), float(y))

    def shine(self, height_m: float) -> None:
        """Set radiances and spectrum to those at a height [m]."""
        sky = daytime_sky(self.values["air"], self.sun_elevation_deg, height_m)
        elevation = np.degrees(np.arcsin(np.linspace(0, 1, ROWS + 1)))
        azimuth = np.linspace(0, 180, COLUMNS + 1)
        table = sky.in_band_radiance(self.band, *np.meshgrid(elevation, azimuth, indexing="ij"))
        self.largest = table.max()
        self.table = mi.Float(table.ravel())
        self.spectrum = sky.mean_spectrum()
        self.mean_radiance = self.spectrum.in_band_radiance(self.band)

    def at_height(self, height_m: float) -> None:
        if self.values["height_m"] is None:
            self.shine(height_m)

    def facet_radiance(self):
        """Mean in-band radiance, weighted by the cosine to the zenith [W m^-2 sr^-1]."""
        return self.scale * self.mean_radiance

    def refresh(self) -> None:
        super().refresh()
        dr.make_opaque(self.table, self.toward_sun)

    def check_fits(self, sun) -> None:
        check_fits(sun, self, "the sky_dome")

    def radiance_bound(self) -> np.ndarray:
        return np.array([self.largest * float(dr.detach(self.scale)[0])])

    def along(self, d, active):
        """Radiance from the direction `d`; 0 below the horizon [W m^-2 sr^-1]."""
        along, beside = dr.dot(d.xy, self.toward_sun), d.y * self.toward_sun.x
        beside -= d.x * self.toward_sun.y
        azimuth = dr.abs(dr.atan2(beside, along)) * (COLUMNS / dr.pi)
        row = dr.clip(d.z, 0, 1) * ROWS
        i = dr.minimum(mi.UInt32(row), ROWS - 1)
        j = dr.minimum(mi.UInt32(azimuth), COLUMNS - 1)
        up, across = row - mi.Float(i), azimuth - mi.Float(j)
        above = active & (d.z > 0)
        node = lambda m, n: dr.gather(mi.Float, self.table, (i + m) * (COLUMNS + 1) + j + n, above)
        value = dr.lerp(
            dr.lerp(node(0, 0), node(0, 1), across), dr.lerp(node(1, 0), node(1, 1), across), up
        )
        return mi.Spectrum(dr.select(above, self.scale * value, 0))

    def to_string(self):
        return (
            f"SkyDome[sun_azimuth_deg = {self.sun_azimuth_deg:g}, "
            f"mean_radiance = {self.mean_radiance:g}, scale = {self.scale}]"
        )


mi.register_emitter("sky_dome", SkyDome)

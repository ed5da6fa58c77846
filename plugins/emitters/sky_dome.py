r"""Emitter `sky_dome`: the clear daytime sky, an older name of the emitter `sky`."""

from mi_lcair.physics.air.levels import model_names
from mi_lcair.physics.sun.daytime_sky import SUN_ELEVATION_DEG
from mi_lcair.plugins.emitters.sky import Sky
from mi_lcair.plugins.properties import Property, read


class SkyDome(Sky):
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

    It is the emitter `sky` by day without a ground: a name for older scenes. In directions below
    the horizon it is black.
    """

    PROPERTIES = (
        Property("sun_azimuth_deg", "float", 0.0),
        Property("sun_elevation_deg", "float", SUN_ELEVATION_DEG, lower=1, upper=90),
        Property("height_m", "float", lower=0, upper=100_000),
        Property("band", "string", is_file=True),
        Property("air", "string", "midlat_summer", choices=tuple(model_names())),
        Property("group", "string", "sky", is_label=True),
    )

    def read(self, props) -> dict:
        values = read(props, props.plugin_name(), self.PROPERTIES)
        absent = dict.fromkeys(of_sky.name for of_sky in Sky.PROPERTIES)
        return absent | values | {"sky": "clear", "atmosphere": values["air"], "ground_group": ""}

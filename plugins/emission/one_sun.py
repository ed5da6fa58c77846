"""The sun of a scene, and whether it fits the sky."""

from mi_lcair.errors import InputError
from mi_lcair.physics.daytime_sky import SUN_ELEVATION_DEG

# Largest difference of the elevations of a sun and of the sun of a sky dome [degrees].
ELEVATION_RANGE_DEG = 5.0


def one_sun(emitters):
    """The emitter `sun` of a scene; None if it has none.

    Raises InputError for a second one, and for one that does not fit the emitter `sky_dome`.
    """
    suns = [emitter for emitter in emitters if hasattr(emitter, "is_sun")]
    if len(suns) > 1:
        raise InputError(f"the scene has {len(suns)} suns; it can have one at most")
    for dome in emitters if suns else []:
        if hasattr(dome, "sun_azimuth_deg") and not fits(dome, suns[0]):
            raise InputError(
                f"the sun at azimuth {suns[0].azimuth_deg:g} and elevation "
                f"{suns[0].elevation_deg:g} degrees does not fit the sky_dome, whose sun is at "
                f"{dome.sun_azimuth_deg:g} and {SUN_ELEVATION_DEG:g} degrees; it must have the "
                f"same azimuth, and an elevation within {ELEVATION_RANGE_DEG:g} degrees"
            )
    return suns[0] if suns else None


def fits(dome, sun) -> bool:
    """Whether the sun is where the tables of a sky dome assume it."""
    turn = (sun.azimuth_deg - dome.sun_azimuth_deg + 180) % 360 - 180
    return abs(turn) < 0.01 and abs(sun.elevation_deg - SUN_ELEVATION_DEG) <= ELEVATION_RANGE_DEG

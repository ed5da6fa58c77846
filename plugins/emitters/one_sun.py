"""The sun of a scene, and whether it fits the sky."""

from mi_lcair.errors import InputError
from mi_lcair.plugins.emitters.distant_emitter import DistantEmitter
from mi_lcair.plugins.emitters.sun import Sun

# Largest difference of the elevations of a sun and of the sun of a daytime sky [degrees].
ELEVATION_RANGE_DEG = 5.0


def one_sun(emitters):
    """The emitter `sun` of a scene; None if it has none.

    Raises InputError for a second one, and for one that does not fit the emitter `sky_dome`.
    """
    suns = [emitter for emitter in emitters if isinstance(emitter, Sun)]
    if len(suns) > 1:
        raise InputError(f"the scene has {len(suns)} suns; it can have one at most")
    for sky in emitters if suns else []:
        if isinstance(sky, DistantEmitter):
            sky.check_fits(suns[0])
    return suns[0] if suns else None


def check_fits(sun, sky, name: str) -> None:
    """Raise InputError if the sun is not where a daytime sky has it.

    `sky` has a `sun_azimuth_deg` and a `sun_elevation_deg`; `name` says in the message what it is.
    """
    turn = (sun.azimuth_deg - sky.sun_azimuth_deg + 180) % 360 - 180
    if abs(turn) >= 0.01 or abs(sun.elevation_deg - sky.sun_elevation_deg) > ELEVATION_RANGE_DEG:
        raise InputError(
            f"the sun at azimuth {sun.azimuth_deg:g} and elevation {sun.elevation_deg:g} degrees "
            f"does not fit {name}, whose sun is at {sky.sun_azimuth_deg:g} and "
            f"{sky.sun_elevation_deg:g} degrees; it must have the same azimuth, and an elevation "
            f"within {ELEVATION_RANGE_DEG:g} degrees"
        )

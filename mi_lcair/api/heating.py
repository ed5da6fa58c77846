"""Public functions about heat: its exchange between facets, and temperatures."""

from collections.abc import Mapping, Sequence
from os import PathLike

from mi_lcair.api.scenes import scene_of
from mi_lcair.declared import Bounds
from mi_lcair.heating import exchange as conductors
from mi_lcair.heating.exchange_result import Exchange
from mi_lcair.heating.temperatures.description import HeatDescription
from mi_lcair.heating.temperatures.heat_result import Heat
from mi_lcair.heating.temperatures.solve import temperatures
from mi_lcair.rendering.motions.motion import toward
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.scene import SceneLike
from mi_lcair.tasks import exclusively

# `exchange`, the radiative conductors between the facets of a scene
# ------------------------------------------------------------------

KELVIN, ELEVATION = Bounds(lower=0), Bounds(lower=-90, upper=90)


@exclusively
def exchange(
    scene: SceneLike,
    paths: int = 1024,
    seed: int = 0,
    sky_K: float | None = None,
    ground_K: float | None = None,
    sun_deg: Sequence[float] | None = None,
    *,
    parameters: Mapping[str, object] | None = None,
) -> Exchange:
    """Trace the exchange of heat by radiation between the facets of a scene.

    Facet i gains the heat GR_ij sigma (T_j^4 - T_i^4) from facet j, including all reflections.
    Paths begin on the facets. The band `total` of each material is used, for any band of the scene.

    Parameters
    ----------
    scene : Scene, str, Path or mi.Scene
        A loaded scene, or what `mi_lcair.load` takes. It needs no sun and no sky: radiation that
        escapes upward goes to the sky, and radiation that escapes downward goes to the ground.
    paths : int
        Number of paths for each side of a facet.
    seed : int
        The same seed gives the same result.
    sky_K : float or None
        Temperature [K] of the sky, which is replaced by a blackbody. The result then includes the
        irradiance of the facets, for the temperatures of the scene.
    ground_K : float or None
        The same for the ground.
    sun_deg : pair of float or None
        Elevation and azimuth of the sun [degrees], for the sunlight that facets absorb.
    parameters : mapping of str to object, optional
        Values of $-parameters, for a name or a path.

    Returns
    -------
    Exchange
        Conductors with standard errors from independent randomisations.

    Raises
    ------
    InputError
        If more than 0.1 % of a group's emission ends on the backs of one-sided surfaces or on
        surfaces that do not emit, for a plume that transmits, and for a material without an entry
        for the band `total` or LWIR.
    """
    Sampling(paths=paths, seed=seed)  # raises InputError for numbers that cannot be used
    for name, kelvin in (("sky_K", sky_K), ("ground_K", ground_K)):
        if kelvin is not None:
            KELVIN.check(kelvin, name)
    if sun_deg is not None:
        elevation_deg, azimuth_deg = sun_deg
        ELEVATION.check(elevation_deg, "elevation of the sun")
    return conductors.exchange(
        scene_of(scene, parameters),
        paths,
        seed,
        sky_K=sky_K,
        ground_K=ground_K,
        toward_sun=None if sun_deg is None else toward(azimuth_deg, elevation_deg)[:, 0],
    )


# `heat`, temperatures from what heats and cools a scene
# ------------------------------------------------------


@exclusively
def heat(description: str | PathLike[str] | Mapping) -> Heat:
    """Temperatures of a scene's facets from their heat balance, with their uncertainty.

    Each facet exchanges radiation with everything that it sees, absorbs sunlight, and exchanges
    heat with the air and with a wall behind it. The temperatures are those of a steady state, of a
    day that is repeated until it is periodic, or of a series of weather data.

    Parameters
    ----------
    description : str, path-like or dict
        TOML file with the tables [target], [weather], [groups.NAME], [sigma], [run] and
        [signature], or these tables; see `mi_lcair.heating.temperatures.description`.

    Returns
    -------
    Heat

    Raises
    ------
    InputError
        If the description cannot be used, or if a facet cannot lose the heat that it absorbs.
    """
    read = HeatDescription.read(description)
    return temperatures(scene_of(read.target.scene, read.target.parameters), read)

"""`heat`, temperatures from what heats and cools a scene."""

from collections.abc import Mapping
from os import PathLike

from mi_lcair.api.load import scene_of
from mi_lcair.heating.temperatures.description import Description
from mi_lcair.heating.temperatures.heat_result import Heat
from mi_lcair.heating.temperatures.solve import temperatures
from mi_lcair.startup.threads import exclusively


@exclusively
def heat(description: str | PathLike[str] | Mapping) -> Heat:
    """Temperatures of a scene's facets from their heat balance, with their uncertainty.

    Each facet exchanges heat with all that it sees, takes up sunlight, and gives heat to the air
    and to a wall behind it. Temperatures are those of a steady state, of a day that is repeated
    until it is periodic, or of a series of rows.

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
        If the description cannot be used, or if a facet has no path for the heat that it takes up.
    """
    read = Description.read(description)
    return temperatures(scene_of(read.target.scene, read.target.parameters), read)

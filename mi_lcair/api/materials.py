"""`materials`, the list of known materials."""

from pathlib import Path

from mi_lcair.physics.reflection.material_list import MaterialList, material_list
from mi_lcair.startup.threads import exclusively


@exclusively
def materials(*paths: str | Path) -> MaterialList:
    """The known materials, with their bands, emissivities and sources.

    Parameters
    ----------
    *paths : str or Path
        Your own materials, which come first: TOML files, JSON files of fits and inversions, and
        folders with such TOML files.

    Returns
    -------
    MaterialList

    Raises
    ------
    InputError
        If a file cannot be used, or if a folder holds no materials.
    """
    return material_list(paths)

"""`load`, a scene for all other functions."""

from os import PathLike

import mitsuba as mi

from mi_lcair.motions.table import MOTIONS
from mi_lcair.rendering.scene import Scene
from mi_lcair.sensitivity.parameters import load_with_values
from mi_lcair.startup.threads import exclusively


@exclusively
def load(
    scene: str | PathLike[str] | mi.Scene,
    /,
    *,
    motions: str | PathLike[str] | None = None,
    **parameters: object,
) -> Scene:
    """Load a scene XML or a bundled scene, or take over a scene that Mitsuba has loaded.

    Parameters
    ----------
    scene : str, Path or mi.Scene
        Path of the file, or of the folder that `mi-lcair import` wrote; a name that `mi-lcair
        scenes` lists; or a scene that Mitsuba's functions load_file, load_dict or load_string
        returned. Its integrator must be `bounce_path`.
    motions : path-like, optional
        TOML file with motions of its own, see `mi_lcair.motions.table`.
    **parameters
        Values of the scene's $-parameters, and of parameters that `mi_lcair.parameters` lists, such
        as `self.temperature` or `model.yaw_deg`. "lobe.MATERIAL" sets the lobe of one material, as
        `Scene.set_lobe` does.

    Returns
    -------
    Scene

    Raises
    ------
    InputError
        If the scene cannot be used. Examples: there is no such file, it is not XML, a plugin,
        property or parameter is unknown, a value is out of bounds, the emissivity of an emitting
        surface is not known, the integrator is not bounce_path, there is no thermal emitter.
    """
    given = parameters if motions is None else parameters | {MOTIONS: motions}
    return load_with_values(scene, given)

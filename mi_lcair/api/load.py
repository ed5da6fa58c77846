"""`load`, a scene for all other functions, and the scene that a caller of them means."""

from collections.abc import Mapping
from os import PathLike
from typing import Any

import mitsuba as mi

from mi_lcair.declared import fraction
from mi_lcair.errors import InputError
from mi_lcair.rendering.motions.table import MOTIONS
from mi_lcair.rendering.parameters.values import load_with_values
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.scene import Scene, SceneLike, parameters_of_loaded
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
        TOML file with motions of its own, see `mi_lcair.rendering.motions.table`.
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


def scene_of(scene: SceneLike, parameters: Mapping[str, object] | None = None) -> Scene:
    """The scene that a caller means.

    Parameters
    ----------
    scene : Scene, str, Path or mi.Scene
        A loaded scene, or what `load` takes.
    parameters : mapping of str to object, optional
        Values of $-parameters, for a name or a path.

    Raises
    ------
    InputError
        If the scene cannot be used, or if parameters are given for one that is loaded.
    """
    if not isinstance(scene, Scene):
        return load(scene, **parameters or {})
    if parameters:
        raise InputError(f"{parameters_of_loaded(parameters)}; mi_lcair.load takes them")
    return scene


def sampling_of(tolerance: float | str | None, **settings: Any) -> Sampling:
    """The Sampling of a public function, whose tolerance may be a text such as "1%"."""
    return Sampling(tolerance=fraction(tolerance), **settings)

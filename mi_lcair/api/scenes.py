"""Public functions about scenes: load them, name their parameters and materials, share work."""

from collections.abc import Mapping
from contextlib import AbstractContextManager
from os import PathLike
from pathlib import Path
from typing import Any

import mitsuba as mi

from mi_lcair.declared import fraction
from mi_lcair.errors import InputError
from mi_lcair.physics.reflection.material_list import MaterialList, material_list
from mi_lcair.rendering.loading.parsing import TRUSTED
from mi_lcair.rendering.motions.table import MOTIONS
from mi_lcair.rendering.parameters.entries import Parameter
from mi_lcair.rendering.parameters.values import load_with_values, parameters_of
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.scene import Scene, SceneLike, parameters_of_loaded
from mi_lcair.tasks import exclusively, on_workers

# `load`, a scene for all other functions, and the scene that a caller of them means
# ----------------------------------------------------------------------------------


@exclusively
def load(
    scene: str | PathLike[str] | mi.Scene,
    /,
    *,
    motions: str | PathLike[str] | None = None,
    **parameters: object,
) -> Scene:
    """Load a scene from an XML file, a bundled scene, or a scene that Mitsuba has loaded.

    Parameters
    ----------
    scene : str, Path or mi.Scene
        Path of the file, or of the folder that `mi-lcair import` wrote; a name that `mi-lcair
        scenes` lists; or a scene that Mitsuba's functions load_file, load_dict or load_string
        returned. Its integrator must be `bounce_path`.
    motions : path-like, optional
        TOML file with your own motions, see `mi_lcair.rendering.motions.motion`.
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
    """Return a loaded scene for a scene, a name or a file.

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


# `trust`, which lets scenarios run plugins
# -----------------------------------------


def trust(*files: str | PathLike[str]) -> None:
    """Allow scenarios to run these files, which they name in their table [plugins]. A plugin is a
    program. It can do everything that its user may do. A scenario from somebody else therefore runs
    it only if you allow it.

    Parameters
    ----------
    *files : str or path-like
        Python files that register BSDFs or emitters with Mitsuba.
    """
    TRUSTED.update(Path(file).resolve() for file in files)


# `parameters`, the parameters of a scene by name
# -----------------------------------------------


@exclusively
def parameters(
    scene: SceneLike, parameters: Mapping[str, object] | None = None
) -> dict[str, Parameter]:
    """All parameters of a scene that have derivatives or can be changed, by name.

    Groups come first, then materials, in order of names.

    Parameters
    ----------
    scene : Scene, str, Path or mi.Scene
        A loaded scene, or what `mi_lcair.load` takes: a bundled name, a file, Mitsuba's own scene.
    parameters : mapping of str to object, optional
        Values of the scene's $-parameters, for a name or a file.

    Returns
    -------
    dict of str to Parameter

    Raises
    ------
    InputError
        If the scene cannot be used.
    """
    return parameters_of(scene_of(scene, parameters))


# `materials`, the list of known materials
# ----------------------------------------


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
        If a file cannot be used, or if a folder contains no materials.
    """
    return material_list(paths)


# `workers`, processes on which everything that takes long runs
# -------------------------------------------------------------


def workers(count: int | None = None, dask: str | None = None) -> AbstractContextManager[None]:
    """Context manager in which long computations run on worker processes. These are sweeps, trends
    and flights, images, frames, random draws of budgets and inversions with several starts. The
    numbers are the same as without workers.

    Parameters
    ----------
    count : int, optional
        Number of processes. They start at the first task and end with the block. They share the
        processors. A process that dies is replaced.
    dask : str, optional
        Address of a Dask scheduler whose workers are used instead, such as "tcp://127.0.0.1:8786".
        You start the scheduler and the workers. They load scenes from the same paths and need the
        same versions of mi_lcair, mitsuba and drjit.

    Raises
    ------
    InputError
        For both or a number below 1. Within the block: if the package distributed is missing, if
        no scheduler with a worker answers, if a worker has another version, lacks a file or is a
        thread of this process, and for a scene without a file.

    Examples
    --------
    >>> with mi_lcair.workers(2):
    ...     table = mi_lcair.sweep("sweep.toml")
    """
    return on_workers(count, dask)

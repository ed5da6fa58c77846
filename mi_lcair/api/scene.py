"""The scene that a caller of a public function means."""

from collections.abc import Mapping

from mi_lcair.api.load import load
from mi_lcair.errors import InputError
from mi_lcair.fraction import fraction
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.scene import Scene, SceneLike, parameters_of_loaded


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


def sampling_of(tolerance: float | str | None, **settings) -> Sampling:
    """The Sampling of a public function, whose tolerance may be a text such as "1%"."""
    return Sampling(tolerance=fraction(tolerance), **settings)

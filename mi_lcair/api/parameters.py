"""`parameters`, the parameters of a scene by name."""

from collections.abc import Mapping

from mi_lcair.api.load import scene_of
from mi_lcair.rendering.parameters.entries import Parameter
from mi_lcair.rendering.parameters.values import parameters_of
from mi_lcair.rendering.scene import SceneLike
from mi_lcair.startup.threads import exclusively


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

"""`shape_derivatives`, which part of a surface to move."""

from collections.abc import Mapping

from mi_lcair.api.load import scene_of
from mi_lcair.progress import Progress
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.scene import SceneLike
from mi_lcair.sensitivity.shape.shape_derivatives import ShapeDerivatives, differentiate_shape
from mi_lcair.startup.threads import exclusively


@exclusively
def shape_derivatives(
    scene: SceneLike,
    group: str,
    *,
    sensor: int = 0,
    spp: int | None = None,
    paths: int | None = None,
    seed: int = 0,
    progress: Progress | None = None,
    parameters: Mapping[str, object] | None = None,
) -> ShapeDerivatives:
    """Derivatives of the target's intensity with respect to all vertices of a group at once.

    Each vertex moves along its outward normal. Vertices of other groups at the same position move
    with it. What turns, what is hidden and what other surfaces reflect are part of the derivative,
    but not the shade of transmitting plumes.

    Parameters
    ----------
    scene : Scene, str, Path or mi.Scene
        A loaded scene, or what `mi_lcair.load` takes: a bundled name, a file, Mitsuba's own scene.
        Its sensor must be orthographic, and its model must consist of meshes.
    group : str
        Name of the group.
    sensor, spp, seed
        As for `signature`.
    paths : int or None
        Number of paths in place of `spp`.
    progress : callable, optional
        Called with (renders done, all renders).
    parameters : mapping of str to object, optional
        Values of the scene's $-parameters, for a name or a file.

    Returns
    -------
    ShapeDerivatives

    Raises
    ------
    InputError
        If the group is unknown, if a part of the model is no mesh, for closure = tail, and as for
        `signature`.
    """
    sampling = Sampling(spp=spp, paths=paths, seed=seed, sensor=sensor, progress=progress)
    return differentiate_shape(scene_of(scene, parameters), group, sampling)

"""`derivative_images`, images of the radiance and of its derivatives."""

from collections.abc import Mapping, Sequence

from mi_lcair.api.load import scene_of
from mi_lcair.progress import Progress
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.scene import SceneLike
from mi_lcair.sensitivity.derivative_images import DerivativeImages
from mi_lcair.sensitivity.images import differentiate_image
from mi_lcair.startup.threads import exclusively


@exclusively
def derivative_images(
    scene: SceneLike,
    names: Sequence[str],
    *,
    sensor: int = 0,
    spp: int | None = None,
    seed: int = 0,
    randomisations: int = 4,
    progress: Progress | None = None,
    parameters: Mapping[str, object] | None = None,
) -> DerivativeImages:
    """Images of the radiance and of its derivatives, all from the same paths.

    Parameters
    ----------
    scene : Scene, str, Path or mi.Scene
        A loaded scene, or what `mi_lcair.load` takes: a bundled name, a file, Mitsuba's own scene.
    names : sequence of str
        Names of parameters, see `mi_lcair.rendering.parameters.values`.
    sensor, spp, seed
        As for `render`.
    randomisations : int
        Number of independent images.
    progress : callable or None
        Called with (samples per pixel done, expected) of all renders.
    parameters : mapping of str to object, optional
        Values of the scene's $-parameters, for a name or a file.

    Returns
    -------
    DerivativeImages

    Raises
    ------
    InputError
        If a name is unknown, if a parameter has no derivative, and as for `render`.
    """
    sampling = Sampling(spp=spp, seed=seed, sensor=sensor, progress=progress)
    return differentiate_image(scene_of(scene, parameters), names, sampling, randomisations)

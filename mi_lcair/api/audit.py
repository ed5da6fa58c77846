"""`audit`, the energy audit of a scene."""

from collections.abc import Mapping

from mi_lcair.api.load import scene_of
from mi_lcair.energy.audit import audit_flux
from mi_lcair.energy.audit_result import Audit
from mi_lcair.progress import Progress
from mi_lcair.rendering.scene import SceneLike
from mi_lcair.startup.threads import exclusively


@exclusively
def audit(
    scene: SceneLike,
    paths: int = 2**18,
    seed: int = 0,
    progress: Progress | None = None,
    *,
    parameters: Mapping[str, object] | None = None,
) -> Audit:
    """Follow photons from the emitters of a scene until they are absorbed or escape.

    Parameters
    ----------
    scene : Scene, str, Path or mi.Scene
        A loaded scene, or what `mi_lcair.load` takes: a bundled name, a file, Mitsuba's own scene.
        Its emitters must all be thermal, or the sun.
    paths : int
        Paths of photons from each emitter.
    seed : int
        Seed of the random numbers.
    progress : callable, optional
        Called with (emitters done, all emitters).
    parameters : mapping of str to object, optional
        Values of the scene's $-parameters, for a name or a file.

    Returns
    -------
    Audit

    Raises
    ------
    InputError
        If the scene has an emitter that is not thermal, or a surface without an emitter whose
        absorption is unknown.
    """
    return audit_flux(scene_of(scene, parameters), paths, seed, progress)

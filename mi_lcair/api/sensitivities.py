"""`sensitivities`, an intensity and its derivatives."""

from collections.abc import Mapping, Sequence

from mi_lcair.api.load import sampling_of, scene_of
from mi_lcair.progress import Progress
from mi_lcair.rendering.scene import SceneLike
from mi_lcair.sensitivity.sensitivities import Sensitivities
from mi_lcair.sensitivity.window import differentiate_intensity
from mi_lcair.startup.threads import exclusively


@exclusively
def sensitivities(
    scene: SceneLike,
    names: Sequence[str],
    *,
    sensor: int = 0,
    part: str = "target",
    weights: Mapping | None = None,
    spp: int | None = None,
    paths: int | None = None,
    tolerance: float | str | None = None,
    seed: int = 0,
    progress: Progress | None = None,
    parameters: Mapping[str, object] | None = None,
) -> Sensitivities:
    """Intensity and its derivatives with respect to parameters, all from the same paths.

    Derivatives with respect to temperatures, radiances and emissivities of emitters are exact
    consequences of the linearity of radiance in its sources. Those with respect to parameters of
    materials are estimated from the scores of the paths, with a control variate where a pilot finds
    less noise with it (see `plugins.recorders.columns`).

    Parameters
    ----------
    scene : Scene, str, Path or mi.Scene
        A loaded scene, or what `mi_lcair.load` takes: a bundled name, a file, Mitsuba's own scene.
        Its sensor must be orthographic.
    names : sequence of str
        Names of parameters, see `mi_lcair.rendering.parameters.values`.
    sensor, spp, tolerance, seed, progress
        As for `signature`; the tolerance is that of the intensity.
    part : str
        "target" (the model's facets) or "scene".
    weights : mapping or None
        Factor of each source's intensity in the sum, by (group, name of the spectrum) as in
        `Source`. None: the sum over all sources without factors.
    paths : int or None
        Number of paths in place of `spp`.
    parameters : mapping of str to object, optional
        Values of the scene's $-parameters, for a name or a file.

    Returns
    -------
    Sensitivities

    Raises
    ------
    InputError
        If a name is unknown, if a parameter has no derivative, and as for `signature`.
    """
    sampling = sampling_of(
        spp=spp, paths=paths, tolerance=tolerance, seed=seed, sensor=sensor, progress=progress
    )
    scene = scene_of(scene, parameters)
    return differentiate_intensity(scene, names, sampling, part, weights)

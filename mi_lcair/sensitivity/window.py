"""Derivatives of an intensity with respect to many parameters, from one render."""

from collections.abc import Mapping, Sequence

import numpy as np

from mi_lcair.progress import Progress
from mi_lcair.rendering.measurands import Measurands
from mi_lcair.rendering.measure import measure
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.scene import Scene, SceneLike, scene_of
from mi_lcair.sensitivity.columns import recordings
from mi_lcair.sensitivity.common_numbers import CommonNumbers
from mi_lcair.sensitivity.parameters import units
from mi_lcair.sensitivity.sensitivities import Sensitivities

SPLITS = {"target": "target", "scene": "image"}  # channels that hold each part of the radiance


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
    less noise with it (see `plugins.columns.tables`).

    Parameters
    ----------
    scene : Scene, str, Path or mi.Scene
        A loaded scene, or what `mi_lcair.load` takes: a bundled name, a file, Mitsuba's own scene.
        Its sensor must be orthographic.
    names : sequence of str
        Names of parameters, see `mi_lcair.sensitivity.parameters`.
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
    scene = scene_of(scene, parameters)
    sampling = Sampling(
        spp=spp, paths=paths, tolerance=tolerance, seed=seed, sensor=sensor, progress=progress
    )
    return derived(scene, names, sampling, part, weights)


def derived(
    scene: Scene,
    names: Sequence[str],
    sampling: Sampling,
    part: str = "target",
    weights: Mapping | None = None,
) -> Sensitivities:
    """The derivatives of a loaded scene's intensity; see `sensitivities`."""
    by_spectrum = weights is not None
    numbers = CommonNumbers(scene, sampling, by_spectrum, part)
    if sampling.tolerance is not None:
        numbers.render()
    measurands = Measurands.of(SPLITS[part], by_spectrum)
    rows, method, first = {}, {}, None
    with scene.prepared(by_spectrum) as tracer:
        numbers.take_aim()
        for batch in recordings(
            scene, tracer, numbers.camera, names, measurands, weights, sampling.seed
        ):
            total = measure(
                scene,
                numbers.windows,
                numbers.sampling,
                measurands.with_columns(batch.tables),
                aim=numbers.aim,
            )
            first = first or total
            method |= batch.method
            rows |= {
                name: mean_and_deviations(total, channels)
                for name, channels in batch.channels.items()
            }
    value = mean_and_deviations(first, ["weighted"])
    rows = numbers.area * np.array([value, *(rows[name] for name in names)])
    return Sensitivities(
        names=tuple(names),
        value=float(rows[0, 0]),
        derivative=rows[1:, 0],
        deviations=rows[:, 1:],
        method=tuple(method[name] for name in names),
        by_bounce=numbers.by_reflections(first),
        paths=int(first.traced[0]),
        scene_name=scene.name,
        band=scene.band.name,
        units=units(scene, names),
    )


def mean_and_deviations(total, channels) -> np.ndarray:
    """Mean of the sum of some channels and its deviations, (1 + randomisations,)."""
    mean = sum(total.mean(name)[0] for name in channels)
    return np.append(mean, sum(total.deviations(name)[0] for name in channels))

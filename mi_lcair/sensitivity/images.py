"""Images of the derivatives of the radiance with respect to many parameters, from one render."""

from collections.abc import Mapping, Sequence

import numpy as np

from mi_lcair.progress import Progress
from mi_lcair.rendering.limits import check_memory, check_paths
from mi_lcair.rendering.render import add_points
from mi_lcair.rendering.scene import SceneLike, scene_of
from mi_lcair.rendering.statistics import Totals, check_valid
from mi_lcair.sensitivity.columns import recordings
from mi_lcair.sensitivity.derivative_images import DerivativeImages
from mi_lcair.sensitivity.parameters import units


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
        Names of parameters, see `mi_lcair.sensitivity.parameters`.
    sensor, spp, seed
        As for `render`.
    randomisations : int
        Number of independent images.
    progress : callable or None
        Called with (pixels done, pixels expected).
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
    scene = scene_of(scene, parameters)
    camera = scene.sensor(sensor)
    width, height = camera.film().crop_size()
    pixels = width * height
    spp = spp or camera.sampler().sample_count()
    check_paths(pixels, spp=spp)
    points = -(-spp // randomisations)
    radiance, images, method = None, {}, {}
    with scene.prepared() as tracer:
        check_memory(pixels * randomisations * (1 + len(names)), tracer, None)
        batches = recordings(scene, tracer, camera, names, None, seed=seed)
        for number, some in enumerate(batches):
            total = Totals(pixels, randomisations, by_randomisation=True)
            done = lambda windows, before=number * pixels: progress(
                before + windows, len(batches) * pixels
            )
            add_points(
                total,
                tracer,
                camera,
                (width, height),
                seed,
                None,
                done=0,
                points=points,
                tables=some.tables,
                progress=done if progress else None,
            )
            check_valid(total.invalid, pixels * points * randomisations, scene.name)
            if radiance is None:
                radiance = mean_images(total, ["weighted"], height, width)
            method |= some.method
            for name, channels in some.channels.items():
                images[name] = mean_images(total, channels, height, width)
    found = np.array([images[name] for name in names]).reshape(-1, *radiance.shape)
    return DerivativeImages(
        names=tuple(names),
        radiance=radiance,
        derivatives=found.swapaxes(0, 1),
        method=tuple(method[name] for name in names),
        scene_name=scene.name,
        band=scene.band.name,
        units=units(scene, names),
    )


def mean_images(total: Totals, channels, height: int, width: int) -> np.ndarray:
    """Means of the sum of some channels over the paths of each pixel, for each randomisation."""
    means = sum(total.sums[name] for name in channels) / np.maximum(total.valid, 1)
    return means.T.reshape(-1, height, width).astype(np.float32)

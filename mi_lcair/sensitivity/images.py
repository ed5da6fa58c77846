"""Images of the derivatives of the radiance with respect to many parameters, from one render."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mi_lcair.rendering.limits import check_memory
from mi_lcair.rendering.measurands import Measurands
from mi_lcair.rendering.measure import measure
from mi_lcair.rendering.parameters.values import parameters_named, units
from mi_lcair.rendering.pixels.errors import missed_nearby
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.scene import Scene
from mi_lcair.rendering.statistics import Totals
from mi_lcair.rendering.window import Windows
from mi_lcair.sensitivity.columns import by_difference, columns_of, explored_by, recordings
from mi_lcair.sensitivity.common_numbers import METHOD, renders_beside
from mi_lcair.sensitivity.derivative_images import DerivativeImages
from mi_lcair.sensitivity.motions.differences import ON_FILM
from mi_lcair.sensitivity.window import missed_errors


def differentiate_image(
    scene: Scene, names: Sequence[str], sampling: Sampling, randomisations: int = 4
) -> DerivativeImages:
    """Images of a loaded scene's radiance and of its derivatives, all from the same paths.

    names: names of parameters, some of which are differentiated `by_difference` of images with the
    same random numbers. randomisations: number of independent images.
    """
    camera = scene.sensor(sampling.sensor)
    sampling = sampling.settled(camera)
    windows = Windows.of_image(camera, randomisations, by_randomisation=True)
    windows.check(sampling)
    kinds = {entry.name: entry.kind for entry in parameters_named(scene, names)}
    differenced = by_difference(scene, names)
    along_paths = [name for name in names if name not in differenced]
    explored = explored_by(columns_of(scene, along_paths).values())
    measurands = replace(Measurands.of(None), explored=explored)
    first, images, method = None, {}, {}
    with scene.prepared(explored=explored) as tracer:
        check_memory(windows.count * randomisations * (1 + len(names)))
        batches = recordings(scene, tracer, camera, along_paths, measurands, seed=sampling.seed)
        if not batches:
            first = measure(scene, windows, sampling, Measurands.of(None))
            radiance = images_of(first, windows).astype(np.float32)
        for number, batch in enumerate(batches):
            total = measure(
                scene,
                windows,
                sampling.part(number, len(batches)),
                measurands.with_columns(batch.tables),
            )
            if first is None:
                first = total
                radiance = images_of(total, windows, ["weighted"]).astype(np.float32)
            method |= batch.method
            for name, channels in batch.channels.items():
                images[name] = images_of(total, windows, channels).astype(np.float32)
    for name in differenced:
        *ends, step = renders_beside(scene, name, windows, sampling, Measurands.of(None))
        high, low = (images_of(end, windows) for end in ends)
        images[name] = ((high - low) / step).astype(np.float32)
        method[name] = ON_FILM if kinds[name] == "motion" else METHOD
    # A motion moves what paths have met
    still = [name for name in names if kinds[name] != "motion"]
    missed = dict(zip(still, missed_errors(scene, first, still)))
    missed = [first.missed_error(), *(missed.get(name, 0 * first.paths) for name in names)]
    derivatives = np.array([images[name] for name in names]).reshape(-1, *radiance.shape)
    return DerivativeImages(
        names=tuple(names),
        radiance=radiance,
        derivatives=derivatives.swapaxes(0, 1),
        missed=np.array(
            [missed_nearby(errors, windows.size).reshape(windows.size) for errors in missed]
        ),
        method=tuple(method[name] for name in names),
        scene_name=scene.name,
        band=scene.band.name,
        units=units(scene, names),
    )


def randomised_images(scene: Scene, sampling: Sampling, randomisations: int) -> np.ndarray:
    """Independent images of the radiance, (randomisations, height, width) [W m^-2 sr^-1]."""
    camera = scene.sensor(sampling.sensor)
    windows = Windows.of_image(camera, randomisations, by_randomisation=True)
    return images_of(measure(scene, windows, sampling, Measurands.of(None)), windows)


def images_of(total: Totals, windows: Windows, channels=None) -> np.ndarray:
    """Mean over the paths of each pixel, (randomisations, height, width), of some channels' sum.

    channels: their names; None for the radiance.
    """
    sums = total.radiance if channels is None else sum(total.sums[name] for name in channels)
    means = sums / np.maximum(total.valid, 1)
    return means.T.reshape(-1, windows.rows, windows.columns)

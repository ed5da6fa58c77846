"""Images of the derivatives of the radiance with respect to many parameters, from one render."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mi_lcair.motions.differences import ON_FILM
from mi_lcair.motions.pixel_step import pixel_step
from mi_lcair.motions.pose import known_motions, moved, value_of
from mi_lcair.rendering.limits import check_memory
from mi_lcair.rendering.measurands import Measurands
from mi_lcair.rendering.measure import measure
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.scene import Scene
from mi_lcair.rendering.statistics import Totals
from mi_lcair.rendering.window import Windows
from mi_lcair.sensitivity.columns import columns_of, explored_by, recordings
from mi_lcair.sensitivity.derivative_images import DerivativeImages
from mi_lcair.sensitivity.parameters import chosen, units


def differentiate_image(
    scene: Scene, names: Sequence[str], sampling: Sampling, randomisations: int = 4
) -> DerivativeImages:
    """Images of a loaded scene's radiance and of its derivatives, all from the same paths.

    names: names of parameters. Motions are differentiated by differences of images with the same
    random numbers. randomisations: number of independent images.
    """
    camera = scene.sensor(sampling.sensor)
    sampling = sampling.settled(camera)
    windows = Windows.of_image(camera, randomisations, by_randomisation=True)
    windows.check(sampling)
    motions = [entry.name for entry in chosen(scene, names) if entry.kind == "motion"]
    along_paths = [name for name in names if name not in motions]
    explored = explored_by(columns_of(scene, along_paths).values())
    measurands = replace(Measurands.of(None), explored=explored)
    radiance, images, method = None, {}, {}
    with scene.prepared(explored=explored) as tracer:
        check_memory(windows.count * randomisations * (1 + len(names)), tracer, None)
        batches = recordings(scene, tracer, camera, along_paths, measurands, seed=sampling.seed)
        for number, batch in enumerate(batches):
            total = measure(
                scene,
                windows,
                sampling.part(number, len(batches)),
                measurands.with_columns(batch.tables),
            )
            if radiance is None:
                radiance = mean_images(total, ["weighted"], windows)
            method |= batch.method
            for name, channels in batch.channels.items():
                images[name] = mean_images(total, channels, windows)
    for name in motions:
        images[name], method[name] = moved_images(scene, name, windows, sampling), ON_FILM
    derivatives = np.array([images[name] for name in names]).reshape(-1, *radiance.shape)
    return DerivativeImages(
        names=tuple(names),
        radiance=radiance,
        derivatives=derivatives.swapaxes(0, 1),
        method=tuple(method[name] for name in names),
        scene_name=scene.name,
        band=scene.band.name,
        units=units(scene, names),
    )


def moved_images(scene: Scene, name: str, windows: Windows, sampling: Sampling) -> np.ndarray:
    """Derivatives of independent images along a motion, (randomisations, height, width).

    They are central differences over about a quarter of a pixel. A shorter step has more noise, and
    a longer one blurs edges.
    """
    motion = known_motions(scene)[name]
    value = value_of(scene, motion)
    h = pixel_step(scene, windows.sensor, motion)
    h = min(h, motion.upper - value, value - motion.lower)
    ends = []
    for end in (value + h, value - h):
        with moved(scene, {name: end}):
            total = measure(scene, windows, sampling, Measurands.of(None))
        means = total.radiance / np.maximum(total.valid, 1)
        ends.append(means.T.reshape(-1, windows.rows, windows.columns))
    return ((ends[0] - ends[1]) / (2 * h)).astype(np.float32)


def randomised_images(scene: Scene, sampling: Sampling, randomisations: int) -> np.ndarray:
    """Independent images of the radiance, (randomisations, height, width) [W m^-2 sr^-1]."""
    camera = scene.sensor(sampling.sensor)
    windows = Windows.of_image(camera, randomisations, by_randomisation=True)
    total = measure(scene, windows, sampling, Measurands.of(None))
    means = total.radiance / np.maximum(total.valid, 1)
    return means.T.reshape(randomisations, windows.rows, windows.columns)


def mean_images(total: Totals, channels, windows: Windows) -> np.ndarray:
    """Means of the sum of some channels over the paths of each pixel, for each randomisation."""
    means = sum(total.sums[name] for name in channels) / np.maximum(total.valid, 1)
    return means.T.reshape(-1, windows.rows, windows.columns).astype(np.float32)

"""Images of the derivatives of the radiance with respect to many parameters, from one render."""

from itertools import pairwise

import numpy as np

from mi_lcair.plugins.paths.launch import Launch
from mi_lcair.rendering.limits import check_memory, check_paths
from mi_lcair.rendering.render import PASS_SAMPLES
from mi_lcair.rendering.statistics import Totals, check_valid
from mi_lcair.sensitivity.columns import MOST_COLUMNS, columns_of, tables_of
from mi_lcair.sensitivity.derivative_images import DerivativeImages


def derivative_images(
    scene,
    names,
    *,
    sensor: int = 0,
    spp: int | None = None,
    seed: int = 0,
    randomisations: int = 4,
    progress=None,
) -> DerivativeImages:
    """Images of the radiance and of its derivatives, all from the same paths.

    Parameters
    ----------
    scene : Scene
    names : sequence of str
        Names of parameters, see `mi_lcair.sensitivity.parameters`.
    sensor, spp, seed
        As for `render`.
    randomisations : int
        Number of independent images.
    progress : callable or None
        Called with (pixels done, pixels expected).

    Returns
    -------
    DerivativeImages

    Raises
    ------
    InputError
        If a name is unknown, if a parameter has no derivative, and as for `render`.
    """
    camera = scene.sensor(sensor)
    width, height = camera.film().crop_size()
    pixels = width * height
    spp = spp or camera.sampler().sample_count()
    check_paths(pixels, spp=spp)
    points, run = -(-spp // randomisations), max(1, PASS_SAMPLES // spp)
    columns, radiance, images, method = columns_of(scene, names), None, {}, {}
    ordered = list(columns)
    batches = [
        ordered[start : start + MOST_COLUMNS]
        for start in range(0, max(len(ordered), 1), MOST_COLUMNS)
    ]
    with scene.prepared() as tracer:
        check_memory(pixels * randomisations * (1 + len(ordered)), tracer, None)
        for number, some in enumerate(batches):
            tables = tables_of(
                scene, tracer, camera, {name: columns[name] for name in some}, seed=seed
            )
            total = Totals(pixels, randomisations, by_randomisation=True)
            for first, end in pairwise([*range(0, pixels, run), pixels]):
                launch = Launch(
                    columns=width,
                    rows=height,
                    seed=seed,
                    randomisations=randomisations,
                    points=points,
                    first=first,
                    windows=end - first,
                )
                total.add(launch, tracer.trace(camera, launch, None, tables=tables))
                if progress:
                    progress(number * pixels + end, len(batches) * pixels)
            check_valid(total.invalid, pixels * points * randomisations, scene.name)
            image = lambda name, total=total: mean_images(total, total.sums[name], height, width)
            if radiance is None:
                radiance = image("weighted")
            for k, name in enumerate(some):
                images[name], method[name] = image(f"column.{k}"), "linear"
                if k < tables.materials:
                    method[name] = "score"
                    controlled = images[name] + image(f"control.{k}")
                    if noise(controlled) < noise(images[name]):
                        images[name], method[name] = controlled, "control variate"
    found = np.array([images[name] for name in names]).reshape(-1, *radiance.shape)
    return DerivativeImages(
        names=tuple(names),
        radiance=radiance,
        columns=found.swapaxes(0, 1),
        method=tuple(method[name] for name in names),
    )


def mean_images(total: Totals, sums: np.ndarray, height: int, width: int) -> np.ndarray:
    """Means over the paths of each pixel, one image for each randomisation, Float32."""
    means = sums / np.maximum(total.valid, 1)
    return means.T.reshape(-1, height, width).astype(np.float32)


def noise(images: np.ndarray) -> float:
    """Mean variance of a pixel between independent images; 0 for a single image."""
    return float(images.var(axis=0, dtype=float).mean())

"""Errors that the pixels of an image share: a camera's faults, and groups that are slightly wrong.

Each of them is a pattern over the image with a Gaussian prior of mean 0. Least squares integrates
over them, so that they widen the errors of the unknowns. They are relative to the predicted value.
"""

import numpy as np

from mi_lcair.knowing.inversion.data.readings import Observation
from mi_lcair.knowing.inversion.least_squares.prediction import Nuisances
from mi_lcair.rendering.images.render import render_image
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.scene import Scene

GAIN, OFFSET, VIGNETTING, GRADIENT = (
    f"the camera's {fault}" for fault in ("gain", "offset", "vignetting", "gradient")
)
MODEL = "the scene's radiance"
# Paths that tell which groups the pixels show, and samples per pixel. With 16 samples the noise of
# the shares of pixels at edges makes the errors of temperatures 1.4 times too small.
PATHS_OF_SHARES, LEAST_SPP, MOST_SPP = 2**21, 16, 512


def nuisances_of(entry: Observation, counts, shares: dict) -> Nuisances | None:
    """The errors that the pixels of an image share; None for a number, and without any."""
    if counts is None:
        return None
    own = [getattr(entry, key, False) for key in ("gain", "offset")]
    result = camera_faults(counts, entry.camera_error, *(not is_own for is_own in own))
    if shares and entry.model_error:
        result = result.beside(group_errors(shares, entry.model_error))
    return result if result.names else None


def camera_faults(counts: np.ndarray, sigma: float, gain: bool, offset: bool) -> Nuisances:
    """Errors of gain and offset, vignetting, and two linear gradients of the gain.

    counts: pixels that count, (H, W) of bool. sigma: standard deviation of the gain, of the offset
    relative to the mean value, of the gain at the corners relative to the centre, and of the gain
    at the edges relative to the centre. gain, offset: False for one that is an unknown itself.
    """
    height, width = counts.shape
    y, x = (
        np.broadcast_to(place, counts.shape)[counts]
        for place in (
            (2 * np.arange(height)[:, None] + 1) / height - 1,
            (2 * np.arange(width) + 1) / width - 1,
        )
    )
    one = np.ones(len(x))
    patterns = {
        (GAIN, "gain"): one * gain,
        (OFFSET, "offset"): one * offset,
        (VIGNETTING, "vignetting"): (x**2 + y**2) / 2,
        (GRADIENT, "gradient from left to right"): x,
        (GRADIENT, "gradient from top to bottom"): y,
    }
    kept = {key: sigma * of for key, of in patterns.items() if of.any() and sigma}
    names = [name for name, _ in kept]
    columns = np.array(list(kept.values())).reshape(len(kept), len(x)).T
    return Nuisances(names, [label for _, label in kept], columns, np.array(names) == OFFSET)


def group_errors(shares: dict[str, np.ndarray], sigma: float) -> Nuisances:
    """Relative errors of the radiances of groups. shares: see `shares_of_groups`."""
    columns = sigma * np.array(list(shares.values())).T
    return Nuisances(
        [MODEL] * len(shares),
        [f"radiance of {group}" for group in shares],
        columns,
        np.zeros(len(shares), dtype=bool),
    )


def shares_of_groups(scene: Scene, sensor: int, counts: np.ndarray) -> dict[str, np.ndarray]:
    """Share of the radiance of each pixel that counts, (n,), which leaves each group toward it.

    It is 0 for a group that no pixel shows.
    """
    spp = int(np.clip(PATHS_OF_SHARES // counts.size, LEAST_SPP, MOST_SPP))
    sampling = Sampling(spp=spp, sensor=sensor)
    channels = render_image(scene, sampling, ("seen",)).channels
    total = np.maximum(channels["Y"][counts], np.finfo(np.float32).tiny)
    return {
        name.removeprefix("seen.").removesuffix(".Y"): values[counts] / total
        for name, values in channels.items()
        if name.startswith("seen.")
    }

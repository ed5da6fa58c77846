"""Probes: small launches through some pixels or a whole window, by number of reflections."""

from dataclasses import dataclass
from math import gcd

import numpy as np

from mi_lcair.plugins.paths.aim import Aim
from mi_lcair.plugins.paths.launch import Launch
from mi_lcair.plugins.recorders.channels import Channels
from mi_lcair.plugins.recorders.unmet_source import in_all_windows
from mi_lcair.rendering.scene import Scene
from mi_lcair.rendering.statistics import UNSEEN

# Randomisations of a probe. In a window their number decides how well the noise is known.
WINDOW_RANDOMISATIONS, PIXEL_RANDOMISATIONS = 64, 8
WINDOW_POINTS, PIXEL_POINTS = 2**7, 2  # points of each randomisation
# A probe of pixels takes one of 16, so that it costs little compared with the
# image. They are spread over the image. Their number lies between the limits, if the image has as
# many.
PIXEL_SHARE, LEAST_PIXELS, MOST_PIXELS = 16, 2**6, 2**11


@dataclass(frozen=True)
class Probe:
    """Radiance, W m^-2 sr^-1, of a window or of some pixels of a scene.

    Attributes
    ----------
    by_bounce : ndarray, shape (R, n, P)
        Mean radiance after 0, 1, ... n - 1 reflections of each randomisation and pixel. It is that
        of the whole image for a probe of pixels. Otherwise it is that of the model's facets, and
        P = 1.
    may_lack : float
        Upper bound of what a source that no path has hit adds, as a fraction of the mean.
    """

    by_bounce: np.ndarray
    may_lack: float

    @staticmethod
    def of(scene: Scene, each_pixel: bool, seed: int, sensor: int, factor: int) -> "Probe":
        """A probe of some pixels of a scene, or of its whole window.

        factor: points of each randomisation, as a multiple of the usual number.
        """
        camera = scene.sensor(sensor)
        split, prefix = ("image", "") if each_pixel else ("target", "target.")
        if each_pixel:
            launch = pixels_launch(*camera.film().crop_size(), seed, factor)
        else:
            points = WINDOW_POINTS * factor
            launch = Launch(1, 1, seed, WINDOW_RANDOMISATIONS, points, aim=Aim.anywhere())
        with scene.prepared() as tracer:
            sums = tracer.trace(camera, launch, Channels(split))
            unmet, noted = tracer.unmet_sources(camera), in_all_windows(sums.unmet)
        valid = np.maximum(sums.valid, 1)
        names = [name for name in sums.channels if name.startswith(f"{prefix}bounce.")]
        by_bounce = np.stack([(sums.channels[name] / valid).T for name in names], axis=1)
        chance = UNSEEN * max(unmet.in_view, float(unmet.after_reflection(noted)))
        mean = by_bounce.sum(axis=1).mean()
        return Probe(by_bounce, chance / (launch.paths * mean) if mean > 0 else np.inf)


def pixels_launch(width: int, height: int, seed: int, factor: int) -> Launch:
    """The launch of a probe of some pixels of an image."""
    wanted = np.clip(width * height // PIXEL_SHARE, LEAST_PIXELS, MOST_PIXELS)
    stride = max(1, width * height // int(wanted))
    # A stride with a divisor of the width would put all pixels into a few columns.
    while gcd(stride, width) > 1:
        stride += 1
    paths = PIXEL_RANDOMISATIONS, PIXEL_POINTS * factor
    count = -(-width * height // stride)
    return Launch(width, height, seed, *paths, windows=count, stride=stride)

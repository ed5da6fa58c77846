"""Two-point non-uniformity correction, and the camera's calibration to apparent temperature."""

from dataclasses import dataclass

import numpy as np

from mi_lcair.camera.electronics.frames import Pattern, frame
from mi_lcair.camera.electronics.response import electrons
from mi_lcair.errors import InputError
from mi_lcair.physics.bands import Band
from mi_lcair.physics.imager import Imager

AVERAGED = 64  # frames of each uniform scene of the correction
# First numbers of the frames of the uniform scenes. Frames of images have smaller ones.
SCENES = 2**31
DISTINCT = 10  # smallest difference of the uniform scenes, in standard deviations of a frame
SMALLEST_GAIN = 1e-3  # relative gain below which a pixel counts as dead
SPAN_K = 10.0  # distance of the uniform scenes' temperatures from the middle one, K


@dataclass(frozen=True)
class Correction:
    """Linear correction of each pixel: (electrons - offset) / gain.

    gain, offset: (H, W) or numbers; offset in electrons.
    """

    gain: np.ndarray | float = 1.0
    offset: np.ndarray | float = 0.0

    def applied(self, signal: np.ndarray) -> np.ndarray:
        """Corrected electrons of the signal."""
        return (signal - self.offset) / self.gain

    def undone(self, corrected: np.ndarray) -> np.ndarray:
        """The signal of which these are the corrected electrons."""
        return corrected * self.gain + self.offset


def two_point(
    imager: Imager,
    pattern: Pattern,
    design: Correction,
    electron_band: Band,
    temperature: float,
    seed: int,
) -> Correction:
    """Correction from two uniform blackbodies SPAN_K below and above `temperature`, K.

    Each is the mean of AVERAGED frames. What is left of the fixed pattern is their noise. The
    correction holds that of the optics' `design`, too.

    Raises
    ------
    InputError
        If the warmer blackbody saturates the camera, or the noise hides the difference of both.
    """
    cold, warm = temperature - SPAN_K, temperature + SPAN_K
    low, high = (float(electrons(electron_band, T)) for T in (cold, warm))
    most = float(np.max(design.undone(high)))
    noise = float(imager.noise(most))
    if not high - low > DISTINCT * noise:
        raise InputError(
            f"[camera]: nuc looks at blackbodies of {cold:.4g} and {warm:.4g} K, which differ by "
            f"{high - low:.3g} electrons with a noise of {noise:.3g}; lengthen "
            "integration_time_ms, or leave nuc out"
        )
    if most * pattern.gain.max() + imager.dark >= imager.well:
        raise InputError(
            f"[camera]: nuc looks at a blackbody of {warm:.4g} K, which gives "
            f"{1e-6 * most:.4g} Me and saturates the well of {imager.well_Me:g} Me; shorten "
            "integration_time_ms"
        )
    first, second = (
        frame(imager, pattern, design.undone(level), seed, SCENES + k, AVERAGED) - imager.dark
        for k, level in enumerate((low, high))
    )
    gain = (second - first) / (high - low)
    # A pixel without a gain cannot be corrected; it keeps the colder scene
    gain = np.where(gain > SMALLEST_GAIN, gain, 1.0)
    return Correction(gain, first - gain * low)

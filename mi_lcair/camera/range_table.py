"""Signal-to-noise ratio and number of pixels of a target at other ranges."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from mi_lcair.camera.camera import Camera
from mi_lcair.camera.exposure import Exposure, detector_mean
from mi_lcair.detection.irradiance import Backdrop
from mi_lcair.errors import InputError
from mi_lcair.physics.air.atmosphere import Atmosphere
from mi_lcair.physics.bands import Band
from mi_lcair.rendering.images.apparent import Arrival

NEAREST = 4  # shortest range of the table, in radii of the target
FARTHEST = 1000  # longest range of the table in vacuum, in ranges of the scenario
STEPS = (1, 2, 5)  # ranges of the table in each decade
FINE = 400  # ranges at which the end of the detection is sought


@dataclass(frozen=True)
class RangeRow:
    """A target at a range.

    range_m: range, m. pixels: number of pixels on the target. electrons: its electrons in a frame
    above the background, sum over the pixels. snr: signal-to-noise ratio. detected: whether pixels
    and ratio suffice. lacks: which of them does not, in words; "" if both do.
    """

    range_m: float
    pixels: float
    electrons: float
    snr: float
    detected: bool
    lacks: str


@dataclass(frozen=True)
class RangedTarget:
    """A target that a camera has rendered once, to be put at other ranges of its line of sight.

    The electrons of the whole target are E = sum of I(x) tau(x, R) response(x) / (w R^2), plus the
    path's less the background's that it hides, with the pixel's solid angle w. The ratio is that of
    a matched filter for a uniform target: E / (noise sqrt(n + b)), with n pixels on the target and
    b pixels over which the camera spreads a point. It is exact for a point and for a large uniform
    target. A target with hot spots has more.

    Attributes
    ----------
    camera : Camera
    exposure : Exposure
    band : Band
        Band of the render.
    air : Atmosphere
    noise : float
        Noise of a pixel, electrons.
    snr : float
        Ratio that a detection needs.
    """

    camera: Camera
    exposure: Exposure
    band: Band
    air: Atmosphere
    noise: float
    snr: float

    def rows(self, ranges_m: ArrayLike, background: np.ndarray) -> list[RangeRow]:
        """The target at some ranges.

        ranges_m: ranges, m, (r,). background: electrons of the background in a pixel, for a target
        at each range, (r,).
        """
        ranges_m = np.asarray(ranges_m, dtype=float)
        camera, exposure = self.camera, self.exposure
        arrival = Arrival.of(
            exposure.sources, self.band, camera.band, self.air, ranges_m, extrapolate=True
        )
        seen = arrival.of_parts(exposure.intensities)
        seen += exposure.area * (arrival.path - background)
        covered = (ranges_m * camera.imager.pixel_angle) ** 2
        electrons, pixels = seen / covered, exposure.area / covered
        spread = np.sqrt(pixels + camera.optics.noise_equivalent_pixels)
        ratio = np.abs(electrons) / (self.noise * spread)
        criteria = {
            "signal to noise": ratio >= self.snr,
            "pixels": pixels >= camera.imager.least_pixels,
        }
        rows = []
        for k, row in enumerate(zip(ranges_m, pixels, electrons, ratio)):
            lacking = [name for name, suffices in criteria.items() if not suffices[k]]
            rows.append(RangeRow(*map(float, row), not lacking, " and ".join(lacking)))
        return rows


def at_ranges(
    target: RangedTarget, backdrop: Backdrop, ranges_m: np.ndarray
) -> tuple[list[RangeRow], float | None]:
    """The target at those ranges, m, at which the background is known.

    The second value is the largest range at which it is detected, m; None for nowhere.
    """
    ranges, levels = backgrounds(backdrop, target.camera.band, ranges_m)
    fine = fine_ranges(ranges)
    fine_rows = target.rows(fine, np.interp(fine, ranges, levels))
    detections = [row.range_m for row in fine_rows if row.detected]
    return target.rows(ranges, levels), max(detections, default=None)


def table_ranges(air: Atmosphere, radius_m: float, range_m: float) -> np.ndarray:
    """Ranges 1, 2, 5, 10, ... m of a table, and `range_m`.

    They begin at NEAREST radii of the target. They end where the air's table does, and in vacuum at
    FARTHEST times `range_m`.
    """
    shortest = min(NEAREST * radius_m, range_m)
    longest = FARTHEST * range_m if air.is_vacuum else max(air.ranges_m[-1], range_m)
    decades = np.arange(np.floor(np.log10(shortest)), np.ceil(np.log10(longest)) + 1)
    series = (10.0 ** decades[:, None] * STEPS).ravel()
    return np.unique([*series[(series >= shortest) & (series <= longest)], range_m])


def backgrounds(backdrop: Backdrop, detector: Band, ranges_m) -> tuple[np.ndarray, np.ndarray]:
    """Ranges of the target at which the background is known, and its electrons there.

    The background may have a path of its own, which ends where its table does.
    """
    known = {}
    for range_m in ranges_m:
        try:
            known[range_m] = detector_mean(backdrop.at_sensor(range_m), detector)
        except InputError:
            continue
    return np.array(list(known)), np.array(list(known.values()))


def fine_ranges(ranges_m) -> np.ndarray:
    """Ranges between the first and the last one, for the end of the detection."""
    return np.geomspace(min(ranges_m), max(ranges_m) * (1 - 1e-12), FINE)

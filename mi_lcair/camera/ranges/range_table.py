"""Signal-to-noise ratio and number of pixels of a target at other ranges."""

from dataclasses import dataclass
from operator import attrgetter

import numpy as np
from numpy.typing import ArrayLike

from mi_lcair.camera.camera import Camera
from mi_lcair.camera.exposure import Exposure, detector_mean
from mi_lcair.camera.ranges.silhouette import Silhouette
from mi_lcair.detection.irradiance import Backdrop
from mi_lcair.errors import InputError
from mi_lcair.physics.air.atmosphere import Atmosphere
from mi_lcair.physics.bands import Band
from mi_lcair.rendering.images.apparent import Arrival

NEAREST = 4  # shortest range of the table, in radii of the target
FARTHEST = 1000  # longest range of the table in vacuum, in ranges of the scenario
STEPS = (1, 2, 5)  # ranges of the table in each decade
FINE = 400  # ranges at which the end of the detection is sought
SPREADS = 32  # ranges between which the spread of the target over pixels is interpolated, for that


@dataclass(frozen=True)
class RangeRow:
    """A target at a range.

    range_m: range, m. pixels: number of pixels on the target. electrons: its electrons in a frame
    above the background, sum over the pixels. snr: signal-to-noise ratio of the whole target with a
    matched filter. peak_snr: that of its strongest pixel. detected: whether pixels and `snr`
    suffice. lacks: which of them does not, in words; "" if both do. peak_detected: whether pixels
    and `peak_snr` suffice.
    """

    range_m: float
    pixels: float
    electrons: float
    snr: float
    peak_snr: float
    detected: bool
    lacks: str
    peak_detected: bool


@dataclass(frozen=True)
class RangedTarget:
    """A target that a camera has rendered once, to be put at other ranges of its line of sight.

    The electrons of the whole target are E = sum of I(x) tau(x, R) response(x) / (w R^2), plus the
    path's less the background's that it hides, with the pixel's solid angle w. The target is taken
    to be even: pixel j gets the share s_j of its electrons that its blurred outline has there, at
    its place in the frame. A matched filter then has the ratio E sqrt(sum s_j^2) / noise, and the
    strongest pixel E max(s_j) / noise. A target with hot spots has more.

    Attributes
    ----------
    camera : Camera
    exposure : Exposure
    silhouette : Silhouette
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
    silhouette: Silhouette
    band: Band
    air: Atmosphere
    noise: float
    snr: float

    def spread(self, ranges_m: np.ndarray) -> np.ndarray:
        """Root of the sum of squares, and maximum, of pixels' shares at ranges, m, (2, r)."""
        within, place = np.unique(
            np.maximum(ranges_m, self.silhouette.nearest_m), return_inverse=True
        )
        optics = self.camera.optics
        shares = [self.silhouette.spread(optics.at(range_m), range_m) for range_m in within]
        # The light of a nearer target is shared by more pixels, in proportion to its area
        return np.array(shares)[place].T * (ranges_m / within[place]) ** [[1], [2]]

    def rows(
        self, ranges_m: ArrayLike, background: np.ndarray, spread: np.ndarray
    ) -> list[RangeRow]:
        """The target at some ranges.

        ranges_m: ranges, m, (r,). background: electrons of the background in a pixel, for a target
        at each range, (r,). spread: that of the target at each range, (2, r).
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
        ratio, peak = np.abs(electrons) * spread / self.noise
        enough = pixels >= camera.imager.least_pixels
        criteria = {"signal to noise": ratio >= self.snr, "pixels": enough}
        peak_detected = enough & (peak >= self.snr)
        rows = []
        for k, row in enumerate(zip(ranges_m, pixels, electrons, ratio, peak)):
            lacking = [name for name, suffices in criteria.items() if not suffices[k]]
            in_words = " and ".join(lacking)
            rows.append(RangeRow(*map(float, row), not lacking, in_words, bool(peak_detected[k])))
        return rows


def at_ranges(
    target: RangedTarget, backdrop: Backdrop, ranges_m: np.ndarray
) -> tuple[list[RangeRow], float | None, float | None]:
    """The target at those ranges, m, at which the background is known.

    The other values are the largest ranges, m, at which a matched filter and the strongest pixel
    detect it; None for nowhere.
    """
    ranges, levels = backgrounds(backdrop, target.camera.band, ranges_m)
    fine, knots = (np.geomspace(min(ranges), max(ranges), n) for n in (FINE, SPREADS))
    logarithms = np.log(target.spread(knots))
    spread = np.exp([np.interp(np.log(fine), np.log(knots), values) for values in logarithms])
    fine_rows = target.rows(fine, np.interp(fine, ranges, levels), spread)
    farthest = (
        max((row.range_m for row in fine_rows if detected(row)), default=None)
        for detected in (attrgetter("detected"), attrgetter("peak_detected"))
    )
    return target.rows(ranges, levels, target.spread(ranges)), *farthest


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

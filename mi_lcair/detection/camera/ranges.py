"""The outline of a target, and how the camera spreads it over pixels from other ranges."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from operator import attrgetter

import numpy as np
from numpy.typing import ArrayLike

from mi_lcair.detection.camera.electronics import Camera
from mi_lcair.detection.camera.exposure import Exposure, detector_mean
from mi_lcair.detection.camera.optics import MARGIN, OVERSAMPLING, Optics
from mi_lcair.detection.camera.view import CameraView
from mi_lcair.detection.irradiance import Backdrop
from mi_lcair.errors import InputError
from mi_lcair.physics.air.atmosphere import Atmosphere
from mi_lcair.physics.bands import Band
from mi_lcair.physics.imager import Imager
from mi_lcair.rendering.images.spectral import Arrival
from mi_lcair.rendering.scene import Scene
from mi_lcair.rendering.views import meets_model
from mi_lcair.rendering.window import window

CELLS = 1024  # rays along each side of the target's window
# Largest target that is put into the frame, in pixels along its longer side. A nearer one is spread
# over pixels in the same proportion.
LARGEST = 300


@dataclass(frozen=True)
class Silhouette:
    """Outline of a target whose middle the camera sees at the same place from all ranges.

    Attributes
    ----------
    meets : ndarray, shape (r, c)
        Share of each cell of an even grid that the target fills.
    across, down : ndarray, shape (c + 1,) and (r + 1,)
        Borders of columns and rows of the grid, m from the target's middle to the right and down.
    middle : tuple of float
        Column and row of the target's middle in the frame.
    pixel_angle : float
        Angle between the lines of sight of neighbouring pixels, rad.
    """

    meets: np.ndarray
    across: np.ndarray
    down: np.ndarray
    middle: tuple[float, float]
    pixel_angle: float

    @staticmethod
    def of(scene: Scene, view: CameraView, range_m: float) -> "Silhouette":
        """The part in the frame of a target that a scene from `seen_from` looks at.

        view, range_m: camera and its range, m, that say which part is in the frame.
        """
        meets = meets_model(scene, CELLS)[1].numpy().reshape(CELLS, CELLS).astype(float)
        corner, right, down, toward = window(scene.sensor(0))
        from_middle = corner - (view.eye + range_m * toward)
        across, downward = (
            from_middle @ side / np.linalg.norm(side)
            + np.linspace(0, np.linalg.norm(side), CELLS + 1)
            for side in (right, down)
        )
        imager = view.imager
        depth = toward @ view.axis if imager.projection == "perspective" else 1.0
        middle = (
            imager.width / 2 + toward @ view.right / depth / imager.pixel_angle,
            imager.height / 2 - toward @ view.up / depth / imager.pixel_angle,
        )
        whole = Silhouette(meets, across, downward, middle, imager.pixel_angle)
        columns, rows = (
            (place[1:] > 0) & (place[:-1] < count)
            for place, count in zip(whole.places(range_m), (imager.width, imager.height))
        )
        in_frame = rows[:, None] & columns
        meets *= in_frame
        # A target so thin that the rays miss it fills its window
        if not meets.any():
            meets[:] = in_frame if in_frame.any() else 1.0
        return whole.cropped()

    def cropped(self) -> "Silhouette":
        """The same outline on the part of the grid that holds it."""
        rows, columns = (slice(on.min(), on.max() + 1) for on in np.nonzero(self.meets))
        return replace(
            self,
            meets=self.meets[rows, columns],
            across=self.across[columns.start : columns.stop + 1],
            down=self.down[rows.start : rows.stop + 1],
        )

    def places(self, range_m: float) -> tuple[np.ndarray, np.ndarray]:
        """Columns and rows of the frame at which the grid's borders are seen from a range, m."""
        scale = range_m * self.pixel_angle
        return self.middle[0] + self.across / scale, self.middle[1] + self.down / scale

    @property
    def nearest_m(self) -> float:
        """Range at which the grid is LARGEST pixels long, m."""
        return max(np.ptp(self.across), np.ptp(self.down)) / self.pixel_angle / LARGEST

    def fits_from(self, imager: Imager) -> float:
        """Shortest range at which the whole outline is in the imager's frame, m."""
        across, down = self.across / self.pixel_angle, self.down / self.pixel_angle
        (column, row), (width, height) = self.middle, (imager.width, imager.height)
        ends = (-across[0], column), (across[-1], width - column)
        ends += (-down[0], row), (down[-1], height - row)
        return max(end / room for end, room in ends if room > 0)

    @cached_property
    def area(self) -> np.ndarray:
        """Cells that the target fills above and to the left of each corner, (r + 1, c + 1)."""
        return np.pad(self.meets, ((1, 0), (1, 0))).cumsum(axis=0).cumsum(axis=1)

    def spread(self, optics: Optics, range_m: float) -> tuple[float, float]:
        """How pixels share the light of an even target at a range, m.

        Returns
        -------
        tuple of float
            Root of the sum of squares of the pixels' shares, and the largest share. All shares add
            up to 1.
        """
        samples = self.samples(range_m)
        around = ((MARGIN, MARGIN), (MARGIN, MARGIN))
        shares = optics.seen(samples, around) * OVERSAMPLING**2 / samples.sum()
        return float(np.sqrt(np.sum(shares**2))), float(shares.max())

    def samples(self, range_m: float) -> np.ndarray:
        """Share of each sample of the target's pixels that it fills, seen from a range, m."""
        area = self.area
        for axis, place in enumerate(self.places(range_m)[::-1]):
            first, last = int(np.floor(place[0])), int(np.ceil(place[-1]))
            borders = first + np.arange(OVERSAMPLING * (last - first) + 1) / OVERSAMPLING
            cells = np.interp(borders, place, np.arange(len(place)))
            cell = np.minimum(cells.astype(int), len(place) - 2)
            lower, upper = (area.take(cell + k, axis=axis) for k in (0, 1))
            weight = (cells - cell)[:, None] if axis == 0 else cells - cell
            area = np.diff(lower + weight * (upper - lower), axis=axis)
            area *= OVERSAMPLING * (place[1] - place[0])
        return area


# Signal-to-noise ratio and number of pixels of a target at other ranges
# ----------------------------------------------------------------------

NEAREST = 4  # shortest range of the table, in radii of the target, if that fits into the frame
FARTHEST = 1000  # longest range of the table in vacuum, in ranges of the scenario
STEPS = (1, 2, 5)  # ranges of the table in each decade
FINE = 100  # ranges at which the end of the detection is sought, and again between two of them
FINEST = 1.0001  # ratio of the ranges between which it is not sought any more
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
    knots = np.geomspace(min(ranges), max(ranges), SPREADS)
    logarithms = np.log(target.spread(knots))

    def farthest(detected: Callable[[RangeRow], bool], within: np.ndarray) -> float | None:
        spread = np.exp([np.interp(np.log(within), np.log(knots), values) for values in logarithms])
        fine_rows = target.rows(within, np.interp(within, ranges, levels), spread)
        last = max((k for k, row in enumerate(fine_rows) if detected(row)), default=None)
        if last is None or within[-1] < FINEST * within[0]:
            return last if last is None else float(within[last])
        return farthest(detected, np.geomspace(within[last], within[last : last + 2][-1], FINE))

    fine = np.geomspace(min(ranges), max(ranges), FINE)
    ends = (farthest(attrgetter(name), fine) for name in ("detected", "peak_detected"))
    return target.rows(ranges, levels, target.spread(ranges)), *ends


def table_ranges(air: Atmosphere, shortest_m: float, range_m: float) -> np.ndarray:
    """Ranges 1, 2, 5, 10, ... m of a table from `shortest_m` on, and `range_m`.

    They end where the air's table does, and in vacuum at FARTHEST times `range_m`.
    """
    shortest = min(shortest_m, range_m)
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

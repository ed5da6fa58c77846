"""The outline of a target, and how the camera spreads it over pixels from other ranges."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from operator import attrgetter

import numpy as np
import scipy
from numpy.typing import ArrayLike

from mi_lcair.detection.camera.electronics import Camera
from mi_lcair.detection.camera.exposure import Exposure, TargetPicture, detector_mean
from mi_lcair.detection.camera.measures import matched_ratio
from mi_lcair.detection.camera.optics import MARGIN, OVERSAMPLING
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
    images : ndarray, shape (1 + K, r, c)
        Share of each cell of an even grid that the target fills, and images of its light.
    across, down : ndarray, shape (c + 1,) and (r + 1,)
        Borders of columns and rows of the grid, m from the target's middle to the right and down.
    middle : tuple of float
        Column and row of the target's middle in the frame.
    pixel_angle : float
        Angle between the lines of sight of neighbouring pixels, rad.
    """

    images: np.ndarray
    across: np.ndarray
    down: np.ndarray
    middle: tuple[float, float]
    pixel_angle: float

    @staticmethod
    def of(scene: Scene, view: CameraView, range_m: float) -> "Silhouette":
        """The part in the frame of a target that a scene from `seen_from` looks at, without light.

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
        whole = Silhouette(meets[None], across, downward, *middle_of(view))
        columns, rows = (
            (place[1:] > 0) & (place[:-1] < count)
            for place, count in zip(whole.places(range_m), (view.imager.width, view.imager.height))
        )
        in_frame = rows[:, None] & columns
        meets *= in_frame
        # A target so thin that the rays miss it fills its window
        if not meets.any():
            meets[:] = in_frame if in_frame.any() else 1.0
        return whole.cropped()

    @staticmethod
    def of_picture(picture: TargetPicture, view: CameraView, range_m: float) -> "Silhouette":
        """A target as a camera has seen it from a range, m, in the parts of its window."""
        middle, scale = middle_of(view), range_m * view.imager.pixel_angle
        across, down = (
            scale * ((first + np.arange(count + 1)) / view.parts - place)
            for first, count, place in zip(view.first, view.size, middle[0])
        )
        return Silhouette(picture.images, across, down, *middle).cropped()

    def cropped(self) -> "Silhouette":
        """The same outline on the part of the grid that holds it."""
        rows, columns = (slice(on.min(), on.max() + 1) for on in np.nonzero(self.images[0]))
        return replace(
            self,
            images=self.images[:, rows, columns],
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

    def pixels(self, range_m: float) -> float:
        """Number of pixels that the target fills at a range, m."""
        cell = np.diff(self.across)[0] * np.diff(self.down)[0]
        return float(self.images[0].sum() * cell / (range_m * self.pixel_angle) ** 2)

    def seen(self, camera: Camera, range_m: float) -> np.ndarray:
        """The images in the pixels of the frame around the target at a range, m, (1 + K, h, w)."""
        optics, around = camera.optics.at(range_m), ((MARGIN, MARGIN), (MARGIN, MARGIN))
        imager, kept = camera.imager, []
        places = self.places(range_m)[::-1]
        for place, count in zip(places, (imager.height, imager.width)):
            first = int(np.floor(place[0])) - MARGIN
            kept.append((slice(max(-first, 0), max(count - first, 0)), max(first, 0)))
        images = np.array(
            [
                optics.seen(self.samples(image, range_m), around)[kept[0][0], kept[1][0]]
                for image in self.images
            ]
        )
        height, width = images.shape[1:]
        gain = np.broadcast_to(camera.design.gain, (imager.height, imager.width))
        return images * gain[kept[0][1] :, kept[1][1] :][:height, :width]

    def samples(self, of_cells: np.ndarray, range_m: float) -> np.ndarray:
        """Means of an array over the grid in the samples of the pixels, seen from a range, m."""
        area = np.pad(of_cells, ((1, 0), (1, 0))).cumsum(axis=0).cumsum(axis=1)
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


def middle_of(view: CameraView) -> tuple[tuple[float, float], float]:
    """Column and row of the target's middle in the frame, and the angle of a pixel, rad."""
    imager, toward = view.imager, view.toward
    depth = toward @ view.axis if imager.projection == "perspective" else 1.0
    scale = depth * imager.pixel_angle
    return (
        imager.width / 2 + toward @ view.right / scale,
        imager.height / 2 - toward @ view.up / scale,
    ), imager.pixel_angle


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
    above the background, sum over the pixels; W for a bolometer. snr: signal-to-noise ratio of the
    whole target with a matched filter. peak_snr: that of its strongest pixel. detected: whether
    pixels and `snr` suffice. lacks: which of them does not, in words; "" if both do.
    peak_detected: whether pixels and `peak_snr` suffice.
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

    Pixel j has c_j = sum over k of a_k(R) p_kj(R) electrons more than the background: p_0 is the
    blurred outline of the target at that range, with the electrons a_0 of the path less those of
    the background that it hides, and the others are blurred images of its light, see
    `TargetPicture`. A matched filter has the ratio sqrt(sum c_j^2) / noise, less where pixels share
    noise, and the strongest pixel max |c_j| / noise. Of each c_j only what the well holds counts.

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

    def amounts(self, arrival: Arrival, background: np.ndarray) -> np.ndarray:
        """Electrons a_k of the images in a pixel that they fill, (1 + K, r)."""
        return np.vstack([arrival.path - background, self.exposure.picture.amounts(arrival)])

    def arrival(self, ranges_m: np.ndarray) -> Arrival:
        """What arrives from some ranges, m."""
        sources, band = self.exposure.sources, self.camera.band
        return Arrival.of(sources, self.band, band, self.air, ranges_m, extrapolate=True)

    def spread(self, ranges_m: np.ndarray, background: np.ndarray) -> "Spread":
        """How the target spreads over pixels at some ranges."""
        products, shared, kept, strongest = [], [], [], []
        for range_m, level, amounts in zip(
            ranges_m, background, self.amounts(self.arrival(ranges_m), background).T
        ):
            within = max(range_m, self.silhouette.nearest_m)
            images = self.silhouette.seen(self.camera, within)
            contrast = np.tensordot(amounts, images, 1)
            held = self.camera.kept_contrast(level, contrast)
            # A nearer target has more pixels, in proportion to its area
            magnified = within / range_m
            flat = images.reshape(len(images), -1) * magnified
            products.append(flat @ flat.T)
            shared.append(self.camera.pattern.products(images, magnified))
            whole, rest = (self.matched(of, magnified) for of in (contrast, held))
            kept.append(rest / whole if whole else 1.0)
            strongest.append(np.abs(held).max() / self.noise / rest if rest else 0.0)
        return Spread(*map(np.array, (products, shared, kept, strongest)))

    def matched(self, contrast: np.ndarray, magnified: float) -> float:
        """Ratio of a matched filter for a contrast in the pixels, which is larger than given."""
        shared = self.camera.pattern.products(contrast[None], magnified)[0, 0]
        squares = np.sum((magnified * contrast) ** 2)
        return float(matched_ratio(squares, shared, self.noise))

    def rows(self, ranges_m: ArrayLike, background: np.ndarray, spread: "Spread") -> list[RangeRow]:
        """The target at some ranges.

        ranges_m: ranges, m, (r,). background: electrons of the background in a pixel, for a target
        at each range, (r,). spread: that of the target at each range.
        """
        ranges_m, camera, exposure = np.asarray(ranges_m, dtype=float), self.camera, self.exposure
        arrival = self.arrival(ranges_m)
        seen = arrival.of_parts(exposure.intensities)
        seen += exposure.area * (arrival.path - background)
        covered = (ranges_m * camera.imager.pixel_angle) ** 2
        electrons, pixels = seen / covered, exposure.area / covered
        amounts = self.amounts(arrival, background)
        squares, shared = (
            np.einsum("kr,rkl,lr->r", amounts, of, amounts)
            for of in (spread.products, spread.shared)
        )
        ratio = matched_ratio(np.maximum(squares, 0), shared, self.noise) * spread.kept
        peak = spread.strongest * ratio
        enough = pixels >= camera.imager.least_pixels
        criteria = {"signal to noise": ratio >= self.snr, "pixels": enough}
        peak_detected = enough & (peak >= self.snr)
        rows = []
        for k, row in enumerate(zip(ranges_m, pixels, electrons, ratio, peak)):
            lacking = [name for name, suffices in criteria.items() if not suffices[k]]
            in_words = " and ".join(lacking)
            rows.append(RangeRow(*map(float, row), not lacking, in_words, bool(peak_detected[k])))
        return rows


@dataclass(frozen=True)
class Spread:
    """How a target spreads over pixels at r ranges.

    products: sums over the pixels of p_k p_l, (r, 1 + K, 1 + K). shared: what rows, columns and
    frames add to them, see `Pattern.products`. kept: share of the root of the sum
    of c^2 that the well keeps, (r,). strongest: the strongest pixel's share of that, (r,).
    """

    products: np.ndarray
    shared: np.ndarray
    kept: np.ndarray
    strongest: np.ndarray

    def between(self, ranges_m: np.ndarray, others_m: np.ndarray) -> "Spread":
        """That at other ranges between those of this one, m."""
        x, at = np.log(ranges_m), np.log(others_m)
        scale = ranges_m[:, None, None] ** 3  # the sums fall as R^-2 to R^-4
        products, shared = (
            scipy.interpolate.PchipInterpolator(x, scale * of)(at) / others_m[:, None, None] ** 3
            for of in (self.products, self.shared)
        )
        return Spread(
            products,
            shared,
            np.interp(at, x, self.kept),
            np.interp(at, x, self.strongest),
        )


def at_ranges(
    target: RangedTarget, backdrop: Backdrop, ranges_m: np.ndarray
) -> tuple[list[RangeRow], float | None, float | None]:
    """The target at those ranges, m, at which the background is known.

    The other values are the largest ranges, m, at which a matched filter and the strongest pixel
    detect it; None for nowhere.
    """
    ranges, levels = backgrounds(backdrop, target.camera.band, ranges_m)
    knots = np.geomspace(min(ranges), max(ranges), SPREADS)
    at_knots = target.spread(knots, np.interp(knots, ranges, levels))

    def farthest(detected: Callable[[RangeRow], bool], within: np.ndarray) -> float | None:
        spread = at_knots.between(knots, within)
        fine_rows = target.rows(within, np.interp(within, ranges, levels), spread)
        last = max((k for k, row in enumerate(fine_rows) if detected(row)), default=None)
        if last is None or within[-1] < FINEST * within[0]:
            return last if last is None else float(within[last])
        return farthest(detected, np.geomspace(within[last], within[last : last + 2][-1], FINE))

    fine = np.geomspace(min(ranges), max(ranges), FINE)
    ends = (farthest(attrgetter(name), fine) for name in ("detected", "peak_detected"))
    return target.rows(ranges, levels, target.spread(ranges, levels)), *ends


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

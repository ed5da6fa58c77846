"""The outline of a target, and how the camera spreads it over pixels from other ranges."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from mi_lcair.camera.optics import MARGIN, OVERSAMPLING, Optics
from mi_lcair.camera.view import CameraView
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

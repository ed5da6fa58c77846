"""The camera's view of a model: Mitsuba's sensor, and the part of the frame with the model."""

from dataclasses import dataclass

import mitsuba as mi
import numpy as np

from mi_lcair.detection.camera.optics import FARTHEST, MARGIN, OVERSAMPLING
from mi_lcair.errors import InputError
from mi_lcair.physics.imager import Imager
from mi_lcair.rendering.images.truth import CentreRays
from mi_lcair.rendering.scene import Scene
from mi_lcair.rendering.views import BESIDE, POLE_DEG, UP, Target, View, depth, film

BEFORE = 1.01  # distance from the target's middle at which rays begin, in radii of the target
PARTS_ACROSS = 48  # parts across a model, at least, in which it is rendered
PARTS_THROUGH = 6  # parts across its thinner side, at least
MOST_PARTS = 2**20  # parts along a side of the frame; their places are known in single precision


@dataclass(frozen=True)
class Pointing:
    """Shift and turn of the image by an error of the pointing.

    See `mi_lcair.rendering.motions.motion`.

    x_px, y_px: shift of the image to the right and down [pixels]. roll_deg: turn of the camera
    about its axis, to the right [deg].
    """

    x_px: float = 0.0
    y_px: float = 0.0
    roll_deg: float = 0.0


@dataclass(frozen=True)
class CameraView:
    """Position and pointing of a camera, and the window of its frame that holds the model.

    Rows of the frame go down, columns to the right. The window reaches up to MARGIN pixels beyond
    the frame, because the optics scatter light from there into it.

    Attributes
    ----------
    imager : Imager
    eye : ndarray, shape (3,)
        Position of the camera, m.
    toward : ndarray, shape (3,)
        Unit vector from the camera to the target's middle.
    axis, right, up : ndarray, shape (3,)
        Unit vectors of the optical axis and of the sides of the frame.
    near_m : float
        Distance along the optical axis at which rays begin, just before the model, m.
    pixel_m : float
        Distance of neighbouring lines of sight at the model's middle, m.
    parts : int
        Parts along each side of a pixel in which the model is rendered, a multiple of OVERSAMPLING.
        A model that is smaller than some pixels has more parts, so that paths meet it.
    first, size : tuple of int
        Column and row of the window's first part, and its columns and rows, in parts.
    beyond : ((int, int), (int, int))
        Pixels by which the model goes on above and below the window, left and right of it. It is
        taken to go on as at the window's border.
    is_cut : bool
        Whether a part of the model is outside the frame.
    """

    imager: Imager
    eye: np.ndarray
    toward: np.ndarray
    axis: np.ndarray
    right: np.ndarray
    up: np.ndarray
    near_m: float
    pixel_m: float
    parts: int
    first: tuple[int, int]
    size: tuple[int, int]
    beyond: tuple[tuple[int, int], tuple[int, int]]
    is_cut: bool

    @staticmethod
    def of(
        target: Target,
        view: View,
        range_m: float,
        imager: Imager,
        pointing: Pointing = Pointing(),
        present: Target | None = None,
        room: int = 0,
    ) -> "CameraView":
        """The view of a camera at `range_m`, m, from the middle of the target.

        pointing: error of the camera's pointing. present: the target in another pose, if the window
        is to hold that. room: pixels that the window has around the target in addition.

        Raises
        ------
        InputError
            If the camera is inside the target's sphere, or no part of the target is in the frame.
        """
        target.check_outside(range_m)
        axes = axes_of(target, view, range_m, imager, pointing)
        eye, axis, right, up = axes.values()
        present = present or target
        middle = (present.centre - eye) @ axis - room * range_m * imager.pixel_angle
        near = max(middle - BEFORE * present.radius, 1e-4 * present.radius)
        seen = present.points - eye
        scale = imager.pixel_angle
        if imager.projection == "perspective":
            distance = seen @ axis
            seen = seen[distance > 0] / distance[distance > 0, None]
        else:
            scale *= range_m
        columns = imager.width / 2 + seen @ right / scale
        rows = imager.height / 2 - seen @ up / scale
        width, height = (imager.angle_deg(n) for n in (imager.width, imager.height))
        outside = InputError(
            f"[camera]: no part of the target is in the frame of {width:.3g} x {height:.3g} "
            "degrees; change right_deg and up_deg, or focal_length_mm"
        )
        if not columns.size:
            raise outside
        sides = sorted((np.ptp(columns), np.ptp(rows)))
        extent = min(sides[1], sides[0] * PARTS_ACROSS / PARTS_THROUGH)
        parts = OVERSAMPLING * int(
            np.clip(
                np.ceil(PARTS_ACROSS / max(OVERSAMPLING * extent, 1e-9)),
                1,
                max(MOST_PARTS // (OVERSAMPLING * max(film_size(imager))), 1),
            )
        )
        first, size, beyond, is_cut = [], [], [], False
        for place, count in ((columns, imager.width), (rows, imager.height)):
            start, end = (int(np.clip(np.floor(value), -1e9, 1e9)) for value in ends(place * parts))
            start, end = start - room * parts, end + 1 + room * parts
            if not max(start, 0) < min(end, count * parts):
                raise outside
            is_cut |= start < 0 or end > count * parts
            lower, upper = -MARGIN * parts, (count + MARGIN) * parts
            first.append(max(start, lower))
            size.append(min(end, upper) - first[-1])
            rest = max(lower - start, 0), max(end - upper, 0)
            beyond.insert(0, tuple(min(-(-more // parts), FARTHEST) for more in rest))
        return CameraView(
            imager=imager,
            **axes,
            toward=-view.direction,
            near_m=near,
            pixel_m=range_m * imager.pixel_angle,
            parts=parts,
            first=tuple(first),
            size=tuple(size),
            beyond=tuple(beyond),
            is_cut=is_cut,
        )

    @property
    def window(self) -> tuple[tuple[int, int], tuple[int, int]]:
        """Column and row of the first pixel with a part of the window; its columns and rows."""
        first = tuple(start // self.parts for start in self.first)
        last = (-(-(start + n) // self.parts) for start, n in zip(self.first, self.size))
        return first, tuple(end - start for start, end in zip(first, last))

    @property
    def around(self) -> tuple[tuple[int, int], tuple[int, int]]:
        """Pixels above and below `samples`, left and right of them, to the frame's border.

        They are negative where the samples go beyond it.
        """
        (column, row), (columns, rows) = self.window
        gaps = (
            (row, self.imager.height - row - rows),
            (column, self.imager.width - column - columns),
        )
        return tuple(
            tuple(gap - more for gap, more in zip(*pairs)) for pairs in zip(gaps, self.beyond)
        )

    @property
    def inside(self) -> np.ndarray:
        """Whether each part is in the frame, (rows, columns)."""
        columns, rows = (
            (start + np.arange(n) >= 0) & (start + np.arange(n) < self.parts * count)
            for start, n, count in zip(
                self.first, self.size, (self.imager.width, self.imager.height)
            )
        )
        return rows[:, None] & columns

    def sensor(self, scene: Scene) -> mi.Sensor:
        """Mitsuba's sensor, whose film is the window. It sees nothing in front of `near_m`."""
        camera = self.imager
        width, height = film_size(camera)
        T = mi.ScalarTransform4f
        # Mitsuba's x axis goes to the left of the image
        sides = np.column_stack([-self.right, self.up, self.axis, self.eye])
        place = T(np.vstack([sides, [0, 0, 0, 1]]))
        kind = {"type": "perspective", "fov": camera.angle_deg(width), "fov_axis": "x"}
        if camera.projection == "orthographic":
            half = width * self.pixel_m / 2
            kind, place = {"type": "orthographic"}, place @ T().scale([half, half, 1])
        crop = {
            "crop_offset_x": self.first[0] + MARGIN * self.parts,
            "crop_offset_y": self.first[1] + MARGIN * self.parts,
            "crop_width": self.size[0],
            "crop_height": self.size[1],
        }
        return mi.load_dict(
            kind
            | {
                "to_world": place,
                "near_clip": self.near_m,
                "far_clip": self.near_m + depth(scene),
                "film": film(self.parts * width, self.parts * height) | crop,
                "sampler": {"type": scene.sampler},
            },
            parallel=False,
        )

    def near_range(self) -> np.ndarray:
        """Distance, m, from the camera to where the ray of each part begins, (rows, columns)."""
        columns, rows = self.size
        if self.imager.projection == "orthographic":
            return np.full((rows, columns), self.near_m)
        middle = np.array([self.imager.width, self.imager.height]) / 2
        x, y = (
            self.imager.pixel_angle * ((first + np.arange(n) + 0.5) / self.parts - half)
            for first, n, half in zip(self.first, (columns, rows), middle)
        )
        return self.near_m * np.sqrt(1 + x**2 + y[:, None] ** 2)

    def samples(self, values: np.ndarray) -> np.ndarray:
        """Means of the parts over the samples of the window's pixels, OVERSAMPLING along a side.

        values: of each part, (rows, columns). Outside the parts they are 0, and `beyond` the window
        those at its border.
        """
        samples = self.means(values, OVERSAMPLING)
        return np.pad(samples, OVERSAMPLING * np.array(self.beyond), mode="edge")

    def frame(self, values: np.ndarray) -> np.ndarray:
        """Means of the parts over the pixels of the frame, (H, W); 0 outside the parts."""
        frame, pixels = np.zeros((self.imager.height, self.imager.width)), self.means(values, 1)
        (column, row), _ = self.window
        places = [
            (slice(max(first, 0), max(first + n, 0)), slice(max(-first, 0), max(size - first, 0)))
            for first, n, size in zip((row, column), pixels.shape, frame.shape)
        ]
        (rows, of_rows), (columns, of_columns) = places
        frame[rows, columns] = pixels[of_rows, of_columns]
        return frame

    def means(self, values: np.ndarray, side: int) -> np.ndarray:
        """Means of the parts over `side` x `side` samples of each of the window's pixels."""
        (column, row), (columns, rows) = self.window
        whole = np.zeros((rows * self.parts, columns * self.parts))
        left, top = (start - pixel * self.parts for start, pixel in zip(self.first, (column, row)))
        whole[top : top + self.size[1], left : left + self.size[0]] = values
        each = self.parts // side
        return whole.reshape(rows * side, each, columns * side, each).mean(axis=(1, 3))

    def centre_rays(self, scene: Scene) -> CentreRays:
        """Rays through the centres of the frame's pixels, which begin at `near_m`."""
        camera = self.imager
        row, column = np.indices((camera.height, camera.width)).reshape(2, -1, 1) + 0.5
        aside = (column - camera.width / 2) * self.right - (row - camera.height / 2) * self.up
        if camera.projection == "orthographic":
            start = self.eye + self.pixel_m * aside + self.near_m * self.axis
            toward = np.broadcast_to(self.axis, start.shape)
        else:
            toward = self.axis + camera.pixel_angle * aside
            start = self.eye + self.near_m * toward
            toward = toward / np.linalg.norm(toward, axis=1, keepdims=True)
        ray = mi.Ray3f(mi.Point3f(start.T), mi.Vector3f(toward.T))
        ray.maxt = depth(scene)
        return CentreRays(ray, self.eye, self.axis, (camera.height, camera.width))


def axes_of(
    target: Target, view: View, range_m: float, imager: Imager, pointing: Pointing
) -> dict[str, np.ndarray]:
    """Position and unit vectors of a camera: eye, axis, right and up, see `CameraView`."""
    right, up = level_sides(view)
    aside, higher = np.tan(np.radians([imager.right_deg, imager.up_deg]))
    axis = unit(aside * right + higher * up - view.direction)
    right = unit(np.cross(axis, up))
    right, up = rolled(right, np.cross(right, axis), imager.roll_deg)
    eye = target.centre + range_m * view.direction
    # An image that lies farther to the right is that of a camera which points farther to the left
    turn = imager.pixel_angle * (pointing.y_px * up - pointing.x_px * right)
    if imager.projection == "orthographic":
        eye = eye + range_m * turn
    else:
        axis = unit(axis + turn)
        right = unit(np.cross(axis, up))
    right, up = rolled(right, np.cross(right, axis), pointing.roll_deg)
    return {"eye": eye, "axis": axis, "right": right, "up": up}


def pointing_of(view: View, right: np.ndarray, axis: np.ndarray) -> dict[str, float]:
    """right_deg, up_deg and roll_deg of a camera, from its unit vectors: inverse of `axes_of`."""
    level, above = level_sides(view)
    aside, higher = np.degrees(np.arctan2([axis @ level, axis @ above], -axis @ view.direction))
    level = unit(np.cross(axis, above))
    roll = np.degrees(np.arctan2(-right @ np.cross(level, axis), right @ level))
    return {"right_deg": float(aside), "up_deg": float(higher), "roll_deg": float(roll)}


def level_sides(view: View) -> tuple[np.ndarray, np.ndarray]:
    """Unit vectors to the right and upward of a camera that looks against a view's direction."""
    above = UP if abs(view.elevation_deg) < POLE_DEG else BESIDE
    right = unit(np.cross(above, view.direction))
    return right, np.cross(view.direction, right)


def rolled(right: np.ndarray, up: np.ndarray, angle_deg: float) -> tuple[np.ndarray, np.ndarray]:
    """The vectors to the right and upward of a camera that turns to the right about its axis."""
    cos, sin = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))
    return cos * right - sin * up, cos * up + sin * right


def film_size(imager: Imager) -> tuple[int, int]:
    """Columns and rows of the frame with MARGIN pixels around it."""
    return imager.width + 2 * MARGIN, imager.height + 2 * MARGIN


def ends(values) -> tuple[float, float]:
    """The smallest and the largest value."""
    return float(np.min(values)), float(np.max(values))


def unit(vector) -> np.ndarray:
    """The vector divided by its length."""
    return np.asarray(vector) / np.linalg.norm(vector)

"""Windows of a sensor's film, and the window of an orthographic sensor.

The mean radiance of an orthographic sensor's window times the area of the window is an intensity.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import mitsuba as mi
import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.plugins.paths.launch import Aim, Launch, by_camera, views_of
from mi_lcair.rendering.measurands import check_paths
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.statistics import Totals

# Paths of one pass. A pass takes seconds, and Ctrl-C takes effect at its end.
PASS_SAMPLES = 2**20
# Independent randomisations of the points of a window and of a pixel. Their scatter gives the
# standard error.
RANDOMISATIONS, PIXEL_RANDOMISATIONS = 8, 4
FIRST_PATHS = 2**12  # paths of all windows before the first estimate of the error
LEAST_POINTS = 16  # smallest first number of points in each randomisation of a window
PILOT_SPP = 16  # samples per pixel of an image before the first estimate of the error
PARTS_OF_DOUBLING = 4  # steps in which the points of many windows are doubled
MOST_DOUBLINGS = 3  # the error is itself an estimate, so the next goal is at most 8 times as far
MOST_TIMES = 4  # the same for an image, whose number of samples is not doubled


@dataclass(frozen=True)
class Windows:
    """Equal windows of a sensor's film, whose mean radiances are measured.

    All paths of a window use the points of a few lattices, whose first two dimensions are the
    position in the window. The mean over a window of many pixels therefore needs far fewer paths
    than the mean of an image.

    Attributes
    ----------
    sensor : mi.Sensor
    columns, rows : int
        Number of windows along the sides of the film.
    randomisations : int
        Independent randomisations of the points of each window.
    pixels, parts : int
        Pixels of a window, or windows of a pixel, by which samples per pixel are counted.
    are_pixels : bool
        Whether the windows are the pixels of an image. Their error is then one number.
    by_randomisation : bool
        Whether `Totals` keeps the channels for each randomisation.
    may_follow_facets : bool
        Whether paths may begin on facets of the model. Such an aim is for one state of the scene.
    """

    sensor: mi.Sensor
    columns: int = 1
    rows: int = 1
    randomisations: int = RANDOMISATIONS
    pixels: int = 1
    parts: int = 1
    are_pixels: bool = False
    by_randomisation: bool = True
    may_follow_facets: bool = False

    @staticmethod
    def whole(sensor) -> "Windows":
        """One window: the whole film of a sensor."""
        return Windows(sensor, pixels=int(np.prod(sensor.film().crop_size())))

    @staticmethod
    def of_image(sensor, randomisations: int, by_randomisation: bool = False) -> "Windows":
        """A window for each pixel of a sensor."""
        columns, rows = sensor.film().crop_size()
        return Windows(
            sensor,
            columns,
            rows,
            randomisations,
            are_pixels=True,
            by_randomisation=by_randomisation,
        )

    @property
    def count(self) -> int:
        return self.columns * self.rows

    @property
    def size(self) -> tuple[int, int]:
        return self.rows, self.columns

    @property
    def may_be_aimed(self) -> bool:
        """Whether paths may begin where the model is, rather than anywhere."""
        is_batch = self.sensor.class_name() == "BatchSensor" and self.rows == 1
        views = views_of(self.sensor) if is_batch else [self.sensor]
        is_whole = not self.are_pixels and (len(views) == self.columns or not is_batch)
        return is_whole and all(view.class_name() == "OrthographicCamera" for view in views)

    def totals(self, tracer, aim: Aim | None = None) -> Totals:
        """Totals without paths, for paths that begin anywhere, or as `aim` says."""
        if aim is None and not self.are_pixels:
            aim = Aim.anywhere()
        return Totals(
            self.count,
            self.randomisations,
            self.by_randomisation,
            tracer.unmet_sources(self.sensor, aim),
            tracer.systematic_error,
            aim,
            tracer.emitters,
        )

    def points(self, spp: int) -> int:
        """Points of each randomisation for at least this number of samples per pixel."""
        return max(1, -(-spp * self.pixels // (self.parts * self.randomisations)))

    def check(self, sampling: Sampling) -> None:
        """Raise InputError for a number of samples per pixel that is too large."""
        check_paths(self.count * self.pixels // self.parts, sampling.spp)

    def paths(self, sampling: Sampling) -> int:
        """Paths of each window for a fixed number of them, or of samples per pixel."""
        return sampling.paths or -(-sampling.spp * self.pixels // self.parts)

    def points_of_pass(self, active: int) -> int:
        """Points of each randomisation that one pass adds to this number of windows."""
        points = max(1, PASS_SAMPLES // (active * self.randomisations))
        return 2 ** (points.bit_length() - 1)  # so that many are summed together

    def first_points(self) -> int:
        """Points of each randomisation before the first estimate of the error."""
        if self.are_pixels:
            return self.points(PILOT_SPP)
        points = max(LEAST_POINTS, FIRST_PATHS // (self.count * self.randomisations))
        return 2 ** (points.bit_length() - 1)  # see `next_points`

    def next_points(self, done: int, excess: float) -> int:
        """Points of each randomisation after which the error is estimated again.

        Parameters
        ----------
        done : int
            Points of each randomisation so far.
        excess : float
            Ratio of the error to the allowed error, above 1.
        """
        if self.are_pixels:
            samples = done * self.randomisations
            needed = int(min(MOST_TIMES * samples, samples * 1.05 * excess**2 + 1))
            return -(-needed // self.randomisations)
        # The next goal is not beyond what an error needs that falls as 1 / points
        if self.count > 1 and excess < 2:
            # Some of many windows are done after a part of a doubling
            part = max(1, 2 ** (done.bit_length() - 1) // PARTS_OF_DOUBLING)
            return done + part * int(np.ceil((excess - 1) * done / part))
        # A lattice is most uniform after a power of two points, so that the number is doubled
        doublings = np.clip(np.floor(np.log2(min(excess, 2.0**MOST_DOUBLINGS))), 1, MOST_DOUBLINGS)
        return done * 2 ** int(doublings)

    def launches(
        self,
        active: np.ndarray,
        done: int,
        points: int,
        seed: int,
        aim: Aim | None,
        most_rows: int,
    ) -> Iterator[Launch]:
        """The launches that add points to some windows.

        Parameters
        ----------
        active : ndarray of int
            Numbers of the windows.
        done, points : int
            Points of each randomisation so far, and those that are added.
        seed : int
        aim : Aim or None
            Where in the windows the paths begin.
        most_rows : int
            Most windows times randomisations of a launch.
        """
        rows = min(PASS_SAMPLES // points, most_rows)
        each = max(1, rows // self.randomisations)  # windows of a launch
        for first in range(0, len(active), each):
            some = active[first : first + each]
            yield Launch(
                columns=self.columns,
                rows=self.rows,
                seed=seed,
                randomisations=self.randomisations,
                points=points,
                first_point=done,
                first=first,
                windows=len(some),
                listed=None if len(active) == self.count else tuple(some.tolist()),
                aim=aim,
            )


@by_camera
def window(sensor) -> tuple[np.ndarray, ...]:
    """The (cropped) window of an orthographic sensor, in Float64.

    A corner and the two sides from it [m], and the unit direction of view, (3,) each.
    """
    ray, _ = sensor.sample_ray(0, 0, mi.Point2f([0, 1, 0], [0, 0, 1]), mi.Point2f(0.5))
    corner = np.array(ray.o, dtype=np.float64).T
    direction = np.array(ray.d, dtype=np.float64).reshape(3, -1)[:, 0]
    return corner[0], corner[1] - corner[0], corner[2] - corner[0], direction


def window_axes(sensor) -> tuple[np.ndarray, np.ndarray]:
    """Corner (3,) [m] of a window, and axes (3, 2) [1/m] that give positions in parts of it.

    The position of a point p is (p - corner) @ axes, the same all along a ray. Rounded sides are
    not quite perpendicular to the rays of a distant sensor.
    """
    corner, right, up, direction = window(sensor)
    return corner, np.linalg.inv(np.stack([right, up, direction], axis=1))[:2].T


def window_area(sensor, name: str) -> float:
    """Area of an orthographic sensor's window [m^2]; raises InputError for any other sensor."""
    if sensor.class_name() != "OrthographicCamera":
        raise InputError(
            f"{name}: an intensity needs an orthographic sensor, and this one is "
            f"{sensor.class_name()}; radiance times area is an intensity only where all rays are "
            "parallel; a trend adds such sensors, and derivative_images differentiates images"
        )
    _, right, up, _ = window(sensor)
    return float(np.linalg.norm(np.cross(right, up)))


def window_size(sensor) -> tuple[float, float] | None:
    """Width and height of an orthographic sensor's window [m]; None for any other sensor."""
    if sensor.class_name() != "OrthographicCamera":
        return None
    _, right, up, _ = window(sensor)
    return float(np.linalg.norm(right)), float(np.linalg.norm(up))


def toward_sensor(sensor) -> np.ndarray:
    """Direction from a scene toward a Mitsuba sensor, (3,)."""
    return -window(sensor)[3]

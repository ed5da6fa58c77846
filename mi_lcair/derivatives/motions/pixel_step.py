"""Steps of the differences of images: how far a motion moves what a pixel shows."""

import mitsuba as mi
import numpy as np

from mi_lcair.plugins.emission.triangles import vertex_positions
from mi_lcair.rendering.loading.parsing import extent
from mi_lcair.rendering.motions.motion import Motion, direction_of, matrix_of
from mi_lcair.rendering.motions.pose import moved, value_of

PIXELS = 0.25  # shift of an image for a difference: more blurs edges, less has more noise
MOST = {"deg": 1.0, "1": 0.02}  # longest steps by unit: coarse pixels would ask for longer ones
TRIAL = 1e-3  # change of a motion from which its displacement is taken, in its unit


def pixel_step(scene, sensor, motion: Motion, parts: int = 1) -> float:
    """Change of a motion that moves what a sensor sees by PIXELS at most, in the motion's unit.

    parts: pixels of the sensor's film along each side of a pixel.
    """
    return min(parts * of_pixels(scene, sensor, motion), MOST.get(motion.unit, np.inf))


def of_pixels(scene, sensor, motion: Motion) -> float:
    """The same for pixels of any size."""
    name = motion.name.rpartition(".")[2]
    if motion.unit == "pixel":
        return PIXELS
    if motion.shapes:
        before = corners(motion.shapes)
        with moved(scene, {motion.name: value_of(scene, motion) + TRIAL}):
            distance = np.linalg.norm(corners(motion.shapes) - before, axis=1).max() / TRIAL
        return PIXELS * pixel_pitch(sensor, before.mean(axis=0)) / max(float(distance), 1e-12)
    half_diagonal = np.hypot(*sensor.film().size()) / 2
    if name == "range_m":
        return PIXELS / half_diagonal * motion.rest
    if name == "roll_deg":
        return float(np.degrees(PIXELS / half_diagonal))
    low, high = extent(scene.mi)
    middle = (low + high) / 2
    # The farthest point from the origin of the file, about which the observer turns
    radius = np.linalg.norm(high - low) / 2 + np.linalg.norm(middle + scene.origin)
    return float(np.degrees(PIXELS * pixel_pitch(sensor, middle) / max(radius, 1e-12)))


def corners(shapes) -> np.ndarray:
    """Vertices of some meshes, (n, 3) [m]."""
    return np.concatenate([vertex_positions(shape).astype(float) for shape in shapes])


def pixel_pitch(sensor, point: np.ndarray) -> float:
    """Distance of neighbouring pixels of a sensor at the distance of a point (3,) [m]."""
    distance = direction_of(matrix_of(sensor), -point)[2]
    pixel = 1 / np.array(sensor.film().crop_size())
    ends = mi.Point2f([0.5, 0.5 + pixel[0]], [0.5, 0.5])
    ray, _ = sensor.sample_ray(0, 0, ends, mi.Point2f(0.5))
    a, b = (np.array(ray.o) + abs(distance) * np.array(ray.d)).T.astype(float)
    return float(np.linalg.norm(a - b))

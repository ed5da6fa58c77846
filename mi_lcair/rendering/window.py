"""The window of an orthographic sensor; mean radiance times its area is an intensity."""

import mitsuba as mi
import numpy as np

from mi_lcair.errors import InputError


def window(sensor) -> tuple[np.ndarray, ...]:
    """The (cropped) window of an orthographic sensor, in Float64.

    A corner and the two sides from it [m], and the unit direction of view, (3,) each.
    """
    ray, _ = sensor.sample_ray(0, 0, mi.Point2f([0, 1, 0], [0, 0, 1]), mi.Point2f(0.5))
    corner = np.array(ray.o, dtype=np.float64).T
    direction = np.array(ray.d, dtype=np.float64).reshape(3, -1)[:, 0]
    return corner[0], corner[1] - corner[0], corner[2] - corner[0], direction


def window_area(sensor, name: str, remedy: str = "") -> float:
    """Area of an orthographic sensor's window [m^2]; raises InputError for any other sensor.

    remedy: what the caller's user can do instead, for the message.
    """
    if sensor.class_name() != "OrthographicCamera":
        raise InputError(
            f"{name}: an intensity needs an orthographic sensor, and this one is "
            f"{sensor.class_name()}; radiance times area is an intensity only where all rays are "
            f"parallel{remedy}"
        )
    _, right, up, _ = window(sensor)
    return float(np.linalg.norm(np.cross(right, up)))


def window_size(sensor) -> tuple[float, float] | None:
    """Width and height of an orthographic sensor's window [m]; None for any other sensor."""
    if sensor.class_name() != "OrthographicCamera":
        return None
    _, right, up, _ = window(sensor)
    return float(np.linalg.norm(right)), float(np.linalg.norm(up))

"""Intensity of a scene in the direction of an orthographic sensor."""
from dataclasses import dataclass

import mitsuba as mi
import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.rendering import Render, Scene, render


@dataclass(frozen=True)
class Signature:
    """Intensity toward the sensor [W/sr] with its standard error, and how it splits.

    by_bounce: cumulative, for 0, 1, ... max_bounces reflections (from 64 on in one); by_group: by what emitted it;
    by_seen: by what the pixel shows first. `closure`: what stands in for the reflections beyond.
    """
    band: str
    intensity: float
    standard_error: float | None
    by_bounce: list[float]
    by_group: dict[str, float]
    by_seen: dict[str, float]
    closure: float
    seconds: float
    paths: int
    invalid: int
    reached: bool | None

    def as_dict(self) -> dict:
        return dict(vars(self))


def signature(scene: Scene, spp: int | None = None, tolerance: float | None = None, max_spp: int | None = None, seed: int = 0,
              sensor: int = 0, progress=None) -> Signature:
    """Renders the scene (as `render`) and integrates the radiance over the sensor's window: intensity = int L dA [W/sr]."""
    area = window_area(scene.sensor(sensor), scene.name)
    image = render(scene, spp, tolerance, max_spp, seed, sensor, progress=progress)

    def intensity(channel):
        return float(np.mean(image.channels[channel], dtype=np.float64) * area)

    def split(kind):
        return {name.split(".")[1]: intensity(name) for name in image.channels if name.startswith(f"{kind}.")}

    return Signature(image.band.name, image.mean * area, standard_error(image, area), list(np.cumsum(image.by_bounce) * area),
                     split("group"), split("seen"), intensity("closure.Y"), image.seconds, image.paths, image.invalid, image.reached)


def standard_error(image: Render, area: float) -> float | None:
    """Of the intensity: the pixels' errors are independent."""
    if "stderr.Y" not in image.channels:
        return None
    errors = image.channels["stderr.Y"].astype(np.float64)
    return float(np.sqrt(np.sum(errors**2)) / errors.size * area)


def window_area(sensor, name: str) -> float:
    """Area of the window that an orthographic sensor sees [m^2]; InputError for any other sensor."""
    if sensor.class_name() != "OrthographicCamera":
        raise InputError(f"{name}: signature needs an orthographic sensor, and this one is {sensor.class_name()}; "
                         "radiance times area is an intensity only where all rays are parallel")
    film = sensor.film()
    low = np.array(film.crop_offset()) / np.array(film.size())
    high = low + np.array(film.crop_size()) / np.array(film.size())
    corners = mi.Point2f([low[0], high[0], low[0]], [low[1], low[1], high[1]])
    ray, _ = sensor.sample_ray(0, 0, corners, mi.Point2f(0.5))
    origin = np.array(ray.o, dtype=np.float64)
    return float(np.linalg.norm(np.cross(origin[:, 1] - origin[:, 0], origin[:, 2] - origin[:, 0])))

"""Views of a scene's model: orthographic cameras that see it whole from where an observer stands, far away."""
from dataclasses import dataclass, replace

import mitsuba as mi
import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.plugins.derivatives import members
from mi_lcair.plugins.facets import is_faceted

from .scene import Scene

MARGIN = 1.01       # of the window over the model's sphere
UP, BESIDE = (0, 0, 1), (1, 0, 0)
POLE_DEG = 89.999   # of elevation, beyond which z cannot be upright in the picture


@dataclass(frozen=True)
class View:
    """Where the observer stands as seen from the model: azimuth 0 sees its nose (+x), 90 its left side (+y); elevation above
    the horizontal; degrees."""
    azimuth_deg: float
    elevation_deg: float = 0.0

    def __post_init__(self):
        if not np.isfinite(self.azimuth_deg):
            raise InputError(f"azimuth {self.azimuth_deg:g} degrees must be finite")
        if not -90 <= self.elevation_deg <= 90:
            raise InputError(f"elevation {self.elevation_deg:g} degrees must lie in -90..90")

    @property
    def direction(self) -> np.ndarray:
        """Unit vector from the model toward the observer."""
        azimuth, elevation = np.radians([self.azimuth_deg, self.elevation_deg])
        return np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])


@dataclass(frozen=True)
class Target:
    """A sphere that holds all of a scene's model, what is neither sky nor terrain: centre (3,) and radius [m]."""
    centre: np.ndarray
    radius: float

    @staticmethod
    def of(scene: Scene) -> "Target":
        points = [corners(shape) for shape in scene.mi.shapes() if getattr(shape.emitter(), "facet_type", "model") == "model"]
        if not points:
            raise InputError(f"{scene.name}: has no model to look at; all its surfaces are sky or terrain")
        points = np.concatenate(points)
        centre = (points.min(axis=0) + points.max(axis=0)) / 2
        return Target(centre, float(np.linalg.norm(points - centre, axis=1).max()))

    @property
    def window_area(self) -> float:
        """Of each view's square window [m^2]."""
        return (2 * MARGIN * self.radius) ** 2

    def camera(self, view: View, resolution: int, far: float) -> dict:
        """Mitsuba's dictionary of a camera just outside the sphere, resolution x resolution pixels; it sees up to `far` metres."""
        T = mi.ScalarTransform4f
        distance, half = MARGIN * self.radius, MARGIN * self.radius
        up = UP if abs(view.elevation_deg) < POLE_DEG else BESIDE
        place = T().look_at(origin=self.centre + distance * view.direction, target=self.centre, up=up) @ T().scale([half, half, 1])
        return {"type": "orthographic", "to_world": place, "near_clip": 1e-4 * self.radius, "far_clip": far, "film": film(resolution, resolution)}


def corners(shape) -> np.ndarray:
    """Points (n, 3) [m] that hold a shape: a mesh's vertices, or else its bounding box's corners."""
    if is_faceted(shape):
        return members(shape)["vertex_positions"].numpy().reshape(-1, 3).astype(float)
    box = shape.bbox()
    return np.array([np.array(box.corner(k), dtype=float).ravel() for k in range(8)])


def film(width: int, height: int) -> dict:
    return {"type": "hdrfilm", "width": width, "height": height, "pixel_format": "luminance", "component_format": "float32",
            "rfilter": {"type": "box"}}


def cameras(scene: Scene, views: list[View], resolution: int):
    """One sensor for all views, beside each other in its film: a kernel serves them all."""
    target, far = Target.of(scene), depth(scene)
    inner = {f"view{k}": target.camera(view, resolution, far) for k, view in enumerate(views)}
    return mi.load_dict({"type": "batch", **inner, "film": film(len(views) * resolution, resolution),
                         "sampler": {"type": "independent"}})


def seen_from(scene: Scene, view: View, resolution: int) -> Scene:
    """The same scene with a single sensor, which sees the model from there."""
    camera = Target.of(scene).camera(view, resolution, depth(scene))
    return replace(scene, sensors=[mi.load_dict(camera)])


def depth(scene: Scene) -> float:
    """A distance [m] beyond everything in the scene."""
    box = scene.mi.bbox()
    return 2 * float(np.linalg.norm(np.array(box.max) - np.array(box.min)))

"""Views of a scene's model: orthographic cameras that see it whole from where an observer stands,
far away.
"""

from dataclasses import dataclass, replace

import drjit as dr
import mitsuba as mi
import numpy as np
from scipy.spatial import ConvexHull

from mi_lcair.errors import InputError
from mi_lcair.plugins.derivatives import members
from mi_lcair.plugins.emission.triangles import is_faceted
from mi_lcair.rendering.scene import Scene

MARGIN = 1.01  # of the window over the model, and of the camera's distance over its radius
THINNEST = 1e-3  # half a window's side over the model's radius, where the model is seen edge-on
FEW_POINTS = 1000  # more of them are thinned to their convex hull
UP, BESIDE = (0, 0, 1), (1, 0, 0)
DIGITS, PROBES = 9, 64
MOST_PIXELS = 8192  # along a side
POLE_DEG = 89.999  # of elevation, beyond which z cannot be upright in the picture


@dataclass(frozen=True)
class View:
    """Where the observer stands as seen from the model, in the scene's axes: azimuth from +x (the
    nose of a model that is not turned) toward +y (its left side), elevation above the x-y plane;
    degrees, to nine digits behind the point.
    """

    azimuth_deg: float
    elevation_deg: float = 0.0

    def __post_init__(self):
        object.__setattr__(self, "azimuth_deg", round(self.azimuth_deg, DIGITS))
        object.__setattr__(self, "elevation_deg", round(self.elevation_deg, DIGITS))
        if not np.isfinite(self.azimuth_deg):
            raise InputError(f"azimuth {self.azimuth_deg:g} degrees must be finite")
        if not -90 <= self.elevation_deg <= 90:
            raise InputError(f"elevation {self.elevation_deg:g} degrees must lie in -90..90")

    @property
    def direction(self) -> np.ndarray:
        """Unit vector from the model toward the observer."""
        azimuth, elevation = np.radians([self.azimuth_deg, self.elevation_deg])
        return np.array(
            [
                np.cos(elevation) * np.cos(azimuth),
                np.cos(elevation) * np.sin(azimuth),
                np.sin(elevation),
            ]
        )


@dataclass(frozen=True)
class Target:
    """Where a scene's model is, what is neither sky nor terrain: points (n, 3) whose hull holds it,
    and a sphere around them: its centre (3,) and radius; m.
    """

    points: np.ndarray
    centre: np.ndarray
    radius: float

    @staticmethod
    def of(scene: Scene) -> "Target":
        points = [
            corners(shape)
            for shape in scene.mi.shapes()
            if getattr(shape.emitter(), "facet_type", "model") == "model"
        ]
        if not points:
            raise InputError(
                f"{scene.name}: has no model to look at; all its surfaces are sky or terrain"
            )
        points = np.concatenate(points)
        if len(points) > FEW_POINTS:
            points = points[
                ConvexHull(points, qhull_options="QJ").vertices
            ]  # QJ: a flat model has no hull without
        centre = (points.min(axis=0) + points.max(axis=0)) / 2
        return Target(points, centre, float(np.linalg.norm(points - centre, axis=1).max()))

    def window(self, view: View) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The rectangle that holds the model as seen from there: middle, and half its sides, to the
        right and upward [m], (3,) each.
        """
        up = UP if abs(view.elevation_deg) < POLE_DEG else BESIDE
        right = np.cross(up, view.direction)
        right /= np.linalg.norm(right)
        up = np.cross(view.direction, right)
        middle, sides = self.centre, []
        for axis in (right, up):
            along = (self.points - self.centre) @ axis
            middle = middle + axis * (along.min() + along.max()) / 2
            sides.append(axis * MARGIN * max(np.ptp(along) / 2, THINNEST * self.radius))
        return middle, *sides

    def window_area(self, view: View) -> float:
        """Of the window [m^2]."""
        _, right, up = self.window(view)
        return float(4 * np.linalg.norm(right) * np.linalg.norm(up))

    def camera(self, view: View, resolution: int, far: float) -> dict:
        """Mitsuba's dictionary of a camera just outside the sphere with resolution x resolution
        pixels, not square ones, over the window; it sees up to `far` metres.
        """
        middle, right, up = self.window(view)
        eye = (
            middle
            + (self.centre - middle) @ view.direction * view.direction
            + MARGIN * self.radius * view.direction
        )
        T = mi.ScalarTransform4f
        place = T().look_at(origin=eye, target=eye - view.direction, up=up) @ T().scale(
            [np.linalg.norm(right), np.linalg.norm(up), 1]
        )
        return {
            "type": "orthographic",
            "to_world": place,
            "near_clip": 1e-4 * self.radius,
            "far_clip": far,
            "film": film(resolution, resolution),
        }


def check_resolution(resolution: int) -> None:
    if not 1 <= resolution <= MOST_PIXELS:
        raise InputError(f"resolution = {resolution} must lie in 1..{MOST_PIXELS}")


def corners(shape) -> np.ndarray:
    """Points (n, 3) [m] that hold a shape: a mesh's vertices, or else its bounding box's corners."""
    if is_faceted(shape):
        return members(shape)["vertex_positions"].numpy().reshape(-1, 3).astype(float)
    box = shape.bbox()
    return np.array([np.array(box.corner(k), dtype=float).ravel() for k in range(8)])


def film(width: int, height: int) -> dict:
    return {
        "type": "hdrfilm",
        "width": width,
        "height": height,
        "pixel_format": "luminance",
        "component_format": "float32",
        "rfilter": {"type": "box"},
    }


def cameras(scene: Scene, target: Target, views: list[View], resolution: int):
    """One sensor for all views, beside each other in its film: a kernel serves them all."""
    far = depth(scene)
    inner = {f"view{k}": target.camera(view, resolution, far) for k, view in enumerate(views)}
    return mi.load_dict(
        {
            "type": "batch",
            **inner,
            "film": film(len(views) * resolution, resolution),
            "sampler": {"type": "independent"},
        }
    )


def seen_from(scene: Scene, view: View, resolution: int) -> Scene:
    """The same scene with a single sensor, which sees the model from there."""
    check_resolution(resolution)
    camera = Target.of(scene).camera(view, resolution, depth(scene))
    return replace(scene, sensors=[mi.load_dict(camera)])


def hidden_share(scene: Scene, range_m: float) -> float:
    """Share of the model of a scene from `seen_from` before which something stands between its
    sphere and an observer at range_m; the camera, which stands just outside the sphere, does not
    see it.
    """
    camera = scene.sensor(0)
    index = dr.arange(mi.UInt32, PROBES**2)
    position = (mi.Point2f(index % PROBES, index // PROBES) + 0.5) / PROBES
    ray, _ = camera.sample_ray(0, 0, position, mi.Point2f(0.5))
    first = scene.mi.ray_intersect(ray)
    with scene.prepared() as tracer:
        on_model = first.is_valid() & tracer.emitters.is_model(first.emitter(scene.mi))
    outward = mi.Ray3f(ray.o, -ray.d, maxt=range_m, time=0, wavelengths=[])
    return int(dr.count(on_model & scene.mi.ray_test(outward))[0]) / max(
        1, int(dr.count(on_model)[0])
    )


def depth(scene: Scene) -> float:
    """A distance [m] beyond everything in the scene."""
    box = scene.mi.bbox()
    return 2 * float(np.linalg.norm(np.array(box.max) - np.array(box.min)))

"""Views of a scene's model by distant observers: orthographic cameras that see all of it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import drjit as dr
import mitsuba as mi
import numpy as np
import scipy

from mi_lcair.declared import Bounds, Described, entry, percent
from mi_lcair.errors import InputError
from mi_lcair.plugins.derivatives import own_memory
from mi_lcair.plugins.emission.triangles import is_faceted, vertex_positions
from mi_lcair.plugins.emitters.thermal_emitter import facet_type_of
from mi_lcair.rendering.loading.parsing import extent
from mi_lcair.rendering.scene import Scene
from mi_lcair.tasks import exclusively

# Ratio of the window to the model's size, and of the camera's distance to the model's radius.
MARGIN = 1.01
# Smallest ratio of half a window's side to the model's radius, for a model seen edge-on.
THINNEST = 1e-3
FEW_POINTS = 1000  # largest number of points that are used without reducing them to their hull
UP, BESIDE = (0, 0, 1), (1, 0, 0)  # upward directions of images, below and above POLE_DEG
DIGITS = 9  # decimals to which angles are rounded
CELLS = 16  # rays along each side of the window of each view in `terrain_before`
RESOLUTION = Bounds(lower=1, upper=8192)  # pixels along each side of a view
POLE_DEG = 89.999  # elevation beyond which z cannot be the upward direction of an image


@dataclass(frozen=True)
class View(Described):
    """Direction from the model to the observer, in the scene's axes [degrees].

    The azimuth is measured from +x (the nose of a model that is not turned) toward +y (its left
    side), the elevation from the x-y plane. Both are rounded to nine decimals.
    """

    azimuth_deg: float = entry()
    elevation_deg: float = entry(0.0, lower=-90, upper=90)

    def complete(self) -> None:
        # Numbers of Python, since the text of NumPy's, from which seeds are made, may be set
        azimuth, elevation = float(self.azimuth_deg), float(self.elevation_deg)
        self.derive(azimuth_deg=round(azimuth, DIGITS), elevation_deg=round(elevation, DIGITS))

    @property
    def direction(self) -> np.ndarray:
        """Unit vector from the model toward the observer."""
        azimuth, elevation = np.radians([self.azimuth_deg, self.elevation_deg])
        x, y = np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth)
        return np.array([x, y, np.sin(elevation)])


@dataclass(frozen=True)
class Target:
    """Extent of a scene's model, which is everything except sky and terrain.

    points: points whose convex hull contains the model, (n, 3) [m]. centre, radius: a sphere around
    the points, (3,) and scalar [m].
    """

    points: np.ndarray
    centre: np.ndarray
    radius: float

    @staticmethod
    def of(scene: Scene) -> "Target":
        """The extent of a scene's model; raises InputError if the scene has no model."""
        points = [corners(shape) for shape in model_shapes(scene)]
        if not points:
            raise InputError(
                f"{scene.name}: has no model to look at; all its surfaces are sky or terrain"
            )
        return Target.around(np.concatenate(points))

    @staticmethod
    def around(points: np.ndarray) -> "Target":
        """The extent of some points, (n, 3) [m]."""
        if len(points) > FEW_POINTS:
            # Without the option QJ, Qhull fails for a flat model
            points = points[scipy.spatial.ConvexHull(points, qhull_options="QJ").vertices]
        centre = (points.min(axis=0) + points.max(axis=0)) / 2
        return Target(points, centre, float(np.linalg.norm(points - centre, axis=1).max()))

    def check_outside(self, range_m: float) -> None:
        """Raise InputError if an observer at a range [m] from the middle is inside the target."""
        if range_m <= self.radius:
            raise InputError(
                f"the observer is inside the target: range {range_m:g} m, but the target reaches "
                f"{self.radius:.4g} m from its middle"
            )

    def window(self, view: View) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The rectangle around the model as seen in a view.

        Its centre, and half of its sides to the right and upward, (3,) each [m].
        """
        toward = x, y, z = view.direction
        # The vector product of UP or BESIDE with the direction
        right = np.array([-y, x, 0.0] if abs(view.elevation_deg) < POLE_DEG else [0.0, -z, y])
        right /= np.linalg.norm(right)
        up = np.cross(toward, right)
        middle, sides = self.centre, []
        for axis in (right, up):
            along = (self.points - self.centre) @ axis
            middle = middle + axis * (along.min() + along.max()) / 2
            sides.append(axis * MARGIN * max(np.ptp(along) / 2, THINNEST * self.radius))
        return middle, *sides

    def window_area(self, view: View) -> float:
        """Area of the window of a view [m^2]."""
        _, right, up = self.window(view)
        return float(4 * np.linalg.norm(right) * np.linalg.norm(up))

    def eye(self, view: View, middle: np.ndarray) -> np.ndarray:
        """The place of a view's camera over the middle of its window, (3,) [m]."""
        out = (self.centre - middle) @ view.direction + MARGIN * self.radius
        return middle + out * view.direction

    def camera(self, view: View, resolution: int, far: float) -> dict:
        """Mitsuba's dictionary of a camera for a view.

        The camera is just outside the sphere. Its resolution x resolution pixels fill the window,
        so they are not square. far: distance up to which the camera sees [m].
        """
        middle, right, up = self.window(view)
        eye = self.eye(view, middle)
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


def model_shapes(scene: Scene) -> list[mi.Shape]:
    """The shapes of a scene's model, without sky and terrain."""
    return [shape for shape in scene.mi.shapes() if facet_type_of(shape.emitter()) == "model"]


def corners(shape) -> np.ndarray:
    """Points (n, 3) [m] whose hull contains a shape: vertices, or corners of the bounding box."""
    if is_faceted(shape):
        return vertex_positions(shape).astype(float)
    box = shape.bbox()
    return np.array([np.array(box.corner(k), dtype=float).ravel() for k in range(8)])


def film(width: int, height: int) -> dict:
    """Mitsuba's dictionary of a film with one Float32 channel."""
    return {
        "type": "hdrfilm",
        "width": width,
        "height": height,
        "pixel_format": "luminance",
        "component_format": "float32",
        "rfilter": {"type": "box"},
    }


def cameras(scene: Scene, target: Target, views: Sequence[View]):
    """One sensor for all views, so that one kernel renders them all.

    The views are next to each other in its film, with one pixel each.

    Parameters
    ----------
    scene : Scene
    target : Target
        The extent of the scene's model.
    views : sequence of View
    """
    far = depth(scene)
    inner = {f"view{k}": target.camera(view, 1, far) for k, view in enumerate(views)}
    # `optimize` would make one sensor of equal views, such as those of azimuths 0 and 360
    return mi.load_dict(
        {"type": "batch", **inner, "film": film(len(views), 1), "sampler": {"type": scene.sampler}},
        parallel=False,
        optimize=False,
    )


def seen_from(scene: Scene, view: View, resolution: int, target: Target | None = None) -> Scene:
    """The same scene with a single sensor, for this view, of resolution x resolution pixels.

    target: what the sensor's window holds; by default the scene's model.
    """
    RESOLUTION.check(resolution, "resolution")
    camera = (target or Target.of(scene)).camera(view, resolution, depth(scene))
    camera["sampler"] = {"type": scene.sampler}
    return replace(scene, sensors=[mi.load_dict(camera, parallel=False)])


def terrain_before(
    scene: Scene, views: Sequence[View], range_m: float = float("inf")
) -> np.ndarray:
    """Share of each view's window before which terrain lies, farther out than the camera, (V,).

    Terrain on both sides of the model, such as the walls of a room, does not count. range_m: of the
    observers [m], beyond whom nothing counts.
    """
    target, starts = Target.of(scene), []
    across = (np.arange(CELLS) + 0.5) * 2 / CELLS - 1
    places = np.stack(np.meshgrid(across, across), axis=-1).reshape(-1, 2)
    for view in views:
        middle, *sides = target.window(view)
        starts.append(target.eye(view, middle) + places @ sides)
    outward = np.repeat([view.direction for view in views], len(places), axis=0)
    start, outward = own_memory([mi.Point3f(np.concatenate(starts).T), mi.Vector3f(outward.T)])
    with scene.prepared() as tracer:

        def is_terrain(origin, direction):
            ray = mi.Ray3f(origin, direction, maxt=range_m, time=0, wavelengths=[])
            hit = scene.mi.ray_intersect(ray)
            emitter = hit.emitter(scene.mi)
            background = ~tracer.emitters.is_model(emitter)
            return background & ~tracer.emitters.shows_sun(hit, emitter)

        behind = is_terrain(start - 2 * MARGIN * target.radius * outward, -outward)
        before = is_terrain(start, outward) & ~behind
    return before.numpy().reshape(len(views), len(places)).mean(axis=1)


@exclusively
def terrain_remark(scene: Scene, views: Sequence[View], range_m: float = float("inf")) -> list[str]:
    """Remark on terrain before the model that views leave out, in a list; see `terrain_before`."""
    share = terrain_before(scene, views, range_m)
    if not share.any():
        return []
    of_views = f"in {np.count_nonzero(share)} of {len(views)} views " if len(views) > 1 else ""
    return [
        f"{of_views}terrain is in front of up to {percent(share.max())} of the view, but is "
        "nearer to the observer than the window around the model; it is ignored and does not "
        "hide the model"
    ]


def meets_model(scene: Scene, cells: int) -> tuple[mi.Ray3f, mi.Bool]:
    """Rays through the middles of cells x cells parts of the first sensor's film, row by row.

    Also, whether each meets the model before anything else.
    """
    index = dr.arange(mi.UInt32, cells**2)
    position = (mi.Point2f(index % cells, index // cells) + 0.5) / cells
    ray, _ = scene.sensor(0).sample_ray(0, 0, position, mi.Point2f(0.5))
    first = scene.mi.ray_intersect(ray)
    with scene.prepared() as tracer:
        return ray, first.is_valid() & tracer.emitters.is_model(first.emitter(scene.mi))


def depth(scene: Scene) -> float:
    """A distance [m] beyond everything in the scene."""
    low, high = extent(scene.mi)
    return 2 * float(np.linalg.norm(high - low))

"""Upper bounds of the radiance of emitters and of textures, and the view in which they count."""

import re
from functools import reduce

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.plugins.derivatives import members
from mi_lcair.plugins.emitters.thermal_emitter import is_thermal

# Textures whose values never exceed the largest number that they or their nested textures contain.
# They interpolate or select numbers, but do not add or multiply them.
BETWEEN_ITS_VALUES = ("UniformSpectrum", "BitmapTextureImpl", "Checkerboard")
PLANE_SIDED = ("OrthographicCamera", "PerspectiveCamera")  # sensors with a box or a frustum
FILM_CORNERS = (0, 1, 1, 0), (0, 0, 1, 1)  # x and y of the film's corners, in film widths


def can_be_hit(emitter) -> bool:
    """Whether a reflected ray can hit the emitter; False for a point light or a parallel beam."""
    return not emitter.flags() & int(mi.EmitterFlags.Delta)


def radiance_bound(emitter) -> np.ndarray | None:
    """Upper bound of the radiance of an emitter that a ray can hit [W m^-2 sr^-1].

    An array of width 1, or with one value per triangle of the emitter's mesh. None if the emitter
    is of a kind whose radiance cannot be bounded from its parameters.
    """
    if is_thermal(emitter):
        return emitter.radiance_bound()
    held = members(emitter)
    if "data" in held and "scale" in held:  # envmap
        return largest(held["data"]) * largest(held["scale"])
    if isinstance(held.get("radiance"), mi.Texture):  # area, constant
        return texture_bound(held["radiance"], emitter.get_shape())
    return None


def texture_bound(texture, shape) -> np.ndarray | None:
    """Upper bound of a texture on a shape, of width 1 or per triangle; None if it is not known."""
    kind, held = texture.class_name().partition("[")[0], members(texture)
    if kind == "MeshAttribute":
        name = re.search(r'name = "(\w+)"', str(texture))
        buffer = members(shape).get(name[1]) if name else None
        if buffer is None:
            return None
        values = dr.detach(buffer).numpy().astype(np.float64) * held.get("scale", 1.0)
        return values if name[1].startswith("face_") else values.max(keepdims=True)
    if kind not in BETWEEN_ITS_VALUES:
        return None
    bounds = [
        texture_bound(value, shape) if isinstance(value, mi.Texture) else largest(value)
        for name, value in held.items()
        if isinstance(value, mi.Texture) or name in ("value", "data")
    ]
    if not bounds or any(bound is None for bound in bounds):
        return None
    return reduce(np.maximum, bounds)  # some of width 1, some per triangle


def largest(values) -> np.ndarray:
    """The largest value, as an array of width 1."""
    return np.atleast_1d(np.max(np.asarray(dr.detach(values), dtype=np.float64)))


class FieldOfView:
    """The space that the rays of a sensor fill, as an intersection of half-spaces.

    It is a box for an orthographic sensor, a frustum for a perspective sensor, and all of space for
    any other sensor.
    """

    def __init__(self, sensor):
        self.normals, self.offsets = np.zeros((0, 3)), np.zeros(0)
        if sensor.class_name() not in PLANE_SIDED:
            return
        corners = mi.Point2f(FILM_CORNERS)
        rays, _ = sensor.sample_ray(sensor.shutter_open(), 0, corners, mi.Point2f(0.5))
        o, d = (np.broadcast_to(np.array(v, dtype=np.float64), (3, 4)).T for v in (rays.o, rays.d))
        sides = np.cross(d, np.roll(o + d, -1, axis=0) - o)
        front = np.cross(o[1] - o[0], o[3] - o[0])  # rays start at the near clip
        normals = np.vstack([sides, front])
        points = np.vstack([o, o[:1]])
        middle = (o + d).mean(axis=0)
        inward = np.sign(np.sum(normals * (middle - points), axis=1))
        self.normals = normals * inward[:, None]
        self.offsets = np.sum(self.normals * points, axis=1)

    def excludes(self, points) -> np.ndarray:
        """Whether each set of points lies completely beyond one of the limiting planes, (sets,).

        The sensor cannot see the convex hull of such a set. points: (sets, points of a set, 3) [m].
        """
        beyond = np.einsum("spx,kx->spk", points, self.normals) < self.offsets
        return beyond.all(axis=1).any(axis=1)

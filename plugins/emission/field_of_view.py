"""The field of view of a sensor, and a test for parts of a scene that lie outside it."""

import mitsuba as mi
import numpy as np

PLANE_SIDED = ("OrthographicCamera", "PerspectiveCamera")  # sensors with a box or a frustum
FILM_CORNERS = (0, 1, 1, 0), (0, 0, 1, 1)  # x and y of the film's corners, in film widths


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

"""Which parts of a scene a sensor cannot see directly, because they lie outside its field of view."""

import mitsuba as mi
import numpy as np

PLANE_SIDED = ("OrthographicCamera", "PerspectiveCamera")  # their rays fill a frustum or a box
FILM_CORNERS = (0, 1, 1, 0), (0, 0, 1, 1)  # x and y


class FieldOfView:
    """The space that the rays of an orthographic or perspective sensor fill, as half-spaces; of any
    other sensor all of space.
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
        """Whether all points of each set lie beyond one of the limiting planes, so that their hull
        is invisible. points: (sets, points of a set, 3) [m]; returns (sets,).
        """
        beyond = np.einsum("spx,kx->spk", points, self.normals) < self.offsets
        return beyond.all(axis=1).any(axis=1)

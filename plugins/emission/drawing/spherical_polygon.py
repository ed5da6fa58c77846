"""A triangle or rectangle as a point of a surface sees it: what both have in common."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import reduce

import drjit as dr
import mitsuba as mi

# Smallest density of a direction, divided by that of the best corner. Corners below the horizon
# have a cosine of 0, but directions next to them may be above it.
LEAST_COSINE = 0.02
LARGE = 0.01  # solid angle from which on Lambert's formula keeps enough digits [sr]


@dataclass
class Receiver:
    """Point of a surface toward which emitters are drawn.

    p: start of its rays [m]. n: unit normal on the side of the observer.
    """

    p: mi.Point3f
    n: mi.Normal3f


@dataclass
class SphericalPolygon(ABC):
    """A triangle or rectangle as seen from a point of a surface.

    n: its normal. distance: that of its plane [m], negative in front of it. area: [m^2].
    normal: that of the surface. directions: those of the corners. cosines: their cosines at the
    surface, but at least LEAST_COSINE of the largest one. projected: estimate of the projected
    solid angle above the horizon [sr]. solid_angle: [sr]. by_area: whether it is so small that
    points are drawn uniformly over the area.
    """

    n: mi.Vector3f
    distance: mi.Float
    area: mi.Float
    normal: mi.Normal3f
    directions: list[mi.Vector3f]
    cosines: list[mi.Float]
    projected: mi.Float
    solid_angle: mi.Float
    by_area: mi.Bool

    @staticmethod
    def common(corners: list, n, area, smallest: float, receiver: Receiver) -> dict:
        """The fields by name, from the corners [m] and the normal.

        smallest: solid angle from which on directions are drawn by solid angle [sr].
        """
        lengths = [dr.maximum(dr.norm(corner), 1e-30) for corner in corners]
        directions = [corner / length for corner, length in zip(corners, lengths)]
        distance = dr.dot(n, corners[0])
        # All triangles of a fan have the same area. Their triple products follow from the distance
        # of the plane: of a small one, that of three nearly parallel directions would lose its
        # digits.
        volume = 2 * area / (len(corners) - 2) * dr.abs(distance)
        solid_angle = mi.Float(0)
        for k in range(1, len(corners) - 1):
            of_fan = [0, k, k + 1]
            a, b, c = (directions[m] for m in of_fan)
            product = lengths[0] * lengths[k] * lengths[k + 1]
            # A. Van Oosterom, J. Strackee, IEEE Trans. Biomed. Eng. 30 (1983) 125
            cos = 1 + dr.dot(a, b) + dr.dot(b, c) + dr.dot(c, a)
            solid_angle += 2 * dr.atan2(volume / product, cos)
        cosines = [dr.dot(receiver.n, d) for d in directions]
        upward = [dr.maximum(cosine, 0) for cosine in cosines]
        largest = dr.maximum(reduce(dr.maximum, upward), 1e-3)
        return {
            "n": n,
            "distance": distance,
            "area": area,
            "normal": receiver.n,
            "directions": directions,
            "cosines": [dr.maximum(cosine, LEAST_COSINE * largest) for cosine in upward],
            "projected": projected(directions, solid_angle, sum(upward) / len(corners), receiver.n),
            "solid_angle": solid_angle,
            "by_area": solid_angle < smallest,
        }

    @abstractmethod
    def uniform_point(self, sample) -> mi.Vector3f:
        """A point uniform over the area, from the receiver [m]."""

    @abstractmethod
    def draw_direction(self, sample) -> tuple[mi.Vector3f, mi.Float]:
        """A direction by solid angle, and its density [1/sr]."""

    def draw(self, sample) -> tuple[mi.Vector3f, mi.Float, mi.Float]:
        """A direction to the polygon, the distance of its point [m], and its density [1/sr]."""
        to = mi.Vector3f(self.uniform_point(sample))
        length = dr.norm(to)
        d, density = self.draw_direction(sample)
        d = mi.Vector3f(d)
        along = dr.abs(self.distance) / dr.maximum(dr.abs_dot(self.n, d), 1e-20)
        return (
            dr.select(self.by_area, to / dr.maximum(length, 1e-30), d),
            dr.select(self.by_area, length, along),
            dr.select(self.by_area, self.uniform(length), density),
        )

    def along(self, d, length) -> mi.Float:
        """Density with which `draw` draws a direction, but for the interpolated cosine [1/sr].

        It depends on the direction alone, as the weights of multiple importance sampling must.
        length: distance of the point along `d` [m].
        """
        cosine = dr.maximum(dr.dot(self.normal, d), reduce(dr.minimum, self.cosines))
        return dr.select(self.by_area, self.uniform(length), self.proportional(cosine))

    def uniform(self, length) -> mi.Float:
        """Density of points that are uniform over the area [1/sr]."""
        height = dr.abs(self.distance)
        return dr.select(height > 0, length * dr.square(length) / (self.area * height), 0)

    def proportional(self, cosine) -> mi.Float:
        """Density that is proportional to an interpolated cosine [1/sr]."""
        mean = sum(self.cosines) / len(self.cosines)
        return cosine / (mean * self.solid_angle)


def projected(directions: list, solid_angle, upward, n) -> mi.Float:
    """Estimate of the projected solid angle above the horizon [sr].

    upward: mean cosine of the corners, with 0 below the horizon. Lambert's formula is exact for a
    polygon above the horizon, and too small for one that crosses it. It loses its digits for a
    small polygon.
    """
    exact = mi.Float(0)
    for a, b in zip(directions, directions[1:] + directions[:1]):
        normal = dr.cross(a, b)
        sin = dr.norm(normal)
        exact += dr.dot(n, normal) * dr.atan2(sin, dr.dot(a, b)) / dr.maximum(sin, 1e-12)
    # The sign tells whether the corners follow each other clockwise
    exact = 0.5 * dr.mulsign(exact, dr.dot(dr.cross(*directions[:2]), directions[2]))
    by_corners = solid_angle * upward
    return dr.select(
        (upward > 0) & (solid_angle > LARGE), dr.maximum(exact, by_corners), by_corners
    )

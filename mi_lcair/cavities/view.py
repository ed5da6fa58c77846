"""How a cavity is viewed: which rays through the aperture count, and how much each.

All rays pass a spot in the aperture, a circle about the axis. Depths and radii are in m.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from math import cos, pi, sin

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.cavities.exchange import disc_exchange


@dataclass(frozen=True)
class View(ABC):
    """Rays through a spot of a radius [m]."""

    spot: float

    @abstractmethod
    def passed(self, r: np.ndarray, z: np.ndarray) -> np.ndarray:
        """Share of the rays that pass discs of radius r about the axis, at depths z [m]."""

    @abstractmethod
    def ray(self, place: mi.Point2f, sample: mi.Point2f) -> tuple[mi.Point3f, mi.Vector3f]:
        """Place in the aperture's plane and direction of rays, from two points in 0..1."""

    def on_spot(self, place: mi.Point2f) -> mi.Point3f:
        """An evenly distributed place in the spot."""
        p = mi.warp.square_to_uniform_disk_concentric(place) * self.spot
        return mi.Point3f(p.x, p.y, 0)


class Hemisphere(View):
    """Rays of all directions: the radiant exitance of the spot."""

    def passed(self, r, z):
        return disc_exchange(self.spot, r, z) / (pi * self.spot**2)

    def ray(self, place, sample):
        return self.on_spot(place), mi.warp.square_to_cosine_hemisphere(sample)


@dataclass(frozen=True)
class Beam(View):
    """Parallel rays at an angle to the axis [rad]."""

    angle: float = 0.0

    def passed(self, r, z):
        return common_area(self.spot, r, z * np.tan(self.angle)) / (pi * self.spot**2)

    def ray(self, place, sample):
        return self.on_spot(place), mi.Vector3f(sin(self.angle), 0, cos(self.angle))


@dataclass(frozen=True)
class Cone(View):
    """Rays to a point on the axis, at a distance [m] in front of the aperture.

    They count as in an irradiance on a small detector that faces the aperture.
    """

    distance: float = 0.0

    def passed(self, r, z):
        return np.minimum(sin_squared(r, self.distance + z) / self.most, 1)

    @property
    def most(self) -> float:
        """Squared sine of the angle of the outermost rays."""
        return sin_squared(self.spot, self.distance)

    def ray(self, place, sample):
        disc = mi.warp.square_to_uniform_disk_concentric(place) * float(np.sqrt(self.most))
        direction = mi.Vector3f(disc.x, disc.y, dr.sqrt(1 - dr.squared_norm(disc)))
        start = direction * (self.distance / direction.z)
        return mi.Point3f(start.x, start.y, 0), direction


def sin_squared(r, distance):
    """Squared sine of the angle under which a radius appears from a point on the axis."""
    return r**2 / (r**2 + distance**2)


def common_area(a: float, b: np.ndarray, distance: np.ndarray) -> np.ndarray:
    """Area that two circles of radii a and b share, their centres a distance apart."""
    b, d = np.broadcast_arrays(np.asarray(b, float), distance)
    crosses = (d < a + b) & (d > abs(a - b)) & (b > 0)
    d_, b_ = np.where(crosses, d, a), np.where(crosses, b, a)

    def segment(radius, other):
        cosine = np.clip((d_**2 + radius**2 - other**2) / (2 * d_ * radius), -1, 1)
        return radius**2 * (np.arccos(cosine) - cosine * np.sqrt(1 - cosine**2))

    within = pi * np.where(d >= a + b, 0, np.minimum(a, b)) ** 2
    return np.where(crosses, segment(a, b_) + segment(b_, a), within)

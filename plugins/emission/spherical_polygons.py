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


# Rectangles as a point sees them: their solid angle, and directions drawn toward them
# ------------------------------------------------------------------------------------

# As SMALLEST of triangles: angles of almost pi lose more digits
SMALLEST_RECTANGLE = 1e-3


@dataclass
class SphericalRectangle(SphericalPolygon):
    """A rectangle as seen from a point of a surface, see `SphericalPolygon`.

    low, high: places of the sides in the directions of the edges, from the foot of the
    perpendicular to its plane [m]. along_1, along_2: unit vectors along the edges.
    """

    low: mi.Point2f
    high: mi.Point2f
    along_1: mi.Vector3f
    along_2: mi.Vector3f

    @staticmethod
    def of(corner, edge_1, edge_2, n, receiver: Receiver) -> "SphericalRectangle":
        """The rectangle with a corner, two edges [m] and a normal."""
        first = mi.Vector3f(corner - receiver.p)
        corners = [first, first + edge_1, first + edge_1 + edge_2, first + edge_2]
        lengths = dr.norm(edge_1), dr.norm(edge_2)
        along_1, along_2 = (
            edge / dr.maximum(length, 1e-30) for edge, length in zip((edge_1, edge_2), lengths)
        )
        low = mi.Point2f(dr.dot(along_1, first), dr.dot(along_2, first))
        return SphericalRectangle(
            **SphericalPolygon.common(
                corners, n, lengths[0] * lengths[1], SMALLEST_RECTANGLE, receiver
            ),
            low=low,
            high=low + mi.Point2f(*lengths),
            along_1=along_1,
            along_2=along_2,
        )

    def uniform_point(self, sample) -> mi.Vector3f:
        place = dr.lerp(self.low, self.high, sample)
        return place.x * self.along_1 + place.y * self.along_2 + self.distance * self.n

    def draw_direction(self, sample) -> tuple[mi.Vector3f, mi.Float]:
        """A direction, and its density [1/sr].

        The density is proportional to the cosine at the surface, interpolated between the corners.
        C. Urena, M. Fajardo, A. King, Comput. Graph. Forum 32 (2013) 59, map a square to directions
        of equal density.
        """
        a, b, c, d = self.cosines
        uv, cosine = mi.warp.square_to_bilinear(a, b, d, c, sample)
        z = dr.maximum(dr.abs(self.distance), 1e-30)
        # Angles of the spherical rectangle at two of its corners
        (x, y), (_, top) = self.low, self.high
        behind = dr.atan2(z * dr.hypot(dr.hypot(x, top), z), x * top) + dr.atan2(
            z * dr.hypot(dr.hypot(x, y), z), -x * y
        )
        sin, cos = dr.sincos(uv.x * self.solid_angle - behind)
        sin_low, sin_high = -y * dr.rcp(dr.hypot(y, z)), top * dr.rcp(dr.hypot(top, z))
        f = (cos * sin_low - sin_high) / dr.select(sin == 0, 1e-30, sin)
        cos_x = dr.mulsign(dr.rsqrt(dr.square(f) + dr.square(sin_low)), f)
        cos_x = dr.clip(cos_x, -1 + 1e-7, 1 - 1e-7)
        x = dr.clip(z * cos_x * dr.rsqrt(1 - dr.square(cos_x)), self.low.x, self.high.x)
        away = dr.hypot(x, z)
        height = dr.lerp(y * dr.rcp(dr.hypot(y, away)), top * dr.rcp(dr.hypot(top, away)), uv.y)
        height2 = dr.minimum(dr.square(height), 1 - 1e-7)
        y = dr.clip(away * height * dr.rsqrt(1 - height2), y, top)
        to = x * self.along_1 + y * self.along_2 + self.distance * self.n
        return dr.normalize(to), self.proportional(cosine)


# Triangles as a point sees them: directions drawn toward them
# ------------------------------------------------------------

# Solid angle below which points are drawn uniformly over the area [sr]. The directions of smaller
# triangles would lose digits in Float32, and the two densities hardly differ.
SMALLEST_TRIANGLE = 1e-5


@dataclass
class SphericalTriangle(SphericalPolygon):
    """A triangle as seen from a point of a surface, see `SphericalPolygon`.

    corner: its first corner from there [m]. edge_1, edge_2: edges that begin in it [m]. volume:
    triple product of the directions.
    """

    corner: mi.Vector3f
    edge_1: mi.Vector3f
    edge_2: mi.Vector3f
    volume: mi.Float

    @staticmethod
    def of(corner, edge_1, edge_2, n, receiver: Receiver) -> "SphericalTriangle":
        """The triangle with a corner, two edges [m] and a normal."""
        first = mi.Vector3f(corner - receiver.p)
        corners = [first, first + edge_1, first + edge_2]
        area = 0.5 * dr.norm(dr.cross(edge_1, edge_2))
        fields = SphericalPolygon.common(corners, n, area, SMALLEST_TRIANGLE, receiver)
        lengths = [dr.maximum(dr.norm(corner), 1e-30) for corner in corners]
        volume = 2 * area * dr.abs(fields["distance"]) / (lengths[0] * lengths[1] * lengths[2])
        return SphericalTriangle(
            **fields, corner=first, edge_1=edge_1, edge_2=edge_2, volume=volume
        )

    def uniform_point(self, sample) -> mi.Vector3f:
        uv = mi.warp.square_to_uniform_triangle(sample)
        return self.corner + uv.x * self.edge_1 + uv.y * self.edge_2

    def draw_direction(self, sample) -> tuple[mi.Vector3f, mi.Float]:
        """A direction into the triangle, and its density [1/sr].

        The density is proportional to the cosine at the surface, interpolated between the corners.
        C. Peters, ACM Trans. Graph. 40 (2021) 140, maps a square to directions of equal density
        (J. Arvo, SIGGRAPH 1995, in a form that keeps its digits).
        """
        at_a, at_b, at_c = self.cosines
        a, b, c = self.directions
        w = linear_from_apex(sample.y, at_a, 0.5 * (at_b + at_c))
        start, end = dr.lerp(at_a, at_b, w), dr.lerp(at_a, at_c, w)
        root = dr.sqrt(dr.lerp(dr.square(start), dr.square(end), sample.x))
        along = dr.minimum(sample.x * (start + end) / (start + root), 1)
        density = self.proportional(dr.lerp(start, end, along))
        # The point on the side from b to c behind which lies the part `along` of the solid angle
        sin, cos = dr.sincos(0.5 * along * self.solid_angle)
        offset = b * (self.volume * cos - (dr.dot(b, c) + dr.dot(a, c)) * sin) + c * (
            (1 + dr.dot(a, b)) * sin
        )
        length2 = dr.maximum(dr.squared_norm(offset), 1e-30)
        side = 2 * dr.dot(b, offset) / length2 * offset - b
        # Between a and that point, 1 - cos of the angle from a is proportional to w^2
        half2 = 0.25 * dr.squared_norm(a - side)
        share = dr.square(w) * half2
        t = w * dr.sqrt((1 - share) / dr.maximum(1 - half2, 1e-7))
        d = dr.normalize((1 - 2 * share - t * (1 - 2 * half2)) * a + t * side)
        return d, density


def linear_from_apex(sample, at_apex, opposite):
    """Distance w from a triangle's apex, in 0..1, for a density that is linear in w.

    w has the density proportional to w ((1 - w) at_apex + w opposite), the first factor for the
    triangle's width. Its inverse v = 1/w is the largest root of v^3 - 3 p v - 2 q = 0.
    """
    total = (at_apex + 2 * opposite) * dr.maximum(sample, 1e-8)
    p, q = at_apex / total, (opposite - at_apex) / total
    p3, q2 = p * p * p, dr.square(q)
    root = dr.sqrt(p3)
    by_angle = 2 * dr.sqrt(p) * dr.cos(dr.acos(dr.clip(q / root, -1, 1)) / 3)
    t = dr.cbrt(q + dr.sqrt(dr.maximum(q2 - p3, 0)))
    v = dr.select(q2 <= p3, by_angle, t + p / dr.maximum(t, 1e-12))
    return dr.minimum(1 / dr.maximum(v, 1), 1)

"""Rectangles as a point sees them: their solid angle, and directions drawn toward them."""

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from mi_lcair.plugins.emission.drawing.spherical_polygon import Receiver, SphericalPolygon

# As SMALLEST of triangles: angles of almost pi lose more digits
SMALLEST = 1e-3


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
            **SphericalPolygon.common(corners, n, lengths[0] * lengths[1], SMALLEST, receiver),
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

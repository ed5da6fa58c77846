"""Triangles as a point sees them: directions drawn toward them."""

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from mi_lcair.plugins.emission.drawing.spherical_polygon import Receiver, SphericalPolygon

# Solid angle below which points are drawn uniformly over the area [sr]. The directions of smaller
# triangles would lose digits in Float32, and the two densities hardly differ.
SMALLEST = 1e-5


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
        fields = SphericalPolygon.common(corners, n, area, SMALLEST, receiver)
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

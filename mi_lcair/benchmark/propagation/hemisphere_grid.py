"""Grids of theta and phi over the hemisphere of a point, for quadrature by the middles of their
cells (thesis 3.3, 3.5).

All functions: k, number of the cell (array); wi, direction of the observer in the local frame. They
return the direction of the cell's middle in that frame and its weight, sin(theta) dtheta dphi [sr].
"""

from dataclasses import dataclass
from math import pi, radians

import drjit as dr
import mitsuba as mi

PEAK_THETA, PEAK_PHI = radians(10), radians(20)  # half widths of the peak region, thesis 3.3.2.2
HALF_PI = pi / 2


@dataclass(frozen=True)
class Hemisphere:
    """n x 2n cells of equal angles, laid without knowing where the observer is (3.5.3)."""

    n: int

    @property
    def cells(self) -> int:
        return 2 * self.n**2

    def direction(self, k, wi):
        return cell(k // (2 * self.n), self.n, 0, HALF_PI, k % (2 * self.n), 2 * self.n, 0, 2 * pi)


@dataclass(frozen=True)
class Peak:
    """n x n cells over 20 degrees in elevation by 40 in azimuth about the mirror direction, the
    rest of the hemisphere left out (3.5.5).

    At 30 degrees of elevation, where the thesis draws it, the region spans 20 degrees of arc both
    ways. Nearer to the normal the same azimuth would be a sliver that misses most of the lobe:
    there it is widened to keep that arc.
    """

    n: int

    @property
    def cells(self) -> int:
        return self.n**2

    def direction(self, k, wi):
        low, high, middle, half = peak_region(wi)
        return cell(
            k // self.n, self.n, low, high, k % self.n, self.n, middle - half, middle + half
        )


@dataclass(frozen=True)
class Stratified:
    """The peak region by n x n cells, and the rest by m x 2m: above it, beside it, below it
    (3.5.5).
    """

    n: int
    m: int

    @property
    def cells(self) -> int:
        return self.n**2 + 2 * self.m**2

    def direction(self, k, wi):
        low, high, middle, half = peak_region(wi)
        inner, solid_angle = Peak(self.n).direction(k, wi)
        row, column = (k - self.n**2) // (2 * self.m), (k - self.n**2) % (2 * self.m)
        # rows above the region, then below it, then beside it, in proportion to their elevations
        above = dr.select(low > 0, dr.clip(dr.round(self.m * low / HALF_PI), 1, self.m - 2), 0)
        below = dr.select(
            high < HALF_PI,
            dr.clip(dr.round(self.m * (1 - high / HALF_PI)), 1, self.m - 1 - above),
            0,
        )
        beside = self.m - above - below
        first = dr.select(row < above, 0, dr.select(row < above + below, above, above + below))
        rows = dr.select(row < above, above, dr.select(row < above + below, below, beside))
        is_beside = row >= above + below
        outer, rest = cell(
            row - first,
            rows,
            dr.select(row < above, 0, dr.select(is_beside, low, high)),
            dr.select(row < above, low, dr.select(is_beside, high, HALF_PI)),
            column,
            2 * self.m,
            middle + dr.select(is_beside, half, 0),
            middle + 2 * pi - dr.select(is_beside, half, 0),
        )
        is_inner = k < self.n**2
        return dr.select(is_inner, inner, outer), dr.select(is_inner, solid_angle, rest)


def peak_region(wi):
    """Limits in theta, middle in phi and half width in phi of the peak region."""
    theta = dr.acos(dr.clip(wi.z, 0, 1))
    half = dr.minimum(PEAK_PHI * dr.maximum(1, 0.5 / dr.maximum(dr.sin(theta), 1e-6)), pi)
    return (
        dr.maximum(theta - PEAK_THETA, 0),
        dr.minimum(theta + PEAK_THETA, HALF_PI),
        dr.atan2(-wi.y, -wi.x),
        half,
    )


def cell(row, rows, low, high, column, columns, left, right):
    """Middle and weight of a cell among rows x columns over low..high in theta, left..right in phi."""
    d_theta, d_phi = (high - low) / mi.Float(rows), (right - left) / mi.Float(columns)
    theta, phi = low + (mi.Float(row) + 0.5) * d_theta, left + (mi.Float(column) + 0.5) * d_phi
    sin = dr.sin(theta)
    return mi.Vector3f(sin * dr.cos(phi), sin * dr.sin(phi), dr.cos(theta)), sin * d_theta * d_phi

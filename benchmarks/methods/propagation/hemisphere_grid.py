"""Grids of directions over the hemisphere, for midpoint quadrature (thesis 3.3, 3.5).

A grid divides theta and phi into cells. Each has `cells`, their number, and `direction(k, wi)`.
Here k is an array of cell numbers and wi the direction of the observer in the local frame.
`direction` returns the direction to the middle of each cell in that frame, and the weight of the
cell, sin(theta) dtheta dphi [sr].
"""

from dataclasses import dataclass
from math import pi, radians

import drjit as dr
import mitsuba as mi

PEAK_THETA, PEAK_PHI = radians(10), radians(20)  # half widths of the peak region, thesis 3.3.2.2
HALF_PI = pi / 2


@dataclass(frozen=True)
class Hemisphere:
    """Grid of n x 2n cells of equal angles, the same for every observer (3.5.3)."""

    n: int

    @property
    def cells(self) -> int:
        return 2 * self.n**2

    def direction(self, k, wi):
        columns = 2 * self.n
        return cell(
            middle(k // columns, self.n, 0, HALF_PI), middle(k % columns, columns, 0, 2 * pi)
        )


@dataclass(frozen=True)
class Peak:
    """Grid of n x n cells over the peak region alone (3.5.5).

    The region spans 20 degrees in theta and 40 degrees in phi about the mirror direction. The rest
    of the hemisphere is left out. At theta = 30 degrees, where the thesis draws the region, its arc
    is 20 degrees long in both directions. Nearer to the normal 40 degrees of phi would be a shorter
    arc, narrower than the lobe. There the region is widened in phi so that the arc stays as long.
    """

    n: int

    @property
    def cells(self) -> int:
        return self.n**2

    def direction(self, k, wi):
        low, high, centre, half = peak_region(wi)
        return cell(
            middle(k // self.n, self.n, low, high),
            middle(k % self.n, self.n, centre - half, centre + half),
        )


@dataclass(frozen=True)
class Stratified:
    """Grid of n x n cells in the peak region and m x 2m cells in the rest (3.5.5).

    The rest is what lies above, beside and below the peak region.
    """

    n: int
    m: int

    @property
    def cells(self) -> int:
        return self.n**2 + 2 * self.m**2

    def direction(self, k, wi):
        low, high, centre, half = peak_region(wi)
        inner, solid_angle = Peak(self.n).direction(k, wi)
        row, column = (k - self.n**2) // (2 * self.m), (k - self.n**2) % (2 * self.m)
        # The rows of the outer grid are shared out in proportion to the ranges of theta: first the
        # rows above the region, then those below it, then those beside it.
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
        lower = dr.select(row < above, 0, dr.select(is_beside, low, high))
        upper = dr.select(row < above, low, dr.select(is_beside, high, HALF_PI))
        left_out = dr.select(is_beside, half, 0)
        outer, rest = cell(
            middle(row - first, rows, lower, upper),
            middle(column, 2 * self.m, centre + left_out, centre + 2 * pi - left_out),
        )
        is_inner = k < self.n**2
        return dr.select(is_inner, inner, outer), dr.select(is_inner, solid_angle, rest)


def peak_region(wi):
    """Limits in theta (lower, upper), middle in phi and half width in phi of the peak region."""
    theta = dr.acos(dr.clip(wi.z, 0, 1))
    half = dr.minimum(PEAK_PHI * dr.maximum(1, 0.5 / dr.maximum(dr.sin(theta), 1e-6)), pi)
    low, high = dr.maximum(theta - PEAK_THETA, 0), dr.minimum(theta + PEAK_THETA, HALF_PI)
    return low, high, dr.atan2(-wi.y, -wi.x), half


def middle(k, count, low, high):
    """Middle and width of interval k of `count` even ones from `low` to `high`."""
    width = (high - low) / mi.Float(count)
    return low + (mi.Float(k) + 0.5) * width, width


def cell(row, column):
    """Direction to the middle of a cell, and the weight of the cell [sr].

    row, column: `middle` of theta and of phi [rad].
    """
    (theta, d_theta), (phi, d_phi) = row, column
    sin = dr.sin(theta)
    return mi.Vector3f(sin * dr.cos(phi), sin * dr.sin(phi), dr.cos(theta)), sin * d_theta * d_phi

"""Average of the BRDF over the disc of the source.

A scatterometer's source is often wider than the lobe. The measured peak is then an average.
"""

import drjit as dr
import numpy as np
from drjit.llvm.ad import Array3f64, Float64

# Each rule has the largest distance from the mirror direction, in radii of the source, up to which
# it is used, and its numbers of Gauss nodes in each panel, in the plane of incidence and across it.
# With these rules the average has an error below 2e-3 for lobe widths from 0.0005 to 0.7.
RULES = ((4, (9, 7)), (12, (5, 3)), (np.inf, (3, 2)))


class Disc:
    """Quadrature over the disc of the source around each theta_i, with dense nodes at the peak.

    The offset in the plane of incidence runs over two panels. They meet at the mirror direction of
    theta_r, or at the point of the rim that is nearest to it. The offset across the plane runs over
    the upper half of the disc. Both are anchor + width sinh(t): the nodes are as fine as the lobe
    at its centre, and they cover the whole disc.

    Parameters
    ----------
    theta_i, theta_r
        Elevations of source and observer at each point [radians], (p,).
    half_angle
        Angular radius of the source [radians].
    """

    def __init__(self, theta_i, theta_r, half_angle: float):
        self.half_angle = half_angle
        offset = np.asarray(theta_r) - np.asarray(theta_i)
        rule_of = np.searchsorted([reach * half_angle for reach, _ in RULES], np.abs(offset))
        columns = []
        for number, (_, nodes) in enumerate(RULES):
            t, s, weight = panel(*nodes)
            for side in (-1, 1):
                # A panel is empty if the mirror direction lies beyond the rim on its side.
                points = np.flatnonzero((rule_of == number) & (side * offset < half_angle))
                columns.append(
                    [np.repeat(points, len(t)), np.full(len(t) * len(points), side)]
                    + [np.tile(column, len(points)) for column in (t, s, weight)]
                )
        point, side, t, s, weight = np.concatenate(columns, axis=1)
        order = np.argsort(point, kind="stable")
        self.point = point[order].astype(np.int64)
        self.first = np.searchsorted(self.point, np.arange(len(offset)))
        self.side, self.t, self.s, self.weight = (
            Float64(column[order]) for column in (side, t, s, weight)
        )
        dr.eval(self.side, self.t, self.s, self.weight)

    def direction(self, theta_i, theta_r, lobe_width, node) -> tuple[Array3f64, Float64]:
        """Unit vectors to the source and quadrature weights at nodes.

        Parameters
        ----------
        theta_i, theta_r
            Elevations of source and observer at each node's point [radians], Float64 (l,).
        lobe_width
            Width of the lobe, as `ReflectionModel.lobe_width`.
        node
            Indices of the nodes, UInt32 (l,).

        Returns
        -------
        tuple
            Unit vectors to the source, and weights proportional to cosine times solid angle.
        """
        side, t, s, weight = (
            dr.gather(Float64, column, node) for column in (self.side, self.t, self.s, self.weight)
        )
        R = dr.opaque(Float64, self.half_angle)
        mirror = theta_r - theta_i
        anchor = dr.clip(mirror, -R, R)
        in_plane, slope = graded(t, R - side * anchor, 2 * lobe_width + dr.abs(mirror - anchor))
        in_plane = anchor + side * in_plane
        height = dr.safe_sqrt(dr.square(R) - dr.square(in_plane))
        across, slope_across = graded(
            s, height, dr.cos(theta_i) * dr.hypot(2 * lobe_width, in_plane - mirror)
        )
        sin, cos = dr.sincos(theta_i + in_plane)
        sin_across, cos_across = dr.sincos(across)
        cosine = cos * cos_across
        weight *= slope * slope_across * cos_across * dr.maximum(cosine, 0)
        return Array3f64(sin * cos_across, sin_across, cosine), weight

    def average(self, values, slopes) -> tuple[np.ndarray, np.ndarray]:
        """Weighted means of the BRDF and of its derivatives over each point's nodes.

        Parameters
        ----------
        values
            Products f * weight, and the weights, (m, nodes, 2).
        slopes
            Products of the derivatives of f and the weights, (m, nodes, n).

        Returns
        -------
        tuple
            Means of f, (m, points), and of its derivatives, (m, points, n).
        """
        sums = np.add.reduceat(values, self.first, axis=1)
        slope_sums = np.add.reduceat(slopes, self.first, axis=1)
        return sums[..., 0] / sums[..., 1], slope_sums / sums[..., 1:]


def panel(in_plane: int, across: int):
    """Nodes t, s of a product rule on the unit square, flattened, and their weights.

    The height of the disc varies as a square root near the rim, t = 1 (and t = 0). If there are
    more than 3 nodes in the plane, they are made denser there.
    """
    t, t_weight = gauss(in_plane)
    s, s_weight = gauss(across)
    if in_plane > 3:
        t, t_weight = t * t * (3 - 2 * t), t_weight * 6 * t * (1 - t)
    return np.tile(t, across), np.repeat(s, in_plane), np.outer(s_weight, t_weight).ravel()


def gauss(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Gauss-Legendre nodes and weights on 0..1, (count,) each."""
    x, weights = np.polynomial.legendre.leggauss(count)
    return 0.5 * (x + 1), 0.5 * weights


def graded(t, length, width):
    """Position in 0..length for t in 0..1, and its derivative with respect to t.

    The scale is fine at distances up to `width` from 0.
    """
    end = dr.asinh(length / width)
    return width * dr.sinh(end * t), width * end * dr.cosh(end * t)

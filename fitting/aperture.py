"""Average of the BRDF over the disc of the source: at a scatterometer's peak the lobe is often narrower than the source."""
import drjit as dr
import numpy as np
from drjit.llvm.ad import Array3f64, Float64

NEAR = 4                            # source radii from the mirror direction; beyond, the BRDF is smooth over the disc
NODES = {True: (10, 7), False: (5, 3)}   # near the peak or not: Gauss nodes per panel in the plane, and across: 5e-4


class Disc:
    """Quadrature over a source of angular radius `half_angle` [radians] around each theta_i, graded toward the peak.

    The in-plane offset runs over two panels that meet where the mirror direction of theta_r lies (or at the rim nearest
    to it), the offset across the plane over the upper half of the disc. Both are anchor + width sinh(t): as fine as
    the lobe at its centre and as wide as the disc. theta_i, theta_r [radians]: the points.
    """

    def __init__(self, theta_i, theta_r, half_angle: float):
        self.half_angle = half_angle
        columns = []
        for point, offset in enumerate(np.asarray(theta_r) - np.asarray(theta_i)):
            near = abs(offset) < NEAR * half_angle
            (t, t_weight), (s, s_weight) = (gauss(nodes) for nodes in NODES[near])
            t, t_weight = t * t * (3 - 2 * t), t_weight * 6 * t * (1 - t)   # the disc's height is a root at its rim
            for side in (-1, 1):
                if side * offset >= half_angle:
                    continue                            # this panel has no extent
                T, S = np.meshgrid(t, s)
                columns.append([np.full(T.size, value) for value in (point, side)]
                               + [T.ravel(), S.ravel(), np.outer(s_weight, t_weight).ravel()])
        point, side, t, s, weight = np.concatenate(columns, axis=1)
        self.point = point.astype(np.int64)
        self.first = np.searchsorted(self.point, np.arange(len(theta_i)))
        self.side, self.t, self.s, self.weight = (Float64(column) for column in (side, t, s, weight))
        dr.eval(self.side, self.t, self.s, self.weight)

    def direction(self, theta_i, theta_r, e, node) -> tuple[Array3f64, Float64]:
        """Unit vector to the source, and the weight (cosine x solid angle, any scale), at each of the nodes."""
        side, t, s, weight = (dr.gather(Float64, column, node) for column in (self.side, self.t, self.s, self.weight))
        R = dr.opaque(Float64, self.half_angle)
        mirror = theta_r - theta_i
        anchor = dr.clip(mirror, -R, R)
        in_plane, slope = graded(t, R - side * anchor, 2 * e + dr.abs(mirror - anchor))
        in_plane = anchor + side * in_plane
        height = dr.safe_sqrt(dr.square(R) - dr.square(in_plane))
        across, slope_across = graded(s, height, dr.cos(theta_i) * dr.hypot(2 * e, in_plane - mirror))
        sin, cos = dr.sincos(theta_i + in_plane)
        sin_across, cos_across = dr.sincos(across)
        cosine = cos * cos_across
        weight *= slope * slope_across * cos_across * dr.maximum(cosine, 0)
        return Array3f64(sin * cos_across, sin_across, cosine), weight

    def average(self, values, slopes) -> tuple[np.ndarray, np.ndarray]:
        """Weighted means over each point's nodes, (n, points) and (n, points, 4), of f x weight, weight and df x weight."""
        sums = np.add.reduceat(values, self.first, axis=1)
        return sums[..., 0] / sums[..., 1], np.add.reduceat(slopes, self.first, axis=1) / sums[..., 1:]


def gauss(count: int) -> tuple[np.ndarray, np.ndarray]:
    x, weights = np.polynomial.legendre.leggauss(count)
    return 0.5 * (x + 1), 0.5 * weights


def graded(t, length, width):
    """Position in 0..length, and its derivative by t in 0..1, on a scale that is fine within `width` of 0."""
    end = dr.asinh(length / width)
    return width * dr.sinh(end * t), width * end * dr.cosh(end * t)

"""Hemispherical reflectances of the Sandford-Robertson model, by one-dimensional quadrature.

The azimuthal integral of the lobe is known in closed form, so that HDR and DHR are integrals over
one elevation angle. The integrand has a peak of width about 2e at the other elevation angle, and a
knee of width b or e near the horizon. Three panels of Gauss-Legendre nodes, dense at the peak and
at the horizon, resolve both with an error of 1e-10 in Float64.
"""

from functools import cache

import drjit as dr
import numpy as np

from mi_lcair.physics.reflection.sandford_robertson_equations import (
    SandfordRobertsonSurface,
    e2_H,
    g,
    observer_factor,
    rho_s,
)

NODES = 48  # nodes of each panel


def azimuthal_lobe(theta_i, theta_r, e):
    """int_0^(2 pi) h(alpha) dphi: Eq 2.22, integrated exactly over the azimuth between i and r.

    With q = 1 + cos(i, r) and k = (1 - e^2) (cos theta_i + cos theta_r)^2 / 2, the denominator of
    Eq 2.22 is the square of (q - k) / q. The integral of (q / (q - k))^2 is a sum of standard
    integrals. Half sums and half differences of the angles avoid cancellation.
    """
    half_sum, half_difference = 0.5 * (theta_i + theta_r), 0.5 * (theta_i - theta_r)
    sin_p, cos_p = dr.sincos(half_sum)
    sin_m, cos_m = dr.sincos(half_difference)
    e2 = dr.square(e)
    p2 = dr.square(sin_p) + e2 * dr.square(cos_p)
    m2 = dr.square(sin_m) + e2 * dr.square(cos_m)
    ratio = (1 - e2) * cos_p * cos_m * dr.rsqrt(p2 * m2)
    spread = (1 - e2) * (dr.square(cos_p) * m2 + dr.square(cos_m) * p2) / (p2 * m2)
    return dr.pi * (2 + ratio * (4 + spread))


def HDR(S: SandfordRobertsonSurface, theta_r):
    """Hemispherical-directional reflectance, int f_r cos(theta_i) domega_i (Eq 2.9).

    S: Float64 surface, one for all angles (width 1) or one for each angle. theta_r: Float64 array,
    0 <= theta_r < pi/2 [rad]. The error is 1e-10. Derivatives are attached to S.
    """
    sin_r, cos_r = dr.sincos(theta_r)
    floor = S.rho_d / S.G * g(cos_r, dr.square(sin_r), S.b)
    return floor + observer_factor(S, cos_r, dr.square(sin_r)) * HDR_lobe(S, theta_r)


def HDR_lobe(S: SandfordRobertsonSurface, theta_r):
    """The lobe's part of HDR, divided by d(theta_r) / cos(theta_r).

    It is finite up to 90 degrees. Away from grazing angles it is about proportional to
    cos(theta_r).
    """

    def integrand(theta_i, theta_r, S):
        sin_i, cos_i = dr.sincos(theta_i)
        weight = rho_s(S, cos_i, dr.square(sin_i)) * dr.square(S.e) / e2_H(cos_i, S.e)
        return weight * cos_i * sin_i * azimuthal_lobe(theta_i, theta_r, S.e)

    return integrate_elevation(integrand, theta_r, S) * (0.25 * dr.inv_pi)


def DHR(S: SandfordRobertsonSurface, theta_i):
    """Directional-hemispherical reflectance, int f_r cos(theta_r) domega_r (Eq 2.8).

    S and theta_i [rad] are as in `HDR`, and so are error and derivatives.
    """

    def integrand(theta_r, theta_i, S):
        sin_r, cos_r = dr.sincos(theta_r)
        weight = observer_factor(S, cos_r, dr.square(sin_r)) * cos_r * sin_r
        return weight * azimuthal_lobe(theta_i, theta_r, S.e)

    sin_i, cos_i = dr.sincos(theta_i)
    sin2_i = dr.square(sin_i)
    lobe = rho_s(S, cos_i, sin2_i) * dr.square(S.e) / e2_H(cos_i, S.e) * (0.25 * dr.inv_pi)
    return S.rho_d / S.G * g(cos_i, sin2_i, S.b) + lobe * integrate_elevation(integrand, theta_i, S)


gauss = cache(np.polynomial.legendre.leggauss)


def integrate_elevation(integrand, peak, S: SandfordRobertsonSurface):
    """int_0^(pi/2) integrand(theta, peak, S) dtheta, for a peak of width about 2e at theta = peak.

    The panels are [0, peak], [peak, middle] and [middle, pi/2]. In each, theta = anchor +-
    width sinh(w) at Gauss nodes w. The nodes carry no derivatives: the integral does not depend on
    them.

    Parameters
    ----------
    integrand
        Function of theta, peak and S, one value for each lane.
    peak
        Angles of the peak [rad], Float64 (n,).
    S
        Float64 `Surface`: one for all angles (width 1), or one for each angle.

    Returns
    -------
    Float64
        Integrals, (n,).
    """
    Float = type(peak)
    x, weights = gauss(NODES)
    count = dr.width(peak)
    x, weights = (dr.tile(Float(nodes), count) for nodes in (0.5 * (x + 1), 0.5 * weights))
    theta_0, S = dr.repeat(peak, NODES), S.repeat(NODES)
    lobe_width = 2 * dr.detach(S.e)
    horizon_width = dr.maximum(dr.minimum(dr.detach(S.b), lobe_width), 1e-4)
    to_middle = 0.5 * (0.5 * dr.pi - theta_0)
    # If the peak is near the horizon, the knee of the integrand lies below the peak.
    below_width = dr.minimum(lobe_width, 2 * to_middle + horizon_width)
    total = 0
    for anchor, sign, length, width in (
        (theta_0, -1, theta_0, below_width),
        (theta_0, 1, to_middle, lobe_width),
        (0.5 * dr.pi, -1, to_middle, horizon_width),
    ):
        w_end = dr.asinh(length / width)
        w = w_end * x
        theta = anchor + sign * width * dr.sinh(w)
        total += integrand(theta, theta_0, S) * (width * dr.cosh(w) * w_end * weights)
    return dr.block_sum(total, NODES)

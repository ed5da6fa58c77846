"""The generalised Trowbridge-Reitz distribution of microfacet normals, and its normals as seen in
V-shaped cavities.

With theta the angle of a facet's normal m to the surface's normal and a = alpha^2 (Burley 2012),

    D(m) = D_0 (1 + w sin^2 theta)^(-gamma),   w = (1 - a) / a,
    D_0 = B((gamma - 1) L) / (pi a B(L)),      L = ln(1 / a),     B(x) = x / (1 - exp(-x)),

so that int D cos(theta) domega = 1 over the hemisphere. B(0) = 1 are the removable limits at
gamma = 1 and at alpha = 1 (facets in all directions). gamma = 2 is the distribution of Trowbridge
and Reitz (GGX, Walter et al. 2007).
"""

from math import log

import drjit as dr

# Sampling is done beside the limits alpha = 1 and gamma = 1: with at least this w, and with at
# least this |gamma - 1|. The density of the samples then differs from D cos by less than 2e-5 of
# itself.
SMALLEST_SPREAD = 1e-6
SMALLEST_EXPONENT = 1e-6
NEWTON_STEPS = 4  # after them the distribution function of the azimuth is right to 1e-8


def bernoulli(x):
    """B(x) = x / (1 - exp(-x)), to 1e-15; x a Float64 array."""
    x2 = dr.square(x)
    near = dr.abs(x) < 0.1
    series = 1 + x / 2 + x2 / 12 * (1 - x2 / 60 * (1 - x2 / 42 * (1 - x2 / 40)))
    far = dr.select(near, 1, x)
    return dr.select(near, series, far / (1 - dr.exp(-far)))


def peak(alpha, gamma):
    """D_0 [1/sr], D towards the surface's normal; Float64 arrays."""
    L = -2 * dr.log(alpha)
    return bernoulli((gamma - 1) * L) / (dr.pi * dr.square(alpha) * bernoulli(L))


def spread(alpha):
    """w = (1 - alpha^2) / alpha^2."""
    a = dr.square(alpha)
    return (1 - alpha) * (1 + alpha) / a


def density(sin2, peak, spread, gamma):
    """D [1/sr] at the squared sine of the normal's angle."""
    # The base is 1 or more. A bare (a cos^2 + sin^2)^-gamma, or its derivative, overflows Float32
    # for narrow lobes.
    return peak * dr.exp(-gamma * dr.log(dr.fma(spread, sin2, 1)))


def width(gamma, spread):
    """Tangent of the angle at which D falls to a quarter of its top; 1 where that lies beyond 45
    degrees.
    """
    sin2 = (dr.exp(log(4) / gamma) - 1) / dr.maximum(spread, SMALLEST_SPREAD)
    sin2 = dr.minimum(sin2, 0.5)
    return dr.sqrt(sin2 / (1 - sin2))


def mean_sin2(alpha, gamma):
    """Mean squared sine of a normal's angle under D cos; Float64 arrays.

    (B((1 - gamma) L) / B((2 - gamma) L) - a) / (1 - a), with the limit 1/2 at alpha = 1.
    """
    L = -2 * dr.log(alpha)
    a = dr.square(alpha)
    broad = a > 1 - SMALLEST_SPREAD
    mean = bernoulli((1 - gamma) * L) / bernoulli((2 - gamma) * L)
    return dr.select(broad, 0.5, (mean - a) / dr.select(broad, 1, 1 - a))


def quantile_terms(gamma, spread):
    """(q, 1 / (gamma - 1)) of `sample_sin2`, with q = 1 - a^(gamma - 1), without derivatives;
    Float64 arrays.
    """
    exponent = dr.detach(gamma) - 1
    exponent = dr.select(exponent < 0, -1, 1) * dr.maximum(dr.abs(exponent), SMALLEST_EXPONENT)
    L = dr.log(1 + dr.maximum(dr.detach(spread), SMALLEST_SPREAD))
    x = exponent * L
    return x / bernoulli(x), 1 / exponent


def sample_sin2(u, spread, q, inverse_exponent):
    """Squared sine of a normal's angle, of density D cos; q and inverse_exponent are those of
    `quantile_terms`.

    u is the share of normals within theta, (1 - (1 + w sin^2 theta)^(1 - gamma)) / q.
    """
    z = -u * q
    near = dr.abs(z) < 0.5
    z_near, z_far = dr.select(near, z, 0), dr.select(near, 0, z)
    ln = dr.select(near, 2 * dr.atanh(z_near / (2 + z_near)), dr.log(dr.maximum(1 + z_far, 0)))
    half = -0.5 * inverse_exponent * ln
    ratio = 2 * dr.sinh(half) * dr.exp(half)
    return dr.clip(ratio / dr.maximum(spread, SMALLEST_SPREAD), 0, 1)


def sample_visible_azimuth(k, u):
    """Azimuth phi of a normal against the observer's [rad, -pi..pi], of density
    (1 + clip(k cos phi, -1, 1)) / (2 pi).

    k: tan(theta_m) tan(theta_r) of normal and observer; u in 0..1. Of the two sides of a V-shaped
    cavity each is seen in proportion to its projected area, 1 + k cos phi, or not at all. Hence the
    density. Its distribution function is linear where one side hides the other. In between it is a
    Kepler equation. Newton's steps solve it from a bound on the side where they do not overshoot.
    """
    k = dr.minimum(k, 1e6)
    side = 2 * u - 1
    share = dr.abs(side)
    hidden = dr.acos(1 / dr.maximum(k, 1))  # up to this azimuth only one side of the cavity is seen
    root = dr.sqrt(dr.maximum(dr.square(k) - 1, 0))
    rest = dr.maximum(1 - k, 0)
    target = dr.pi * (1 - share)
    # delta = pi - hidden - phi solves (delta - sin) + root (1 - cos) + rest sin = target. Each of
    # the three terms alone bounds it.
    delta = dr.minimum(dr.cbrt(dr.pi**2 * target), dr.pi - 2 * hidden)
    delta = dr.minimum(delta, dr.pi * dr.sqrt(target / dr.maximum(2 * root, 1e-6)))
    delta = dr.minimum(delta, target / dr.maximum(rest, 1e-6))
    for _ in range(NEWTON_STEPS):
        sin, cos = dr.sincos(0.5 * delta)
        one_minus_cos, sin = 2 * dr.square(sin), 2 * sin * cos
        value = delta - sin + root * one_minus_cos + rest * sin - target
        slope = one_minus_cos + root * sin + rest * (1 - one_minus_cos)
        delta = dr.maximum(delta - value / dr.maximum(slope, 1e-9), 0)
    phi = dr.select(dr.pi * share < 2 * hidden, 0.5 * dr.pi * share, dr.pi - hidden - delta)
    return dr.select(side < 0, -phi, phi)

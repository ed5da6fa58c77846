"""The generalised Trowbridge-Reitz distribution of microfacet normals.

With theta the angle of a facet's normal m to the surface's normal and a = alpha^2 (Burley 2012),

    D(m) = D_0 (1 + w sin^2 theta)^(-gamma),   w = (1 - a) / a,
    D_0 = B((gamma - 1) L) / (pi a B(L)),      L = ln(1 / a),     B(x) = x / (1 - exp(-x)),

so that int D cos(theta) domega = 1 over the hemisphere. B(0) = 1 gives the removable limits at
gamma = 1 and at alpha = 1 (facets in all directions). gamma = 2 is the distribution of Trowbridge
and Reitz (GGX, Walter et al. 2007).
"""

from math import log

import drjit as dr

from mi_lcair.physics.reflection.directions import SMALLEST

# The sampling equations are singular at alpha = 1 and gamma = 1. Sampling therefore uses at least
# this w and at least this |gamma - 1|. The relative error of the samples' density is then below
# 2e-5.
SMALLEST_SPREAD = 1e-6
SMALLEST_EXPONENT = 1e-6


def bernoulli(x):
    """B(x) = x / (1 - exp(-x)) for a Float64 array x, with an error of 1e-15."""
    x2 = dr.square(x)
    near = dr.abs(x) < 0.1
    series = 1 + x / 2 + x2 / 12 * (1 - x2 / 60 * (1 - x2 / 42 * (1 - x2 / 40)))
    far = dr.select(near, 1, x)
    return dr.select(near, series, far / (1 - dr.exp(-far)))


def peak(alpha, gamma):
    """D_0 [1/sr], the value of D along the surface's normal, from Float64 arrays."""
    L = -2 * dr.log(alpha)
    return bernoulli((gamma - 1) * L) / (dr.pi * dr.square(alpha) * bernoulli(L))


def spread(alpha):
    """w = (1 - alpha^2) / alpha^2, without cancellation near alpha = 1."""
    a = dr.square(alpha)
    return (1 - alpha) * (1 + alpha) / a


def density(sin2, peak, spread, gamma):
    """D [1/sr] for facets with the squared sine sin2 of their normal's angle.

    peak and spread are the results of the functions `peak` and `spread`.
    """
    # The base 1 + w sin^2 is at least 1. The equivalent (a cos^2 + sin^2)^-gamma, or its
    # derivative, overflows Float32 for narrow lobes.
    return peak * dr.exp(-gamma * dr.log(dr.fma(spread, sin2, 1)))


def width(gamma, spread):
    """Tangent of the angle at which D has fallen to a quarter of its maximum, at most 1."""
    sin2 = (dr.exp(log(4) / gamma) - 1) / dr.maximum(spread, SMALLEST_SPREAD)
    sin2 = dr.minimum(sin2, 0.5)
    return dr.sqrt(sin2 / (1 - sin2))


def mean_sin2(alpha, gamma):
    """Mean squared sine of a normal's angle, with the weight D cos; Float64 arrays.

    It is (B((1 - gamma) L) / B((2 - gamma) L) - a) / (1 - a), with the limit 1/2 at alpha = 1.
    """
    L = -2 * dr.log(alpha)
    a = dr.square(alpha)
    broad = a > 1 - SMALLEST_SPREAD
    mean = bernoulli((1 - gamma) * L) / bernoulli((2 - gamma) * L)
    return dr.select(broad, 0.5, (mean - a) / dr.select(broad, 1, 1 - a))


def quantile_terms(gamma, spread):
    """q = 1 - a^(gamma - 1) and 1 / (gamma - 1) for `sample_sin2`.

    Arguments and results are Float64 arrays. The results carry no derivatives.
    """
    exponent = dr.detach(gamma) - 1
    exponent = dr.select(exponent < 0, -1, 1) * dr.maximum(dr.abs(exponent), SMALLEST_EXPONENT)
    L = dr.log(1 + dr.maximum(dr.detach(spread), SMALLEST_SPREAD))
    x = exponent * L
    return x / bernoulli(x), 1 / exponent


def sample_sin2(u, spread, q, inverse_exponent):
    """Squared sine of a random normal's angle, with density D cos.

    The function inverts u = (1 - (1 + w sin^2 theta)^(1 - gamma)) / q, the share of normals with
    angles below theta.

    Parameters
    ----------
    u
        Uniform random number in 0..1.
    spread
        w, from `spread`.
    q, inverse_exponent
        Results of `quantile_terms`.

    Returns
    -------
    Dr.Jit array
        sin^2(theta), 0..1.
    """
    # (1 - u q)^(1 / (1 - gamma)) - 1 is written with ln and sinh, so that it loses no digits near
    # 0.
    z = -u * q
    near = dr.abs(z) < 0.5
    z_near, z_far = dr.select(near, z, 0), dr.select(near, 0, z)
    ln = dr.select(near, 2 * dr.atanh(z_near / (2 + z_near)), dr.log(dr.maximum(1 + z_far, 0)))
    half = -0.5 * inverse_exponent * ln
    ratio = 2 * dr.sinh(half) * dr.exp(half)
    return dr.clip(ratio / dr.maximum(spread, SMALLEST_SPREAD), 0, 1)


def visibility(c_i, c_r, p2):
    """G / (c_i c_r) for the cosines c_i and c_r of the two directions and p2 = p^2."""
    unhidden = 1 / dr.maximum(c_i * c_r, SMALLEST)
    hidden = (c_i + c_r) / dr.maximum(p2 * dr.maximum(c_i, c_r), SMALLEST)
    return dr.minimum(unhidden, hidden)


def half_vector(i, r):
    """Squared sine of the half-vector's angle to the normal, and p^2.

    p is the cosine of the half-vector's angle to i, which equals that to r.
    """
    x, y, z = i.x + r.x, i.y + r.y, i.z + r.z
    xy = dr.square(x) + dr.square(y)
    xyz = dr.maximum(xy + dr.square(z), SMALLEST)
    return xy / xyz, 0.25 * xyz

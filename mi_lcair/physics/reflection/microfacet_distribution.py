"""The generalised Trowbridge-Reitz distribution of microfacet normals, and its visible normals.

The visible normals are those of facets in V-shaped cavities.

With theta the angle of a facet's normal m to the surface's normal and a = alpha^2 (Burley 2012),

    D(m) = D_0 (1 + w sin^2 theta)^(-gamma),   w = (1 - a) / a,
    D_0 = B((gamma - 1) L) / (pi a B(L)),      L = ln(1 / a),     B(x) = x / (1 - exp(-x)),

so that int D cos(theta) domega = 1 over the hemisphere. B(0) = 1 gives the removable limits at
gamma = 1 and at alpha = 1 (facets in all directions). gamma = 2 is the distribution of Trowbridge
and Reitz (GGX, Walter et al. 2007).
"""

from math import log

import drjit as dr

# The sampling equations are singular at alpha = 1 and gamma = 1. Sampling therefore uses at least
# this w and at least this |gamma - 1|. The relative error of the samples' density is then below
# 2e-5.
SMALLEST_SPREAD = 1e-6
SMALLEST_EXPONENT = 1e-6
NEWTON_STEPS = 4  # steps after which the azimuth's distribution function has an error below 1e-8


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


def sample_visible_azimuth(k, u):
    """Azimuth phi of a random visible normal relative to the observer's [rad, -pi..pi].

    k: tan(theta_m) tan(theta_r) of normal and observer. u: uniform random number in 0..1. A side of
    a V-shaped cavity is seen in proportion to its projected area 1 + k cos phi, or is hidden. The
    density is therefore (1 + clip(k cos phi, -1, 1)) / (2 pi). Its distribution function is linear
    in phi where one side hides the other. Elsewhere inverting it means to solve a Kepler equation.
    Newton's method does that, from a starting value from which its steps do not overshoot.
    """
    k = dr.minimum(k, 1e6)
    side = 2 * u - 1
    share = dr.abs(side)
    hidden = dr.acos(1 / dr.maximum(k, 1))  # up to this azimuth only one side is visible
    root = dr.sqrt(dr.maximum(dr.square(k) - 1, 0))
    rest = dr.maximum(1 - k, 0)
    target = dr.pi * (1 - share)
    # delta = pi - hidden - phi solves
    #     (delta - sin delta) + root (1 - cos delta) + rest sin delta = target.
    # Each of the three terms alone gives an upper bound of delta. The start is the least of them.
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

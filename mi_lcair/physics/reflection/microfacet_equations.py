"""Equations of the microfacet model: facets, Fresnel reflection, hemispherical reflectance."""

from math import log

import drjit as dr
import numpy as np

from mi_lcair.physics.reflection.interface import SMALLEST, tiled, unit_rule

# The generalised Trowbridge-Reitz distribution of microfacet normals
# -------------------------------------------------------------------
# With theta the angle of a facet's normal m to the surface's normal and a = alpha^2 (Burley 2012),
#
#     D(m) = D_0 (1 + w sin^2 theta)^(-gamma),   w = (1 - a) / a,
#     D_0 = B((gamma - 1) L) / (pi a B(L)),      L = ln(1 / a),     B(x) = x / (1 - exp(-x)),
#
# so that int D cos(theta) domega = 1 over the hemisphere. B(0) = 1 gives the removable limits at
# gamma = 1 and at alpha = 1 (facets in all directions). gamma = 2 is the distribution of Trowbridge
# and Reitz (GGX, Walter et al. 2007).

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


# Fresnel's equations for unpolarised radiation in air on a surface of refractive index n + ik
# --------------------------------------------------------------------------------------------
# With p the cosine of the angle of incidence and s^2 = 1 - p^2, let (a + ib)^2 = (n + ik)^2 - s^2.
#
#     R_s = ((a - p)^2 + b^2) / ((a + p)^2 + b^2)                               perpendicular
#     R_p = R_s Q,  Q = ((a p - s^2)^2 + b^2 p^2) / ((a p + s^2)^2 + b^2 p^2)   parallel
#     F = (R_s + R_p) / 2,  1 - F = (1 - R_s) + R_s (1 - Q) / 2
#
# (Born and Wolf, Principles of Optics, 1.5 and 14.2; k = 0 for dielectrics.) No small number is
# computed as the difference of large ones. The larger of a and b is a square root, and the smaller
# follows from a b = n k. a - p is computed as ((n^2 - 1 - k^2) + b^2) / (a + p). 1 - R_s and 1 - Q
# are computed as products.

# Smallest cosine. Its fourth power is a normal Float32 number. At this cosine F differs from 1 by
# less than the rounding of Float32.
GRAZING = 1e-9


def reflectance(cos, contrast, nk):
    """Fresnel reflectance F at the cosine `cos`, 0..1, of the angle of incidence.

    contrast = n^2 - 1 - k^2 and nk = n k, with n >= 1, should be computed in Float64.
    """
    R_s, Q, _, _ = polarised(cos, contrast, nk)
    return 0.5 * R_s * (1 + Q)


def transmittance(cos, contrast, nk):
    """1 - F, computed without cancellation; arguments as in `reflectance`."""
    R_s, _, one_minus_R_s, one_minus_Q = polarised(cos, contrast, nk)
    return one_minus_R_s + 0.5 * R_s * one_minus_Q


def polarised(cos, contrast, nk):
    """R_s, Q, 1 - R_s and 1 - Q of the module's equations; arguments as in `reflectance`."""
    p = dr.clip(cos, GRAZING, 1)
    p2 = dr.square(p)
    s2 = 1 - p2
    real = contrast + p2
    larger = dr.sqrt(0.5 * (dr.sqrt(dr.square(real) + 4 * dr.square(nk)) + dr.abs(real)))
    smaller = nk / larger
    refracted = real >= 0
    a, b = dr.select(refracted, larger, smaller), dr.select(refracted, smaller, larger)
    b2 = dr.square(b)
    inverse_s = 1 / (dr.square(a + p) + b2)
    inverse_p = 1 / (dr.square(a * p + s2) + b2 * p2)
    R_s = (dr.square((contrast + b2) / (a + p)) + b2) * inverse_s
    Q = (dr.square(a * p - s2) + b2 * p2) * inverse_p
    return R_s, Q, 4 * a * p * inverse_s, 4 * a * p * s2 * inverse_p


# Hemispherical reflectance of the microfacet lobe, by quadrature over facet normals
# ----------------------------------------------------------------------------------
# HDR = int F D G p / cos(theta_r) domega_m, over the normals m that reflect r upward. With
# c = cos(theta_r), z = m_z and p = r.m = c z (1 + k cos phi), k = tan(theta_r) tan(theta_m), the
# visible projected area G p / c is the smallest of
#
#     p / c   (no facet hides another),    2 z   (masking),    2 z (2 p z - c) / c   (shadowing).
#
# Each of the three applies in one interval of the azimuth phi, and each interval has its own Gauss
# nodes. The panels in theta_m begin and end at the angles of `breaks`. At these angles the
# azimuthal integral has a term of power 3/2, which the change of variable in each panel makes
# smooth. The error of the result is at most 1e-8 for all parameters.

POLAR = (40, 16, 16, 40, 20, 20)  # nodes of each panel in theta_m
AZIMUTHS = (12, 8, 24)  # nodes of each interval in phi: shadowing, neither, masking
MEAN_NODES = 48  # nodes of the hemispherical mean
GRAZING_KNEE = 0.01  # cosine near which F of the strongest metals varies fastest
REACH = np.arcsinh(1 / GRAZING_KNEE)


def lobe_reflectance(S, theta_r, reflectance):
    """HDR of the lobe, with derivatives attached to S.

    Parameters
    ----------
    S
        Float64 `Surface`: one for all angles (width 1), or one for each angle.
    theta_r
        Angles of the observer, 0 <= theta_r < pi/2 [rad], Float64 (n,).
    reflectance
        Function of S and the cosine p: the reflectance of a facet.

    Returns
    -------
    Float64
        Reflectances of the lobe, (n,).
    """
    S_polar = S.repeat(sum(POLAR))
    theta, weight = polar_nodes(theta_r, dr.detach(S_polar.alpha))
    theta_r = dr.repeat(theta_r, sum(POLAR))
    dr.eval(theta, weight, theta_r)
    sin, cos = dr.sincos(theta)
    D = density(dr.square(sin), S_polar.peak, S_polar.spread, S_polar.gamma)
    azimuthal = azimuthal_integral(S_polar, theta_r, theta, reflectance)
    return dr.block_sum(weight * sin * D * azimuthal, sum(POLAR))


def breaks(theta_r):
    """The angles theta_m, ascending from 0, between which the azimuthal integral is smooth.

    In degrees: shadowing begins at (90 - theta_r) / 3. From (90 - theta_r) / 2 on some azimuths
    reflect r below the horizon, and from (90 + theta_r) / 2 on all do. For theta_r above 45,
    masking reaches from 90 - theta_r to theta_r, and every facet is partly hidden from 45 on. For
    smaller theta_r, every facet is partly hidden from (90 + theta_r) / 3 on.
    """
    level = 0.5 * dr.pi
    steep = theta_r > 0.25 * dr.pi
    last = (level + theta_r) / 3
    cut = 0.5 * (level - theta_r)
    return (
        dr.zeros(type(theta_r), dr.width(theta_r)),
        (level - theta_r) / 3,
        dr.select(steep, cut, dr.minimum(cut, last)),
        dr.select(steep, level - theta_r, dr.maximum(cut, last)),
        dr.select(steep, 0.25 * dr.pi, dr.maximum(cut, last)),
        dr.select(steep, theta_r, dr.maximum(cut, last)),
        0.5 * (level + theta_r),
    )


def polar_nodes(theta_r, alpha):
    """Angles theta_m and their weights, sum(POLAR) in a row for each theta_r.

    The angles are dense at the lobe's maximum and at the `breaks`.
    """
    Float = type(theta_r)
    count, nodes = dr.width(theta_r), sum(POLAR)
    x, weight = (np.concatenate(parts) for parts in zip(*map(unit_rule, POLAR)))
    panel = np.repeat(np.arange(len(POLAR)), POLAR)
    at_top = panel == 0  # the first panel begins at the maximum; only its end is a break
    place = np.where(at_top, x * (2 - x), x * x * (3 - 2 * x))
    weight = weight * np.where(at_top, 2 * (1 - x), 6 * x * (1 - x))
    place, weight = (tiled(Float, numbers, count) for numbers in (place, weight))
    panel = tiled(dr.uint32_array_t(Float), panel, count)
    edges = breaks(theta_r)
    start, end = Float(0), Float(0)
    for number in range(len(POLAR)):
        start = dr.select(panel == number, dr.repeat(edges[number], nodes), start)
        end = dr.select(panel == number, dr.repeat(edges[number + 1], nodes), end)
    start, end = dr.asinh(start / alpha), dr.asinh(end / alpha)
    place = dr.fma(end - start, place, start)
    return alpha * dr.sinh(place), alpha * dr.cosh(place) * (end - start) * weight


def azimuthal_integral(S, theta_r, theta, reflectance):
    """int F G p / c dphi over all azimuths that reflect upward, one value for each lane."""
    Float = type(theta)
    sin, z = dr.sincos(theta)
    sin_r, c = dr.sincos(theta_r)
    tau2 = dr.square(sin / z)
    k = sin_r * sin / (c * z)
    # Azimuths at which the reflection reaches the horizon, shadowing ends and masking begins.
    lowest = azimuth(0.5 * (tau2 - 1), k)
    unhidden = tau2 < 1
    end_shadow = dr.select(
        unhidden, azimuth((3 * tau2 - 1) / (3 - dr.minimum(tau2, 1)), k), azimuth(tau2, k)
    )
    end_masking = dr.select(unhidden, azimuth(1, k), end_shadow)
    # Azimuth over which the integrand changes. F varies in p no faster than over 1e-3.
    width = dr.clip(c * z / (sin_r * sin), 1e-3 * z / sin, 10)
    dr.eval(k, z, c, lowest, end_shadow, end_masking, width)
    count = dr.width(theta)
    total = 0
    stretches = ((lowest, end_shadow), (end_shadow, end_masking), (end_masking, 0))
    for number, (nodes, (start, end)) in enumerate(zip(AZIMUTHS, stretches)):
        x, weight = (tiled(Float, numbers, count) for numbers in unit_rule(nodes))
        length, scale, first = (
            dr.repeat(v + dr.zeros(Float, count), nodes) for v in (start - end, width, start)
        )
        # The nodes are dense at the start, where p, and with it F, varies fastest.
        stretched = dr.asinh(length / scale)
        phi = first - scale * dr.sinh(stretched * x)
        z_, c_, k_ = (dr.repeat(v, nodes) for v in (z, c, k))
        p_over_c = z_ * dr.fma(k_, dr.cos(phi), 1)
        projection = (2 * z_ * (2 * p_over_c * z_ - 1), p_over_c, 2 * z_)[number]
        F = reflectance(S.repeat(nodes), p_over_c * c_)
        integrand = F * projection * (scale * dr.cosh(stretched * x) * stretched * weight)
        total += dr.block_sum(integrand, nodes)
    return 2 * total


def azimuth(cos_times_k, k):
    """Azimuth phi in 0..pi at which k cos(phi) = cos_times_k.

    If there is no such azimuth, the end of 0..pi that comes nearest.
    """
    return dr.acos(dr.clip(cos_times_k / dr.maximum(k, 1e-30), -1, 1))


def mean_transmittance(contrast, nk):
    """Hemispherical mean of 1 - F, int_0^1 (1 - F(c)) 2 c dc, with derivatives, in Float64."""
    Float = type(contrast)
    x, weight = unit_rule(MEAN_NODES)
    weight = GRAZING_KNEE * np.cosh(REACH * x) * REACH * weight
    x = GRAZING_KNEE * np.sinh(REACH * x)
    count = max(dr.width(contrast), dr.width(nk))
    lanes = [dr.repeat(v + dr.zeros(Float, count), MEAN_NODES) for v in (contrast, nk)]
    cos, weight = (tiled(Float, numbers, count) for numbers in (x, 2 * x * weight))
    return dr.block_sum(transmittance(cos, *lanes) * weight, MEAN_NODES)

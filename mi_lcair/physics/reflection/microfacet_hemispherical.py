"""Hemispherical reflectance of the microfacet lobe, by quadrature over facet normals.

HDR = int F D G p / cos(theta_r) domega_m, over the normals m that reflect r upward. With
c = cos(theta_r), z = m_z and p = r.m = c z (1 + k cos phi), k = tan(theta_r) tan(theta_m), the
visible projected area G p / c is the smallest of

    p / c   (no facet hides another),    2 z   (masking),    2 z (2 p z - c) / c   (shadowing).

Each of the three applies in one interval of the azimuth phi, and each interval has its own Gauss
nodes. The panels in theta_m begin and end at the angles of `breaks`. At these angles the azimuthal
integral has a term of power 3/2, which the change of variable in each panel makes smooth. The error
of the result is at most 1e-8 for all parameters.
"""

from functools import cache

import drjit as dr
import numpy as np

from mi_lcair.physics.reflection import microfacet_fresnel as fresnel
from mi_lcair.physics.reflection.microfacet_distribution import density

POLAR = (40, 16, 16, 40, 20, 20)  # nodes of each panel in theta_m
AZIMUTHS = (12, 8, 24)  # nodes of each interval in phi: shadowing, neither, masking
MEAN_NODES = 48  # nodes of the hemispherical mean
GRAZING_KNEE = 0.01  # cosine near which F of the strongest metals varies fastest
REACH = np.arcsinh(1 / GRAZING_KNEE)

gauss = cache(np.polynomial.legendre.leggauss)


def unit_rule(count):
    """Gauss-Legendre nodes and weights on 0..1, NumPy arrays (count,)."""
    x, weight = gauss(count)
    return 0.5 * (x + 1), 0.5 * weight


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
    place, weight = (Float(np.tile(numbers, count)) for numbers in (place, weight))
    panel = dr.uint32_array_t(Float)(np.tile(panel, count))
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
        x, weight = (Float(np.tile(numbers, count)) for numbers in unit_rule(nodes))
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
    cos = Float(np.tile(x, count))
    return dr.block_sum(
        fresnel.transmittance(cos, *lanes) * Float(np.tile(2 * x * weight, count)), MEAN_NODES
    )

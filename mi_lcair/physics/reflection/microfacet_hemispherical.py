"""Hemispherical reflectance of the microfacet lobe, by quadrature over facet normals.

HDR = int F D G p / cos(theta_r) domega_m over the normals m that reflect r upward. With
c = cos(theta_r), z = m_z and p = r.m = c z (1 + k cos phi), k = tan(theta_r) tan(theta_m), the
visible projection G p / c is the least of

    p / c   (no facet hides another),    2 z   (masking),    2 z (2 p z - c) / c   (shadowing).

These succeed each other in the azimuth phi, and each such stretch has Gauss nodes of its own. In
theta_m, stretches begin and end at the angles of `breaks`. There the azimuthal integral has a
term of power 3/2, which the map of each panel smooths. The result holds 1e-8 for all parameters.
"""

from functools import cache

import drjit as dr
import numpy as np

from mi_lcair.physics.reflection import microfacet_fresnel as fresnel
from mi_lcair.physics.reflection.microfacet_distribution import density

POLAR = (40, 16, 16, 40, 20, 20)  # nodes of each panel in theta_m
AZIMUTHS = (12, 8, 24)  # nodes of each stretch in phi: shadowing, none, masking
MEAN_NODES = 48  # of the hemispherical mean
GRAZING_KNEE = 0.01  # cosine around which F of the strongest metals varies
REACH = np.arcsinh(1 / GRAZING_KNEE)

gauss = cache(np.polynomial.legendre.leggauss)


def unit_rule(count):
    """Nodes and weights in 0..1."""
    x, weight = gauss(count)
    return 0.5 * (x + 1), 0.5 * weight


def lobe_reflectance(S, theta_r, reflectance):
    """HDR of the lobe at theta_r [rad], 0 <= theta_r < pi/2; Float64, derivatives attached to S.

    S: a surface, one for all angles (width 1) or one per angle. reflectance: of a facet, a function
    of S and p.
    """
    S_polar = S.repeat(sum(POLAR))
    theta, weight = polar_nodes(theta_r, dr.detach(S_polar.alpha))
    theta_r = dr.repeat(theta_r, sum(POLAR))
    dr.eval(theta, weight, theta_r)
    sin, cos = dr.sincos(theta)
    D = density(dr.square(sin), S_polar.peak, S_polar.spread, S_polar.gamma)
    seen = azimuthal_integral(S_polar, theta_r, theta, reflectance)
    return dr.block_sum(weight * sin * D * seen, sum(POLAR))


def breaks(theta_r):
    """The angles theta_m, ascending from 0, between which the azimuthal integral is smooth.

    Shadowing begins at (90 - theta_r) / 3. The horizon cuts from (90 - theta_r) / 2 to
    (90 + theta_r) / 2, where all ends. For theta_r above 45 degrees, masking reaches from
    90 - theta_r to theta_r, and every facet is partly hidden from 45 on. For smaller theta_r, every
    facet is from (90 + theta_r) / 3 on.
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
    """Angles theta_m and their weights, sum(POLAR) for each theta_r in a row, dense at the lobe's
    top and at the breaks.
    """
    Float = type(theta_r)
    count, nodes = dr.width(theta_r), sum(POLAR)
    x, weight = (np.concatenate(parts) for parts in zip(*map(unit_rule, POLAR)))
    panel = np.repeat(np.arange(len(POLAR)), POLAR)
    at_top = panel == 0  # smooth there: only the panel's end is a break
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
    """int F G p / c dphi over all azimuths that reflect upward; one value per lane."""
    Float = type(theta)
    sin, z = dr.sincos(theta)
    sin_r, c = dr.sincos(theta_r)
    tau2 = dr.square(sin / z)
    k = sin_r * sin / (c * z)
    lowest = azimuth(0.5 * (tau2 - 1), k)
    unhidden = tau2 < 1
    end_shadow = dr.select(
        unhidden, azimuth((3 * tau2 - 1) / (3 - dr.minimum(tau2, 1)), k), azimuth(tau2, k)
    )
    end_masking = dr.select(unhidden, azimuth(1, k), end_shadow)
    width = dr.clip(c * z / (sin_r * sin), 1e-3 * z / sin, 10)  # 1e-3: F varies no faster in p
    dr.eval(k, z, c, lowest, end_shadow, end_masking, width)
    count = dr.width(theta)
    total = 0
    stretches = ((lowest, end_shadow), (end_shadow, end_masking), (end_masking, 0))
    for number, (nodes, (start, end)) in enumerate(zip(AZIMUTHS, stretches)):
        x, weight = (Float(np.tile(numbers, count)) for numbers in unit_rule(nodes))
        length, scale, first = (
            dr.repeat(v + dr.zeros(Float, count), nodes) for v in (start - end, width, start)
        )
        stretched = dr.asinh(length / scale)  # dense at the start, where p and so F vary fastest
        phi = first - scale * dr.sinh(stretched * x)
        z_, c_, k_ = (dr.repeat(v, nodes) for v in (z, c, k))
        p_over_c = z_ * dr.fma(k_, dr.cos(phi), 1)
        projection = (2 * z_ * (2 * p_over_c * z_ - 1), p_over_c, 2 * z_)[number]
        F = reflectance(S.repeat(nodes), p_over_c * c_)
        integrand = F * projection * (scale * dr.cosh(stretched * x) * stretched * weight)
        total += dr.block_sum(integrand, nodes)
    return 2 * total


def azimuth(cos_times_k, k):
    """The azimuth of which k cos(phi) has this value, 0..pi; the nearest where there is none."""
    return dr.acos(dr.clip(cos_times_k / dr.maximum(k, 1e-30), -1, 1))


def mean_transmittance(contrast, nk):
    """int_0^1 (1 - F(c)) 2 c dc, the hemispherical mean of 1 - F; Float64, derivatives attached."""
    Float = type(contrast)
    x, weight = unit_rule(MEAN_NODES)
    x, weight = (
        GRAZING_KNEE * np.sinh(REACH * x),
        GRAZING_KNEE * np.cosh(REACH * x) * REACH * weight,
    )
    count = max(dr.width(contrast), dr.width(nk))
    lanes = [dr.repeat(v + dr.zeros(Float, count), MEAN_NODES) for v in (contrast, nk)]
    cos = Float(np.tile(x, count))
    return dr.block_sum(
        fresnel.transmittance(cos, *lanes) * Float(np.tile(2 * x * weight, count)), MEAN_NODES
    )

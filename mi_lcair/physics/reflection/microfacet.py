"""The microfacet model: generalised Trowbridge-Reitz facets with Fresnel reflection and a floor.

With c_i, c_r the cosines of source and observer, m = (i + r) / |i + r| the half-vector, m_z its
cosine and p = i.m = r.m,

    f(i, r) = F(p) D(m) G(i, r) / (4 c_i c_r) + rho_d / pi (1 - F(c_i)) (1 - F(c_r))
    D(m) = D_0 / (1 + w sin^2 theta_m)^gamma
    F = unpolarised Fresnel reflectance of n + ik
    G = min(1, 2 m_z c_i / p, 2 m_z c_r / p)

G is the masking and shadowing of facets that form V-shaped cavities. It is exact for every D: the
visible facets fill the projected area of the surface (Heitz 2014, section 5.2). It needs no
integral of D and is symmetric. Therefore, for all parameters, the lobe conserves energy, f is
reciprocal, and the visible normals can be sampled exactly.

Smith's masking assumes facets without correlation. It needs a different integral for each D. Its
height-correlated form, integrated numerically, was compared with this one on six measured infrared
BRDFs (gamma up to 4 allowed). It describes five of them worse, by 2 to 9 % of the rms deviation,
and the sixth by 0.4 % better. Smith's masking for gamma = 2 must not be combined with another D:
with gamma = 1.24 the surface reflects 1.9 times the incident radiation at 88 degrees.

The model omits radiation that facets reflect to each other. The table gives the share of the
incident radiation that a perfect reflector (F = 1) loses thereby at the worst angle of incidence. A
star marks surfaces whose worst angle is 0 degrees.

    alpha   gamma = 0.5     1       1.5     2       3       4
    0.001   0.39 *          0.07 *  0.05    0.05    0.04    0.03
    0.01    0.39 *          0.11 *  0.05    0.05    0.06    0.06
    0.1     0.43 *          0.21 *  0.07 *  0.06    0.06    0.06
    0.2     0.46 *          0.29 *  0.15 *  0.07    0.06    0.06
    0.3     0.49 *          0.35 *  0.23 *  0.14 *  0.07    0.07
    0.5     0.54 *          0.46 *  0.38 *  0.30 *  0.18 *  0.11
    0.7     0.58 *          0.54 *  0.50 *  0.45 *  0.37 *  0.30 *
    1       0.62 *          0.62 *  0.62 *  0.62 *  0.62 *  0.62 *

The loss appears as absorption. A fit of a rough metal with a low emissivity therefore needs the
floor, which makes up for it.

Sources: K. E. Torrance and E. M. Sparrow, J. Opt. Soc. Am. 57, 1105, 1967; R. L. Cook and
K. E. Torrance, ACM Trans. Graph. 1, 7, 1982; B. Walter et al., Microfacet models for refraction
through rough surfaces, EGSR 2007; B. Burley, Physically based shading at Disney, SIGGRAPH course
2012; E. Heitz, Understanding the masking-shadowing function, JCGT 3(2), 2014; E. Heitz and
E. d'Eon, Importance sampling microfacet-based BSDFs using the distribution of visible normals,
EGSR 2014; M. Ribardiere et al., STD: Student's t-distribution of slopes, Comput. Graph. Forum 36,
2017 (the shape parameter gamma).
"""

from dataclasses import dataclass
from math import log
from typing import Any

import drjit as dr
import numpy as np
from drjit.llvm.ad import Float64

from mi_lcair.physics.reflection import interface, microfacet_equations
from mi_lcair.physics.reflection.interface import (
    SMALLEST,
    ReflectionModel,
    Restriction,
    bundled_parameters,
    cos_theta,
)

# The parameters of the microfacet model, mapped to the unit cube on which searches run
# -------------------------------------------------------------------------------------
# The coordinates of alpha, gamma and n are linear in their logarithms between the bounds. That of
# rho_d is rho_d itself. k enters the BRDF as k^2 only. With k as a coordinate, the face k = 0
# (dielectrics) would be stationary for all data. The coordinate u of k is therefore defined by
# k^2 = K^2 (exp(L u) - 1), where L is chosen such that u = 1 is the upper bound.

KNEE2 = 0.01  # K^2: the coordinate of k is linear in k^2 below it and in log k above it
SMALLEST_K2 = 1e-24  # added to k^2, so that the derivative of its root is finite at k = 0
# Relative excess over a bound that is accepted, for parameters that were rounded to Float32.
ROUNDING = 1e-6

PARAMETERS = bundled_parameters("microfacet")
LOWER, UPPER = (
    np.array(bounds, dtype=float) for bounds in zip(*((p.lower, p.upper) for p in PARAMETERS))
)
K2_RANGE = float(np.log1p(UPPER[3] ** 2 / KNEE2))


class MicrofacetCube(ReflectionModel):
    """The microfacet model's parameters and search coordinates."""

    name = "microfacet"
    title = "Microfacet"
    parameters = PARAMETERS
    rounding = ROUNDING

    def from_cube(self, u) -> tuple:
        alpha, gamma, n = (
            p.lower * dr.exp(place * log(p.upper / p.lower)) for p, place in zip(PARAMETERS, u[:3])
        )
        k2 = KNEE2 * (dr.exp(K2_RANGE * u[3]) - 1)
        return alpha, gamma, n, dr.sqrt(k2 + SMALLEST_K2), u[4]

    def to_cube(self, values) -> np.ndarray:
        values = np.clip(np.asarray(values, dtype=float), LOWER, UPPER)
        u = values.copy()
        for number in range(3):
            low, high = LOWER[number], UPPER[number]
            u[..., number] = np.log(values[..., number] / low) / np.log(high / low)
        u[..., 3] = np.log1p(values[..., 3] ** 2 / KNEE2) / K2_RANGE
        return np.clip(u, 0, 1)

    def starting_points(self, count: int, seed: int) -> np.ndarray:
        """Random points (count, 5) of the cube; the same seed gives the same points.

        Real surfaces have lobes of width 0.001..1, exponents 0.7..3 and refractive indices 1.2..12.
        Half of the points are metals with k of 1..50. The floor's reflectance is spread evenly in
        its logarithm over 1e-4..1.
        """
        from scipy.stats import qmc  # takes a second to import, and only searches need it

        u = qmc.LatinHypercube(5, rng=np.random.default_rng(seed)).random(count)

        def decades(low, high, place):
            return low * (high / low) ** place

        k = np.where(u[:, 3] < 0.5, decades(1e-3, 1, 2 * u[:, 3]), decades(1, 50, 2 * u[:, 3] - 1))
        alpha, gamma, n = (
            decades(low, high, place)
            for (low, high), place in zip(((1e-3, 1), (0.7, 3), (1.2, 12)), u.T)
        )
        return self.to_cube(np.column_stack([alpha, gamma, n, k, decades(1e-4, 1, u[:, 4])]))


MicrofacetCube.restrictions = (
    Restriction("rho_d = 0", 4),
    Restriction("gamma = 2", 1, float(np.log(2 / LOWER[1]) / np.log(UPPER[1] / LOWER[1]))),
    Restriction("k = 0", 3),
)

NEGLIGIBLE = 1e-6  # largest n - 1 and k of facets that reflect nothing
WORTH_A_REMARK = 0.05  # share of the radiation lost between facets above which the user is told


@dataclass
class MicrofacetSurface(interface.Surface):
    """The five parameters of a surface and the numbers in which they enter the equations.

    All fields are Dr.Jit floats of one type.

    Attributes
    ----------
    alpha, gamma, n, k, rho_d
        The parameters.
    peak, spread
        D_0 [1/sr] and w of the distribution of normals.
    contrast, nk
        n^2 - 1 - k^2 and n k of Fresnel's equations.
    refracted
        Hemispherical mean of 1 - F.
    tilt
        Typical sine of the facets' angles to the surface, for `lobe_scale`.
    q, inverse_exponent
        Numbers for sampling normals; see `microfacet_equations.quantile_terms`.
    """

    alpha: Any
    gamma: Any
    n: Any
    k: Any
    rho_d: Any
    peak: Any
    spread: Any
    contrast: Any
    nk: Any
    refracted: Any
    tilt: Any
    q: Any
    inverse_exponent: Any


class MicrofacetModel(MicrofacetCube):
    """The microfacet model; the module's docstring gives its equations."""

    def surface(self, alpha, gamma, n, k, rho_d, form: str = "standard") -> MicrofacetSurface:
        """The `Surface` with these parameters, Dr.Jit Float64 arrays.

        Use `Surface.cast` for another float type: Float64 is needed to derive the numbers.
        """
        spread = microfacet_equations.spread(alpha)
        contrast = (n - 1) * (n + 1) - dr.square(k)
        q, inverse_exponent = microfacet_equations.quantile_terms(gamma, spread)
        return MicrofacetSurface(
            alpha,
            gamma,
            n,
            k,
            rho_d,
            peak=microfacet_equations.peak(alpha, gamma),
            spread=spread,
            contrast=contrast,
            nk=n * k,
            refracted=microfacet_equations.mean_transmittance(contrast, n * k),
            tilt=dr.detach(alpha + microfacet_equations.mean_sin2(alpha, gamma)),
            q=q,
            inverse_exponent=inverse_exponent,
        )

    # ------------------------------------------------------------------ Reflectance

    def f(self, S, i, r):
        above = (i.z > 0) & (r.z > 0)
        c_i, c_r = cos_theta(i), cos_theta(r)
        sin2, p2 = microfacet_equations.half_vector(i, r)
        D = microfacet_equations.density(sin2, S.peak, S.spread, S.gamma)
        F = microfacet_equations.reflectance(dr.sqrt(p2), S.contrast, S.nk)
        lobe = 0.25 * F * D * microfacet_equations.visibility(c_i, c_r, p2)
        refracted = [microfacet_equations.transmittance(c, S.contrast, S.nk) for c in (c_i, c_r)]
        floor = dr.inv_pi * S.rho_d * (refracted[0] * refracted[1])
        return dr.select(above, lobe + floor, 0)

    def HDR(self, S, theta_r):
        sin, cos = dr.sincos(theta_r)
        lobe = microfacet_equations.lobe_reflectance(S, theta_r, facet_reflectance)
        return self.floor_HDR(S, cos, dr.square(sin)) + lobe

    def DHR(self, S, theta_i):
        return self.HDR(S, theta_i)

    def floor_HDR(self, S, cos, sin2):
        return S.rho_d * S.refracted * microfacet_equations.transmittance(cos, S.contrast, S.nk)

    def lobe_HDR(self, S, theta_r):
        sin, cos = dr.sincos(theta_r)
        lobe = microfacet_equations.lobe_reflectance(S, theta_r, facet_reflectance)
        return lobe / dr.maximum(self.lobe_scale(S, cos, dr.square(sin)), SMALLEST)

    def lobe_scale(self, S, cos, sin2):
        """Fresnel reflectance of a typical facet.

        At grazing angles the lobe's HDR is proportional to it. A table of the ratio at 1024 even
        values of sqrt(cos) has an error of at most 5e-6 up to 89.5 degrees. The same table of the
        lobe's HDR itself has an error of 1.2e-5, for strong metals near their Brewster angle.
        """
        p = 0.5 * (cos + dr.sqrt(dr.square(cos) + dr.square(S.tilt) * sin2))
        return microfacet_equations.reflectance(p, S.contrast, S.nk)

    # ------------------------------------------------------------------ Drawing directions

    def sample_lobe(self, S, r, u1, u2, u3):
        """Reflect r about the normal of a random facet that is visible from r.

        `lobe_pdf` is the density of the result.
        """
        # Elevation and azimuth of the normal of a facet, visible or not.
        sin2 = microfacet_equations.sample_sin2(u2, S.spread, S.q, S.inverse_exponent)
        sin, cos = dr.sqrt(sin2), dr.sqrt(1 - sin2)
        sin_phi, cos_phi = dr.sincos(dr.two_pi * u1)
        # The facet and its mirror image across the normal are the two sides of a V-shaped cavity.
        # Each is visible in proportion to its projected area, r.z cos + across or r.z cos - across.
        across = sin * dr.fma(r.x, cos_phi, r.y * sin_phi)
        sin = dr.select((2 * u3 - 1) * (r.z * cos) < across, sin, -sin)
        m = type(r)(sin * cos_phi, sin * sin_phi, cos)
        return dr.fma(m, 2 * dr.dot(r, m), -r)

    def lobe_pdf(self, S, i, r):
        """G_1(r) D / (4 c_r), with G_1 = min(1, 2 m_z c_r / p) [1/sr]."""
        sin2, p2 = microfacet_equations.half_vector(i, r)
        D = microfacet_equations.density(sin2, S.peak, S.spread, S.gamma)
        m_z_over_p = dr.maximum(i.z + r.z, 0) / dr.maximum(2 * p2, SMALLEST)
        return 0.25 * D * dr.minimum(1 / dr.maximum(cos_theta(r), SMALLEST), 2 * m_z_over_p)

    def lobe_width(self, S):
        """Width of the lobe as the interface defines it, but at most 1.

        It is 1 also if D does not fall to a quarter at any angle.
        """
        return microfacet_equations.width(S.gamma, S.spread)

    # ------------------------------------------------------------------ Remarks

    def remarks(self, *values: float, form: str = "standard") -> list[str]:
        _, _, n, k, _ = values
        if n - 1 <= NEGLIGIBLE and k <= NEGLIGIBLE:  # F = 0: facets reflect nothing
            return []
        S = self.surface_of(values, form)
        lost = 1 - microfacet_equations.lobe_reflectance(S, Float64(0), lambda S, p: Float64(1))[0]
        if lost <= WORTH_A_REMARK:
            return []
        return [
            f"{lost:.0%} of the radiation that facets reflect at normal incidence hits other "
            "facets; the model leaves it out"
        ]


def facet_reflectance(S, p):
    """Fresnel reflectance F of a facet at the cosine p."""
    return microfacet_equations.reflectance(p, S.contrast, S.nk)


MODEL = MicrofacetModel()

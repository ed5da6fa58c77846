"""The equations of the Sandford-Robertson reflection model (thesis 2.3.4, Eqs 2.14-2.26).

Directions are unit 3-vectors in the surface's frame, whose z axis is the normal. `i` points to the
source and `r` to the observer. The model is not reciprocal, f(i, r) != f(r, i), so the order
matters. In all functions, cos and sin2 are cosine and squared sine of a direction's angle to the
normal.

Every function accepts Dr.Jit arrays of any float type and keeps derivatives. None needs Mitsuba.
Squared sines are computed from x and y and never as 1 - cos^2. At e = 0.0042 the latter has no
correct digit in Float32.
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr

from mi_lcair.declared import Bounds
from mi_lcair.errors import InputError
from mi_lcair.physics.reflection import interface
from mi_lcair.physics.reflection.interface import SMALLEST, cos_theta, sin2_theta, tiled, unit_rule

FORMS = ("thesis", "normalized")
FEASIBLE = {
    "epsilon": Bounds(lower=0),
    "rho_d": Bounds(lower=0),
    "b": Bounds(lower=0, upper=1),
    "e": Bounds(is_positive=True, upper=1),
}


@dataclass
class SandfordRobertsonSurface(interface.Surface):
    """The four parameters of a surface and the combinations in which they enter the BRDF.

    `floor` = rho_d / G^2 (Eq 2.15). `absorbed` = (epsilon + rho_d) / G and
    `slack` = (G - epsilon - rho_d) / G give the specular reflectance without cancellation,
    rho_s = slack + absorbed (1 - g). Near the bound epsilon + rho_d = G, the textbook form
    1 - rho_d(theta) - epsilon(theta) loses every digit in Float32. All fields but `form` are
    dimensionless Dr.Jit floats of one type.
    """

    epsilon: Any
    rho_d: Any
    b: Any
    e: Any
    floor: Any
    absorbed: Any
    slack: Any
    G: Any
    form: str = "thesis"


def surface(epsilon, rho_d, b, e, form: str = "thesis") -> SandfordRobertsonSurface:
    """The `Surface` with these parameters.

    The parameters should be Float64 arrays; `Surface.cast` gives another float type. form: see `f`.
    """
    G_b = G(b)
    slack = (G_b - epsilon - rho_d) / G_b
    # Parameters that were rounded to Float32 may exceed G by the rounding. slack is then 0.
    slack += dr.maximum(-dr.detach(slack), 0)
    return SandfordRobertsonSurface(
        epsilon,
        rho_d,
        b,
        e,
        floor=rho_d / dr.square(G_b),
        absorbed=(epsilon + rho_d) / G_b,
        slack=slack,
        G=G_b,
        form=form,
    )


def check_feasible(epsilon: float, rho_d: float, b: float, e: float, form: str = "thesis") -> None:
    """Raise InputError for parameters that no surface can have.

    The bounds are 0 <= epsilon, 0 <= rho_d, epsilon + rho_d <= G(b), 0 <= b <= 1 and 0 < e <= 1.
    Parameters that were rounded to Float32 may exceed G(b) by the rounding.
    """
    for (name, bounds), value in zip(FEASIBLE.items(), (epsilon, rho_d, b, e)):
        bounds.check(value, f"sandford_robertson: {name}")
    bound = G(dr.scalar.ArrayXf64(b))[0]
    if not epsilon + rho_d <= bound + 1e-7:
        raise InputError(
            f"sandford_robertson: epsilon + rho_d = {epsilon + rho_d:g}; must be at most "
            f"G(b) = {bound:.6g} for b = {b:g}"
        )


def G(b):
    """G(b) = 2 int_0^(pi/2) g cos sin dtheta, Eq 2.18.

    The removable limits are 1 at b = 0 and 1/2 at b = 1.
    """
    x = dr.maximum(dr.square(b), SMALLEST)
    u = 1 - x
    series = 0  # sum over n >= 2 of u^(n-2) / (n (n-1)), with an error of 1e-16 for u < 0.1
    for n in range(18, 1, -1):
        series = series * u + 1 / (n * (n - 1))
    far = u > 0.1
    u_far = dr.select(far, u, 0.5)
    return dr.select(far, (u + x * dr.log(x)) / dr.square(u_far), series)


def falloff(cos, sin2, b):
    """1 / (cos^2 + b^2 sin^2), a common factor of g, 1 - g and d / cos.

    Computing it once saves divisions.
    """
    return dr.rcp(dr.maximum(dr.fma(dr.square(b), sin2, dr.square(cos)), SMALLEST))


def g(cos, sin2, b):
    """g(theta) = 1 / (1 + b^2 tan^2 theta), Eqs 2.16, 2.17 and d(theta), Eq 2.24."""
    return dr.square(cos) * falloff(cos, sin2, b)


def one_minus_g(cos, sin2, b):
    """1 - g(theta), computed without cancellation."""
    return dr.square(b) * sin2 * falloff(cos, sin2, b)


def rho_s(S: SandfordRobertsonSurface, cos, sin2):
    """Specular reflectance rho_s(theta_i) = 1 - rho_d(theta_i) - epsilon(theta_i), Eq 2.20."""
    return S.slack + S.absorbed * one_minus_g(cos, sin2, S.b)


def emissivity(S: SandfordRobertsonSurface, cos, sin2):
    """The model's own directional emissivity epsilon g(theta) / G(b), Eq 2.21."""
    return S.epsilon / S.G * g(cos, sin2, S.b)


def sin2_alpha(i, r):
    """Squared sine of alpha, the angle between half-vector and normal (Eqs 2.25, 2.26)."""
    x, y, z = i.x + r.x, i.y + r.y, i.z + r.z
    xy = dr.square(x) + dr.square(y)
    return xy / dr.maximum(xy + dr.square(z), SMALLEST)


def h(sin2_alpha, e):
    """Shape of the lobe, h(alpha) = 1 / (e^2 cos^2 alpha + sin^2 alpha)^2, Eq 2.22.

    It is pi D / e^2 with the distribution D of Trowbridge and Reitz.
    """
    # The reciprocal is squared, not the square inverted: the derivative of 1 / x^2 contains 1 /
    # x^4, which overflows Float32 for e below 1.5e-5.
    return dr.square(1 / dr.fma(dr.square(e), 1 - sin2_alpha, sin2_alpha))


def e2_H(cos_i, e):
    """e^2 H(theta_i), where H(theta_i) = (1/4 pi) int h(alpha) domega_r, Eq 2.23.

    The factor e^2 cancels the leading 1/(2 e^2) of Eq 2.23, which is very large for a narrow lobe.
    """
    e2 = dr.square(e)
    c = (1 - e2) * cos_i
    c2 = dr.square(c)
    return 0.5 * (c + (2 * e2 + c2) * dr.rsqrt(c2 + 4 * e2))


def observer_factor(S: SandfordRobertsonSurface, cos, sin2):
    """d(theta_r) / cos(theta_r) of Eq 2.19; 1 / cos(theta_r) in the normalized form.

    The first is computed without a division by the cosine, which vanishes at grazing angles.
    """
    if S.form == "normalized":
        return 1 / dr.maximum(cos, SMALLEST)
    return cos * falloff(cos, sin2, S.b)


def f_d(S: SandfordRobertsonSurface, i, r):
    """Diffuse floor, Eq 2.15 [1/sr]."""
    g_i = g(cos_theta(i), sin2_theta(i), S.b)
    g_r = g(cos_theta(r), sin2_theta(r), S.b)
    return S.floor * g_i * g_r * dr.inv_pi


def f_s(S: SandfordRobertsonSurface, i, r):
    """Specular lobe, Eq 2.19 [1/sr]."""
    cos_i = cos_theta(i)
    lobe = dr.square(S.e) * h(sin2_alpha(i, r), S.e) / e2_H(cos_i, S.e)
    reflectance = (0.25 * dr.inv_pi) * rho_s(S, cos_i, sin2_theta(i))
    return reflectance * lobe * observer_factor(S, cos_theta(r), sin2_theta(r))


def f(S: SandfordRobertsonSurface, i, r):
    """BRDF f_r(i, r), Eq 2.14 [1/sr]; 0 unless both directions lie above the surface.

    The form "thesis" has the factor d(theta_r) of Eq 2.19, by which the surface loses energy toward
    grazing angles. The form "normalized" has no such factor, so that DHR(theta_i) =
    1 - epsilon(theta_i) exactly.
    """
    above = (i.z > 0) & (r.z > 0)
    return dr.select(above, f_d(S, i, r) + f_s(S, i, r), 0)


def sample_half_vector(w, e, u1, u2):
    """A random microfacet normal among those visible from the direction w (z > 0).

    The normals have the Trowbridge-Reitz distribution with the width e. u1, u2: uniform random
    numbers in 0..1. The method stretches w, samples a spherical cap, and stretches back (Dupuy and
    Benyoub, HPG 2023, with alpha = e). The reflection of w about the normal has the density
    `lobe_pdf`.
    """
    Vector = type(w)
    stretched = dr.normalize(Vector(e * w.x, e * w.y, w.z))
    phi = dr.two_pi * u1
    z = dr.fma(1 - u2, 1 + stretched.z, -stretched.z)
    radius = dr.safe_sqrt(1 - dr.square(z))
    sin_phi, cos_phi = dr.sincos(phi)
    half = Vector(radius * cos_phi, radius * sin_phi, z) + stretched
    return dr.normalize(Vector(e * half.x, e * half.y, dr.maximum(half.z, 0)))


def lobe_pdf(i, r, e):
    """Density [1/sr] of the direction i, the reflection of r about `sample_half_vector(r, ...)`.

    It is G1(r) D / (4 cos theta_r)
    = e^2 h(alpha) / (2 pi (cos theta_r + sqrt(cos^2 theta_r + e^2 sin^2 theta_r))).
    """
    cos = cos_theta(r)
    e2 = dr.square(e)
    slope = cos + dr.sqrt(dr.square(cos) + e2 * sin2_theta(r))
    return e2 * h(sin2_alpha(i, r), e) / (dr.two_pi * slope)


# Hemispherical reflectances of the Sandford-Robertson model, by one-dimensional quadrature
# -----------------------------------------------------------------------------------------
# The azimuthal integral of the lobe is known in closed form, so that HDR and DHR are integrals over
# one elevation angle. The integrand has a peak of width about 2e at the other elevation angle, and
# a knee of width b or e near the horizon. Three panels of Gauss-Legendre nodes, dense at the peak
# and at the horizon, resolve both with an error of 1e-10 in Float64.

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
    x, weights = (tiled(Float, numbers, dr.width(peak)) for numbers in unit_rule(NODES))
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

"""Rejection sampling under a bound on the BRDF (thesis 3.3.2, which describes it but rejects it).

Directions are uniform over the hemisphere. Each has a height that is uniform between 0 and the
bound. A sample is accepted if its height is below f_r cos(theta_r). The share of accepted samples
is the integral divided by 2 pi times the bound. Few samples are accepted, because the peak is tall
and narrow.
"""

import drjit as dr
from drjit.llvm import Array3f64, Float64

from benchmarks.methods.reflectance.method import RANDOM_EFFORTS, ReflectanceMethod, mean
from mi_lcair.physics.reflection import sandford_robertson_equations as sr
from mi_lcair.physics.reflection.interface import cos_theta, sin2_theta


def run(problem, samples, repetitions, seed):
    """Return `repetitions` estimates of the DHR, each from `samples` directions."""
    rng = dr.rng(seed)
    u_z, u_phi, u_height = (rng.random(Float64, samples * repetitions) for _ in range(3))
    sin_phi, cos_phi = dr.sincos(dr.two_pi * u_phi)
    radius = dr.safe_sqrt(1 - dr.square(u_z))
    r = Array3f64(radius * cos_phi, radius * sin_phi, u_z)
    top = bound(problem)
    accepted = u_height * top < problem.integrand(problem.incident(), r)
    return dr.two_pi * top * mean(dr.select(accepted, Float64(1), 0), samples)


def bound(problem):
    """Return an upper bound of f_r cos(theta_r) [1/sr].

    It follows from g <= 1, d(theta_r) <= 1, h(alpha) <= h(0) and cos(theta_r) <= 1.
    """
    S, i = problem.surface, problem.incident()
    cos, sin2 = cos_theta(i), sin2_theta(i)
    floor = S.floor * sr.g(cos, sin2, S.b) * dr.inv_pi
    return floor + 0.25 * dr.inv_pi * sr.rho_s(S, cos, sin2) * dr.square(S.e) * sr.h(
        Float64(0), S.e
    ) / sr.e2_H(cos, S.e)


method = ReflectanceMethod("rejection sampling", "3.3.2", RANDOM_EFFORTS, run)

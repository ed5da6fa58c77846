"""Importance sampling of the lobe and the floor, as in the renderer (not in the thesis).

The lobe is a Trowbridge-Reitz distribution, so half-vectors are drawn from it exactly. They are
mixed with cosine-distributed directions for the floor. The renderer's BSDF does the same, but it
fixes r and draws i. A DHR fixes i and integrates over r, and the model is not reciprocal. Here the
half-vectors are therefore those visible from i, and the density is that of r. The lobe is chosen
with probability rho_s / (rho_s + rho_d) at theta_i (Eqs 2.15, 2.20). These two are closed forms, so
that the integral need not be known in advance.
"""

import drjit as dr
from drjit.llvm import Array3f64, Float64

from benchmarks.methods.reflectance.method import ReflectanceMethod, mean
from mi_lcair.physics.reflection import sandford_robertson_equations as sr
from mi_lcair.physics.reflection.interface import SMALLEST, cos_theta, sample_cosine, sin2_theta


def run(problem, samples, repetitions, seed):
    """Return `repetitions` estimates of the DHR, each from `samples` directions."""
    rng = dr.rng(seed)
    return mean(
        weights(problem, *(rng.random(Float64, samples * repetitions) for _ in range(3))), samples
    )


def weights(problem, u_choice, u1, u2):
    """Return f_r cos(theta_r) / density of directions r that are drawn from the mixture.

    u_choice, u1, u2: uniform random numbers; the first chooses between lobe and floor.
    """
    S, i = problem.surface, problem.incident()
    cos_i, sin2_i = cos_theta(i), sin2_theta(i)
    lobe, floor = sr.rho_s(S, cos_i, sin2_i), S.rho_d / S.G * sr.g(cos_i, sin2_i, S.b)
    p = dr.select(lobe + floor > 0, lobe / dr.maximum(lobe + floor, SMALLEST), 1)
    half = sr.sample_half_vector(i, S.e, u1, u2)
    r = dr.select(u_choice < p, 2 * dr.dot(i, half) * half - i, sample_cosine(Array3f64, u1, u2))
    density = dr.lerp(dr.inv_pi * cos_theta(r), sr.lobe_pdf(r, i, S.e), p)
    return dr.select(r.z > 0, problem.integrand(i, r) / density, 0)


EFFORTS = (1, 4, 16, 64, 128, 256, 1024, 4096, 16384, 65536)
method = ReflectanceMethod("half-vector sampling (ours)", "", EFFORTS, run)

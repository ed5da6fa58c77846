"""Ours: half-vectors drawn from the lobe itself, which is a Trowbridge-Reitz distribution, in a
mixture with the cosine.

The renderer's BSDF does the same; there r is fixed and i is drawn. A DHR fixes i and integrates
over r, and the model is not reciprocal: the half-vectors are those visible from i, the density is
that of r. The lobe is chosen with probability rho_s / (rho_s + rho_d) at theta_i (Eqs 2.15, 2.20),
closed forms that know nothing of the integral sought.
"""

import drjit as dr
from drjit.llvm import Array3f64, Float64

from mi_lcair.benchmark.reflectance.method import Method, mean
from mi_lcair.physics.reflection import sandford_robertson_equations as sr
from mi_lcair.physics.reflection.directions import SMALLEST, cos_theta, sample_cosine, sin2_theta


def run(problem, samples, repetitions, seed):
    rng = dr.rng(seed)
    return mean(
        weights(problem, *(rng.random(Float64, samples * repetitions) for _ in range(3))), samples
    )


def weights(problem, u_choice, u1, u2):
    """f_r cos(theta_r) / density of directions r drawn from the mixture with three uniform numbers
    each.
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
method = Method("half-vector sampling (ours)", "", EFFORTS, lambda n: n, run)

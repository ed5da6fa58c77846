"""Numerical quadrature with equal numbers of samples in theta and phi (thesis 2.5.1, 3.3).

See its Figure 3.15. The hemisphere is divided into rectangles in theta_r and phi_r. The integrand
is evaluated at their middles. With corners the convergence would be one order slower.
"""

import drjit as dr
from drjit.llvm import Float64

from benchmarks.methods.reflectance.method import ReflectanceMethod, grid, lanes, mean
from benchmarks.methods.reflectance.problem import direction


def run(problem, N, repetitions, seed):
    """Return `repetitions` estimates of the DHR, each from N x N samples.

    The error depends on where the peak lies between the samples. Each repetition therefore has a
    random plane of incidence.
    """
    repetition, sample = lanes(N * N, repetitions)
    azimuth = dr.two_pi * dr.rng(seed).random(Float64, repetitions)
    u_theta, u_phi = grid(sample, N, N)
    theta = 0.5 * dr.pi * u_theta
    r = direction(theta, dr.two_pi * u_phi)
    f_cos = problem.integrand(problem.incident(dr.gather(Float64, azimuth, repetition)), r)
    return dr.square(dr.pi) * mean(f_cos * dr.sin(theta), N * N)


method = ReflectanceMethod(
    "uniform quadrature", "3.3", (25, 50, 100, 200, 300, 400, 500, 700, 1000), run, lambda N: N * N
)

"""Monte Carlo with uniform samples in the peak region and in the rest (thesis 3.3.2.2).

See its Figure 3.18. The numbers of samples are in the same ratio as in the stratified quadrature,
80^2 : 50^2.
"""

import drjit as dr
from drjit.llvm import Float64

from benchmarks.methods.reflectance.method import RANDOM_EFFORTS, ReflectanceMethod, mean
from benchmarks.methods.reflectance.regions import (
    PEAK_SHARE,
    REST_PER_PEAK,
    in_peak,
    in_rest,
    strip_share,
)


def run(problem, samples, repetitions, seed):
    """Return `repetitions` estimates of the DHR, each from `samples` directions."""
    rng = dr.rng(seed)
    i, in_peak_region = problem.incident(), round(samples / (1 + REST_PER_PEAK**2))
    total = 0
    for count, region, shares in (
        (in_peak_region, in_peak, ()),
        (samples - in_peak_region, in_rest, (PEAK_SHARE, strip_share(problem))),
    ):
        u_theta, u_phi = (rng.random(Float64, count * repetitions) for _ in range(2))
        r, weight = region(problem, u_theta, u_phi, *shares)
        total += mean(problem.integrand(i, r) * weight, count)
    return total


method = ReflectanceMethod("Monte Carlo, stratified", "3.3.2.2", RANDOM_EFFORTS, run)

"""Monte Carlo with normally distributed angles about the specular direction (thesis 3.3.2.1).

The thesis (its Figure 3.17) states neither the widths of the two normal distributions nor what is
done with samples beyond the hemisphere. This file assumes the best case. Both distributions are
truncated at the edge of the hemisphere, so that no sample is lost. Their widths in theta and phi
are those of least variance for each surface and angle. The search for these widths is not included
in the time.
"""

from functools import cache, partial

import drjit as dr
import numpy as np
from drjit.llvm import Float64
from scipy.optimize import minimize
from scipy.special import erf

from benchmarks.methods.reflectance.method import RANDOM_EFFORTS, ReflectanceMethod, mean
from benchmarks.methods.reflectance.problem import direction

NODES = 400  # nodes per angle of the quadrature for the variance; they are dense near the peak


def run(problem, samples, repetitions, seed):
    """Return `repetitions` estimates of the DHR, each from `samples` directions."""
    width_theta, width_phi = (dr.opaque(Float64, width) for width in best_widths(problem))
    rng = dr.rng(seed)
    theta, p_theta = truncated_normal(
        rng.random(Float64, samples * repetitions), problem.theta_i, width_theta, 0, 0.5 * dr.pi
    )
    phi, p_phi = truncated_normal(
        rng.random(Float64, samples * repetitions), dr.pi, width_phi, 0, dr.two_pi
    )
    f_cos = problem.integrand(problem.incident(), direction(theta, phi))
    return mean(f_cos * dr.sin(theta) / (p_theta * p_phi), samples)


def truncated_normal(u, center, width, low, high):
    """Return a normal variate truncated at `low` and `high`, and its density.

    u: uniform random number; the variate is the inverse of the cumulative distribution at u.
    """
    scale = 1 / (dr.sqrt(2) * width)
    cdf_low, cdf_high = dr.erf((low - center) * scale), dr.erf((high - center) * scale)
    x = center + dr.erfinv(dr.lerp(cdf_low, cdf_high, u)) / scale
    bell = 2 * scale * dr.rsqrt(dr.pi) * dr.exp(-dr.square((x - center) * scale))
    return dr.clip(x, low, high), bell / (cdf_high - cdf_low)


@cache
def best_widths(problem) -> tuple[float, float]:
    """Return the standard deviations in theta and phi of least variance [rad] (thesis Eq 2.32)."""
    center, crowding = problem.theta_i[0], 2 * problem.surface.e[0]
    theta, w_theta = crowded(center, crowding, 0, 0.5 * np.pi)
    phi, w_phi = crowded(np.pi, crowding, 0, 2 * np.pi)
    r = direction(Float64(np.repeat(theta, NODES)), Float64(np.tile(phi, NODES)))
    f_cos = problem.integrand(problem.incident(), r).numpy().reshape(NODES, NODES)
    squares = (f_cos * np.sin(theta)[:, None]) ** 2 * w_theta[:, None] * w_phi

    def log_second_moment(log_widths):
        width_theta, width_phi = np.exp(log_widths)
        return np.log(
            inverse_density(theta, center, width_theta, 0, 0.5 * np.pi)
            @ squares
            @ inverse_density(phi, np.pi, width_phi, 0, 2 * np.pi)
        )

    bounds = [(np.log(1e-3), np.log(10))] * 2
    starts = [np.log([width, width]) for width in (0.01, 0.1, 1)]
    search = partial(minimize, log_second_moment, method="Nelder-Mead", bounds=bounds)
    best = min(map(search, starts), key=lambda minimum: minimum.fun)
    return tuple(float(width) for width in np.exp(best.x))


def inverse_density(x, center, width, low, high):
    """Return 1 / density of `truncated_normal`, in NumPy.

    Where the density underflows, the result is large but finite.
    """
    below, above = (erf((end - center) / (np.sqrt(2) * width)) for end in (low, high))
    exponent = np.minimum(0.5 * ((x - center) / width) ** 2, 300)
    return 0.5 * (above - below) * width * np.sqrt(2 * np.pi) * np.exp(exponent)


def crowded(center, width, low, high):
    """Return nodes and weights of a quadrature over low..high with nodes dense near `center`.

    It is the midpoint rule in w with x = center + width sinh(w).
    """
    ends = np.arcsinh((np.array([low, high]) - center) / width)
    w = ends[0] + (ends[1] - ends[0]) * (np.arange(NODES) + 0.5) / NODES
    return center + width * np.sinh(w), width * np.cosh(w) * (ends[1] - ends[0]) / NODES


method = ReflectanceMethod("Monte Carlo, normal importance", "3.3.2.1", RANDOM_EFFORTS, run)

"""Numerical quadrature with one grid in the peak region and one in the rest (thesis 3.3.3).

This is the method that the thesis chose (its Figures 3.19 and 3.20). It found that 80 samples per
dimension suffice in the peak region and 50 in the rest. Other efforts keep that ratio.
"""

import drjit as dr
from drjit.llvm import Float64

from benchmarks.methods.reflectance.method import ReflectanceMethod, grid, lanes, mean
from benchmarks.methods.reflectance.regions import (
    PEAK_SHARE,
    REST_PER_PEAK,
    in_peak,
    in_rest,
    strip_share,
)


def dimensions(N):
    """Return the samples per dimension in the peak region and in the rest."""
    return N, max(round(REST_PER_PEAK * N), 2)


def samples(N):
    """Return the number of evaluations of the BRDF."""
    peak, rest = dimensions(N)
    return peak**2 + rest**2


def run(problem, N, repetitions, seed):
    """Return `repetitions` equal estimates of the DHR, with N samples per dimension in the peak."""
    i = problem.incident()
    peak, rest = dimensions(N)
    _, sample = lanes(peak**2, repetitions)
    r, weight = in_peak(problem, *grid(sample, peak, peak))
    total = mean(problem.integrand(i, r) * weight, peak**2)
    _, sample = lanes(rest**2, repetitions)
    r, weight = in_rest(problem, *grid(sample, rest, rest), *whole_cells(problem, rest))
    return total + mean(problem.integrand(i, r) * weight, rest**2)


def whole_cells(problem, N):
    """Return the shares that `in_rest` takes, rounded to whole cells of the grid.

    No cell then lies on both sides of a border between the regions.
    """
    share, N = strip_share(problem), dr.opaque(Float64, N)
    rows = dr.round(share * N)
    rows = dr.select((share > 0) & (share < 1), dr.clip(rows, 1, N - 1), rows)
    return dr.maximum(dr.round(PEAK_SHARE * N), 1) / N, rows / N


method = ReflectanceMethod(
    "stratified quadrature", "3.3.3", (8, 16, 24, 32, 48, 64, 80, 120, 160, 240, 480), run, samples
)

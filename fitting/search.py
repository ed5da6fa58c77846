"""The minimum of each candidate model, and the one that the data need."""

from dataclasses import dataclass, replace

import numpy as np

from mi_lcair.fitting.data import Data
from mi_lcair.fitting.descent import ROUND_OFF, explore, levenberg_marquardt
from mi_lcair.fitting.loss import Cauchy
from mi_lcair.fitting.selection import Candidate, Variant, choose, criterion
from mi_lcair.fitting.uncertainty import effective_count

COARSE = 1e-4  # relative gradient at which all starts stop; the best goes on to round-off
SAME_BASIN = 1e-3  # relative difference in cost within one basin
FEW_STARTS = 8
APERTURE_STARTS = 4  # minima for a point source from which the descent with the aperture starts
CAUCHY = 2.385  # standard deviations: 95 % efficient on normal errors
ROBUST_ROUNDS = 4
FAR = 4.0  # standard deviations; one normal error of 16,000 lies beyond
ROUND_OFF_DEX = 1e-9  # no residual is known better


@dataclass
class Noise:
    """Of a row: variance (as it counts for the error bars), mean curvature of its loss (1 for
    squares), correlation with its neighbour on a scan, 0..1; effective: how many independent rows
    there are, brdf_effective: those of the BRDF; level_dex: standard deviation of the common scale
    of all BRDFs [decades]; outliers: points beyond FAR standard deviations of the inner half.
    """

    variance: float
    curvature: float
    correlation: float
    effective: float
    brdf_effective: float
    level_dex: float
    outliers: int


def compare(
    data: Data, variants: list[Variant], starts: int, seed: int, robust: bool, step, before=()
) -> tuple[Candidate, list[Candidate], Noise]:
    """Search each of the variants, whole ones first; the chosen one, all of them, and the noise.

    A restricted variant starts from few points, but also from the whole one's minimum. step: called
    after each search. before: candidates from which the same form starts as well.
    """
    candidates = []
    for variant in variants:
        count = min(starts, FEW_STARTS) if variant.restriction else starts
        start = variant.model.starting_points(count, seed)
        near = [one.u for one in (*before, *candidates) if one.variant == variant.whole]
        candidates.append(search(data, variant, np.vstack([*near, start])))
        step()
    best = min(candidates, key=lambda one: one.cost)
    c = None
    if robust:
        for _ in range(ROBUST_ROUNDS):
            rows = data.residuals(best.variant)(best.u[None])[0][0]
            c = CAUCHY * inner_deviation(rows)
            best = descend(best, Cauchy(data.residuals(best.variant), c), COARSE)
        candidates = [
            descend(one, Cauchy(data.residuals(one.variant), c), COARSE) for one in candidates
        ]
        best = min(candidates, key=lambda one: one.cost)
    noise = assess(data, best, c)
    criteria = [criterion(one, data.rows, noise.effective) for one in candidates]
    index = choose(candidates, criteria)
    chosen = candidates[index] = descend(candidates[index], candidates[index].residuals, ROUND_OFF)
    for one, value in zip(candidates, criteria):
        one.criterion = value - min(criteria)
    return chosen, candidates, assess(data, chosen, c)


def search(data: Data, variant: Variant, start: np.ndarray) -> Candidate:
    """The best minimum that the starts (m, n) lead to."""
    free, start = variant.free, variant.restrict(start)
    residuals = point = data.residuals(variant)
    if data.half_angle:
        point = data.residuals(variant, aperture=False)  # the disc costs a hundred times more
    minima = levenberg_marquardt(point, explore(point, start, free), free, tolerance=COARSE)
    close = 0.5 * data.rows * (10 * COARSE * residuals.unit) ** 2
    share = np.mean(minima.cost <= minima.cost.min() * (1 + SAME_BASIN) + close)
    if data.half_angle:
        best = minima.u[np.argsort(minima.cost, kind="stable")[:APERTURE_STARTS]]
        minima = levenberg_marquardt(residuals, best, free, tolerance=COARSE)
    best = int(np.argmin(minima.cost))
    return Candidate(
        variant,
        residuals,
        minima.u[best],
        float(minima.cost[best]),
        float(minima.gradient[best]),
        float(share),
    )


def descend(candidate: Candidate, residuals, tolerance: float) -> Candidate:
    """The same variant at the nearest minimum of `residuals`."""
    minimum = levenberg_marquardt(
        residuals, candidate.u[None], candidate.variant.free, tolerance=tolerance
    )
    return replace(
        candidate,
        residuals=residuals,
        u=minimum.u[0],
        cost=float(minimum.cost[0]),
        gradient=float(minimum.gradient[0]),
    )


def assess(data: Data, candidate: Candidate, c: float | None = None) -> Noise:
    """The noise that a candidate leaves; c: of the Cauchy loss if outliers are given little weight.

    BRDF rows have the variance that they show. With directional rows, whose standard deviations are
    given, rows are in units of their own and the variance is at least 1; so it is where the
    measurements came with sigma.
    """
    residuals = data.residuals(candidate.variant)
    rows = residuals(candidate.u[None])[0][0]
    f = residuals.instrument(candidate.u[None])[0][0]
    per_decade = data.per_decade(f)
    influence, slope = rows, np.ones_like(rows)
    if c is not None:
        ratio2 = np.square(rows / c)
        influence, slope = rows / (1 + ratio2), (1 - ratio2) / np.square(1 + ratio2)
    fewest = len(candidate.u) + 1
    effective, correlation = effective_count(
        influence[: data.points], data.theta_i, data.theta_r, fewest
    )
    brdf_effective, share = effective, effective / data.points
    curvature = max(float(np.mean(slope)), 0.1)
    squares = np.sum(influence**2) / curvature**2
    if data.directional:
        effective += data.rows - data.points
        variance = max(squares / max(effective - candidate.size, 1), 1.0)
    else:
        variance = squares / max(data.points - candidate.size, 1)
        variance = max(variance, 1.0 if data.has_sigma else 0.0) / share
    variance = max(variance, np.square(ROUND_OFF_DEX) * np.mean(per_decade**2))
    dex = np.sqrt(
        np.mean(np.square(influence[: data.points] / np.maximum(per_decade[: data.points], 1e-300)))
    )
    outliers = int(np.sum(np.abs(rows[: data.points]) > FAR * inner_deviation(rows[: data.points])))
    return Noise(
        variance,
        curvature,
        correlation,
        effective,
        brdf_effective,
        float(np.sqrt(correlation) * dex),
        outliers,
    )


def inner_deviation(rows) -> float:
    """Standard deviation of normal errors whose inner half looks like that of the rows."""
    return max(1.4826 * float(np.median(np.abs(rows))), ROUND_OFF_DEX)

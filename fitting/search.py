"""Search for the minimum of each variant, and choice of the variant that the data require."""

from dataclasses import dataclass, replace

import numpy as np

from mi_lcair.fitting.data import (
    Cauchy,
    Data,
    FitSettings,
    FittedVariant,
    Variant,
    choose,
    criterion,
)
from mi_lcair.fitting.descent import ROUND_OFF, explore, levenberg_marquardt
from mi_lcair.physics.estimation.profiles import inner_deviation

# Relative gradient at which the descents from all starts stop. The best then continues to
# round-off.
COARSE = 1e-4
SAME_BASIN = 1e-3  # largest relative difference in cost between descents to the same minimum
FEW_STARTS = 8  # largest number of random starts of a restricted variant
APERTURE_STARTS = 4  # minima for a point source from which the descent with the aperture starts
# Scale of the Cauchy loss [standard deviations]. The fit is then 95 % efficient for normal errors.
CAUCHY = 2.385
ROBUST_ROUNDS = 4  # rounds in which the scale of the residuals and the fit are determined in turn
# Distance from the model beyond which a point is an outlier [standard deviations]. One normal error
# in 16,000 lies beyond it.
FAR = 4.0
ROUND_OFF_DEX = 1e-9  # rounding error of a residual [decades]
# Correlation of neighbours that white noise shows by chance, times the root of their number. Noise
# exceeds it in 1 of 740 fits.
BY_CHANCE = 3.0


@dataclass(frozen=True)
class Noise:
    """The noise of the residuals of a fit.

    Attributes
    ----------
    variance
        Variance of a row, from which the error bars are computed.
    curvature
        Mean second derivative of a row's loss, 1 for squares.
    correlation
        Correlation of neighbouring points of a scan, 0..1.
    effective, brdf_effective
        Numbers of independent rows: all, and those of the BRDF.
    level_dex
        Standard deviation of the common scale of all BRDFs [decades].
    outliers
        Number of points beyond FAR standard deviations, as the inner half of the points shows them.
    """

    variance: float
    curvature: float
    correlation: float
    effective: float
    brdf_effective: float
    level_dex: float
    outliers: int


def compare(
    data: Data, variants: list[Variant], settings: FitSettings, step, before=()
) -> tuple[FittedVariant, list[FittedVariant], Noise]:
    """Search each variant and choose the one that the data require.

    A restricted variant starts from few random points, and from the minimum of the whole variant.

    Parameters
    ----------
    data
        The data of the fit.
    variants
        Variants to compare, whole ones first.
    settings
        The settings of the fit.
    step
        Function that is called after each search.
    before
        Candidates of an earlier search. Their minima are additional starts for the same form.

    Returns
    -------
    tuple
        The chosen `FittedVariant`, all candidates, and the `Noise` that the chosen one leaves.
    """
    candidates = []
    for variant in variants:
        count = min(settings.starts, FEW_STARTS) if variant.restriction else settings.starts
        start = variant.model.starting_points(count, settings.seed)
        near = [
            candidate.u
            for candidate in (*before, *candidates)
            if candidate.variant == variant.whole
        ]
        candidates.append(search(data, variant, np.vstack([*near, start])))
        step()
    best = min(candidates, key=lambda candidate: candidate.cost)
    c = None
    if settings.robust:
        # The scale c of the loss depends on the residuals of the best fit, and these depend on c.
        for _ in range(ROBUST_ROUNDS):
            rows = data.residuals(best.variant)(best.u[None])[0][0]
            c = CAUCHY * inner_deviation(rows, ROUND_OFF_DEX)
            best = descend(best, Cauchy(data.residuals(best.variant), c), COARSE)
        candidates = [
            descend(candidate, Cauchy(data.residuals(candidate.variant), c), COARSE)
            for candidate in candidates
        ]
        best = min(candidates, key=lambda candidate: candidate.cost)
    noise = assess(data, best, c)
    criteria = [criterion(candidate, data.rows, noise.effective) for candidate in candidates]
    index = choose(candidates, criteria)
    accepted = candidates[index] = descend(
        candidates[index], candidates[index].residuals, ROUND_OFF
    )
    for candidate, value in zip(candidates, criteria):
        candidate.criterion = value - min(criteria)
    return accepted, candidates, assess(data, accepted, c)


def search(data: Data, variant: Variant, start: np.ndarray) -> FittedVariant:
    """The lowest minimum of a variant that is found from the starts (m, n)."""
    free, start = variant.free, variant.restrict(start)
    residuals = point = data.residuals(variant)
    if data.half_angle:
        # A point source is searched first. The average over the disc takes a hundred times longer.
        point = data.residuals(variant, aperture=False)
    minima = levenberg_marquardt(point, explore(point, start, free), free, tolerance=COARSE)
    close = 0.5 * data.rows * (10 * COARSE * residuals.unit) ** 2
    share = np.mean(minima.cost <= minima.cost.min() * (1 + SAME_BASIN) + close)
    if data.half_angle:
        best = minima.u[np.argsort(minima.cost, kind="stable")[:APERTURE_STARTS]]
        minima = levenberg_marquardt(residuals, best, free, tolerance=COARSE)
    best = int(np.argmin(minima.cost))
    cost, gradient = float(minima.cost[best]), float(minima.gradient[best])
    return FittedVariant(variant, residuals, minima.u[best], cost, gradient, float(share))


def descend(candidate: FittedVariant, residuals, tolerance: float) -> FittedVariant:
    """Continue a candidate to the nearest minimum of `residuals`, up to the relative gradient."""
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


def assess(data: Data, candidate: FittedVariant, c: float | None = None) -> Noise:
    """The noise in the residuals of a candidate.

    The variance of the BRDF rows is that of the residuals. It is at least 1 if the rows are in
    units of known standard deviations: in a fit with directional tables, and for measurements with
    sigma.

    Parameters
    ----------
    data
        The data of the fit.
    candidate
        The candidate at its minimum.
    c
        Scale of the Cauchy loss; None if outliers have full weight.

    Returns
    -------
    Noise
        Variance, correlation and outliers.
    """
    residuals = data.residuals(candidate.variant)
    rows = residuals(candidate.u[None])[0][0]
    f = residuals.instrument(candidate.u[None])[0][0]
    per_decade = data.per_decade(f)
    influence, slope = (rows, np.ones_like(rows)) if c is None else Cauchy.influence(rows, c)
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
    of_brdf = np.abs(rows[: data.points])
    outliers = int(np.sum(of_brdf > FAR * inner_deviation(of_brdf, ROUND_OFF_DEX)))
    level_dex = float(np.sqrt(correlation) * dex)
    return Noise(variance, curvature, correlation, effective, brdf_effective, level_dex, outliers)


def neighbour_correlation(rows, theta_i, theta_r) -> tuple[float, int]:
    """Correlation of neighbouring residuals along the scans, -1..1, and the number of neighbours.

    Parameters
    ----------
    rows
        Residuals of the BRDF points, (p,).
    theta_i, theta_r
        Elevations of source and observer [radians], (p,).
    """
    scanned, fixed = sorted(
        (theta_r, theta_i), key=lambda angle: -len(np.unique(np.round(angle, 9)))
    )
    # Neighbours of a scan are next to each other when the points are sorted by the scanned angle.
    order = np.lexsort((scanned, np.round(fixed, 9)))
    same = np.diff(np.round(fixed, 9)[order]) == 0
    first, second = rows[order][:-1][same], rows[order][1:][same]
    power = np.sum(first * first + second * second)
    return float(2 * np.sum(first * second) / power if power > 0 else 0.0), len(first)


def effective_count(rows, theta_i, theta_r, fewest: int = 1) -> tuple[float, float]:
    """Effective number of independent residuals, and correlation of neighbours along a scan.

    Where a model deviates from the data, it deviates alike at neighbouring points. n points with
    the correlation r of neighbours (first-order autocorrelation) are worth n (1 - r)/(1 + r)
    independent ones. A correlation that white noise could also show is taken as 0.

    Parameters
    ----------
    rows
        Residuals of the BRDF points, (p,).
    theta_i, theta_r
        Elevations of source and observer [radians], (p,).
    fewest
        Smallest effective number of correlated residuals.

    Returns
    -------
    tuple
        The effective number, and the correlation, 0..1.
    """
    correlation, pairs = neighbour_correlation(rows, theta_i, theta_r)
    if correlation < BY_CHANCE / np.sqrt(max(pairs, 1)):
        return float(len(rows)), 0.0
    count = len(rows) * (1 - correlation) / (1 + correlation)
    return float(max(count, fewest)), correlation

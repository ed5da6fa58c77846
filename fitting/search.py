"""Search for the minimum of each variant, and choice of the variant that the data require."""

from dataclasses import dataclass, replace

import drjit as dr
import numpy as np
from drjit.llvm.ad import Float64
from drjit.opt import Adam

from mi_lcair.fitting.data import (
    Cauchy,
    Data,
    FitSettings,
    FittedVariant,
    Variant,
    choose,
    criterion,
)
from mi_lcair.physics.estimation.verdicts import inner_deviation

# Minimization of a sum of squares over the unit cube, from many starts at once
# -----------------------------------------------------------------------------
# `explore` takes a few steps of gradient descent into a basin. `levenberg_marquardt` then finds the
# minimum. Both evaluate the residuals of all starts in one call. For each start there remains a
# system of n linear equations, one for each coordinate.

STEPS, LEARNING_RATE = 5, 0.3  # steps and learning rate of `explore`
# Relative gradient, gradient / (|column of the Jacobian| |rows|), at which only round-off is left.
ROUND_OFF = 1e-12
FINEST = 1e-4  # smallest residual [decades] with which the gradient is compared
SNAP = 1e-6  # distance from a bound within which a step may end on the bound


@dataclass
class Minima:
    """The minima that m starts led to.

    Attributes
    ----------
    u
        Coordinates, (m, n).
    cost
        Half the sum of squares, (m,).
    gradient
        Largest component of the relative gradient along the coordinates that can move, (m,). It is
        relative to |column of the Jacobian| |rows|.
    """

    u: np.ndarray
    cost: np.ndarray
    gradient: np.ndarray


def explore(residuals, u: np.ndarray, free=True, steps: int = STEPS) -> np.ndarray:
    """Take some steps of gradient descent (Adam) from each start.

    The steps are taken in logit(u), so that none leaves the cube.

    Parameters
    ----------
    residuals
        Function of coordinates u (m, n) that returns rows (m, r) and derivatives (m, r, n).
    u
        Starts, (m, n).
    free
        Mask of the coordinates that move.
    steps
        Number of steps.

    Returns
    -------
    numpy.ndarray
        Coordinates after the steps, (m, n).
    """
    inside = np.clip(u, 1e-4, 1 - 1e-4)
    descent = Adam(
        lr=LEARNING_RATE, params={"logit": Float64(np.log(inside / (1 - inside)).ravel())}
    )
    for _ in range(steps):
        point = 1 / (1 + dr.exp(-descent["logit"]))
        rows, slopes = residuals(np.where(free, point.numpy().reshape(u.shape), u))
        gradient = np.einsum("nr,nrk->nk", rows, slopes) * free
        # The scalar product has the gradient of the cost. Dr.Jit carries it back to the logits.
        dr.backward(dr.dot(point, Float64(gradient.ravel())))
        descent.step()
    final = 1 / (1 + np.exp(-descent["logit"].numpy().reshape(u.shape)))
    return np.where(free, final, u)


def levenberg_marquardt(
    residuals, u: np.ndarray, free=True, iterations: int = 100, tolerance: float = ROUND_OFF
) -> Minima:
    """Find the minimum in the cube below each start, by the Levenberg-Marquardt method.

    A coordinate can reach a bound exactly, and can leave it again in a later step.

    Parameters
    ----------
    residuals
        Function of coordinates u (k, n) and indices of k starts. It returns rows (k, r) and their
        derivatives (k, r, n). Its attribute `unit` is the change of a typical row for one decade of
        the BRDF.
    u
        Starts, (m, n).
    free
        Mask of the coordinates that move, (n,) or (m, n).
    iterations
        Largest number of steps.
    tolerance
        A start is finished when its relative gradient is below `tolerance`, when a step lowers its
        cost by less than the relative amount tolerance^2, or when its rows are below `tolerance`
        decades. Finished starts are not evaluated again.

    Returns
    -------
    Minima
        One minimum for each start.
    """
    u, free, identity = u.copy(), np.broadcast_to(free, u.shape), np.eye(u.shape[1])
    rows, slopes = residuals(u, np.arange(len(u)))
    cost, normal, gradient = normal_equations(rows, slopes)
    decades = 0.5 * rows.shape[1] * residuals.unit**2  # cost if each row were off by one decade
    norm = relative_gradient(u, cost + FINEST**2 * decades, normal, gradient, free)
    damping, growth = np.full(len(u), 1e-3), np.full(len(u), 2.0)
    active = np.flatnonzero(norm > tolerance)
    for _ in range(iterations):
        if not len(active):
            break
        # The step solves the damped normal equations within the cube.
        scale = damping[active, None] * diagonal(normal[active])
        damped = normal[active] + scale[..., None] * identity
        trial = box_step(damped, gradient[active], u[active], free[active])
        step = trial - u[active]
        # The quadratic model predicts how far this step lowers the cost.
        model = gradient[active] + 0.5 * np.einsum("nij,nj->ni", normal[active], step)
        predicted = -np.einsum("ni,ni->n", model, step)
        rows, slopes = residuals(trial, active)
        new_cost, new_normal, new_gradient = normal_equations(rows, slopes)
        gain = np.clip((cost[active] - new_cost) / np.maximum(predicted, 1e-200), -1, 2)
        new_norm = relative_gradient(
            trial, new_cost + FINEST**2 * decades, new_normal, new_gradient, free[active]
        )
        # Where the costs differ by round-off only, the gradient decides whether the step is
        # accepted.
        level = np.abs(cost[active] - new_cost) <= 1e-12 * cost[active]
        better = np.where(level, new_norm < norm[active], new_cost < cost[active])
        accepted, rejected = active[better], active[~better]
        stalled = ~level & better & (cost[active] - new_cost <= tolerance**2 * cost[active])
        u[accepted], cost[accepted], normal[accepted], gradient[accepted] = (
            trial[better],
            new_cost[better],
            new_normal[better],
            new_gradient[better],
        )
        # A rejected step raises the damping, each time by a larger factor (Nielsen 1999).
        damping[accepted] *= np.where(level[better], 1 / 10, easing(gain[better]))
        growth[accepted] = 2
        damping[rejected] *= growth[rejected]
        growth[rejected] *= 2
        norm[accepted] = new_norm[better]
        done = (norm[active] < tolerance) | stalled | (cost[active] < tolerance**2 * decades)
        done |= (np.max(np.abs(step), axis=1) < 1e-15) | (damping[active] > 1e16)
        active = active[~done]
    return Minima(u, cost, norm)


def easing(gain):
    """Factor of the damping after a step with this ratio of actual to predicted gain (Nielsen)."""
    return np.maximum(1 / 10, 1 - (2 * gain - 1) ** 3)


def normal_equations(rows, slopes):
    """Half the sum of squares (m,), J^T J (m, n, n) and J^T r (m, n)."""
    transposed = slopes.swapaxes(1, 2)
    return (
        0.5 * np.einsum("nr,nr->n", rows, rows),
        transposed @ slopes,
        (transposed @ rows[..., None])[..., 0],
    )


def diagonal(matrices):
    """Diagonals (m, n) of matrices (m, n, n), at least 1e-12."""
    return np.maximum(np.einsum("nii->ni", matrices), 1e-12)


def held(u, gradient, free):
    """Mask of the coordinates that cannot move.

    They are not free, or lie on a bound beyond which the cost would fall.
    """
    return ~free | ((u <= 0) & (gradient >= 0)) | ((u >= 1) & (gradient <= 0))


def relative_gradient(u, cost, normal, gradient, free):
    """Largest relative component of the gradient along coordinates that can move, (m,)."""
    columns = np.einsum("nii->ni", normal)
    # The lower limit gives a coordinate without effect on the rows a gradient of about 0.
    columns = np.maximum(columns, 1e-16 * columns.max(axis=1, keepdims=True))
    size = np.sqrt(np.maximum(columns * 2 * cost[:, None], 1e-300))
    return np.max(np.where(held(u, gradient, free), 0, np.abs(gradient)) / size, axis=1)


def box_step(matrix, gradient, u, free):
    """u + step, where the step minimizes gradient . step + step . matrix step / 2 within the cube.

    The method is an active set. A step takes at most nine tenths of the way to a bound. A longer
    step, straight to a face of the cube, often leads to another minimum, on that face. Within SNAP
    of a bound the next step may reach it.

    Parameters
    ----------
    matrix
        Damped normal matrices, (m, n, n).
    gradient
        Gradients of the cost, (m, n).
    u
        Coordinates, (m, n).
    free
        Mask of the coordinates that move, (m, n).

    Returns
    -------
    numpy.ndarray
        Coordinates after the step, (m, n).
    """
    lowest = np.where(u > SNAP, 0.1 * u, 0)
    highest = np.where(u < 1 - SNAP, 1 - 0.1 * (1 - u), 1)
    fixed = held(u, gradient, free)
    step = np.zeros_like(u)
    coordinates = u.shape[1]
    for _ in range(coordinates + 1):  # each round but the last fixes at least one coordinate
        # Rows and columns of fixed coordinates become those of the unit matrix.
        system = np.where(fixed[:, :, None] | fixed[:, None, :], 0, matrix)
        system = system + fixed[:, :, None] * np.eye(coordinates)
        known = np.einsum("nij,nj->ni", matrix, np.where(fixed, step, 0))
        step = np.where(
            fixed, step, np.linalg.solve(system, (-gradient - known)[..., None])[..., 0]
        )
        # Coordinates that would pass their limit are fixed at it; the rest is solved again.
        beyond = ~fixed & ((u + step < lowest) | (u + step > highest))
        if not beyond.any():
            break
        step = np.where(beyond, np.clip(u + step, lowest, highest) - u, step)
        fixed = fixed | beyond
    return np.clip(u + step, lowest, highest)


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
# Outliers are reported if they are more than the share MANY_OUTLIERS of the points, and if the
# correlation of neighbours is below SCATTERED, so that they are single points.
MANY_OUTLIERS, SCATTERED = 0.01, 0.3
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
        Number of points beyond FAR standard deviations, as the inner half of the points shows them,
        or as sigma states them if it is larger.
    """

    variance: float
    curvature: float
    correlation: float
    effective: float
    brdf_effective: float
    level_dex: float
    outliers: int

    def has_outliers(self, points: int) -> bool:
        """Whether outliers are worth reporting: single points, and more than a share of all."""
        return self.outliers > MANY_OUTLIERS * points and self.correlation < SCATTERED


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
    usual = inner_deviation(of_brdf, 1.0 if data.has_sigma else ROUND_OFF_DEX)
    outliers = int(np.sum(of_brdf > FAR * usual))
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

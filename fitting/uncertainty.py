"""How well the data determine each parameter: covariance and profile intervals."""

import numpy as np
from scipy import stats

from mi_lcair.fitting.cube import parameters_at
from mi_lcair.fitting.descent import levenberg_marquardt

CONFIDENCE = 0.95
PROFILE_STEPS = np.array(
    [0.5, 1, 1.5, 2, 2.5, 3, 4, 6, 10, 20, 50]
)  # standard errors from the minimum


def effective_count(rows, theta_i, theta_r, fewest: int = 1) -> tuple[float, float]:
    """How many independent residuals these are worth, and the correlation of neighbours along a
    scan, 0..1.

    A model that misses the data misses neighbouring points alike; n points then know no more than n
    (1 - r)/(1 + r) independent ones (first-order autocorrelation). A correlation that white noise
    could show counts as none. Correlated residuals are worth `fewest` at least.
    """
    scanned, fixed = sorted(
        (theta_r, theta_i), key=lambda angle: -len(np.unique(np.round(angle, 9)))
    )
    order = np.lexsort((scanned, np.round(fixed, 9)))
    same = np.diff(np.round(fixed, 9)[order]) == 0
    first, second = rows[order][:-1][same], rows[order][1:][same]
    power = np.sum(first * first + second * second)
    correlation = 2 * np.sum(first * second) / power if power > 0 else 0.0
    if correlation < 3 / np.sqrt(max(len(first), 1)):
        return float(len(rows)), 0.0
    count = len(rows) * (1 - correlation) / (1 + correlation)
    return float(max(count, fewest)), float(correlation)


def cube_covariance(slopes, free, variance: float):
    """Covariance (n, n) of the coordinates; without data a coordinate is uniform in 0..1, so that
    all numbers are finite.
    """
    slopes = slopes * free
    prior = 12 * np.eye(len(free))  # of a uniform coordinate, whose variance is 1/12
    return np.linalg.inv(slopes.T @ slopes / variance + prior) * np.outer(free, free)


def covariance(model, slopes, u, free, variance: float, level) -> np.ndarray:
    """Covariance (n, n) of the parameters at the minimum u (n,); zero for those that are not free.

    slopes (rows, n): Jacobian by u; variance: of a row. level (rows,): change of the rows for one
    standard deviation of the scale of all BRDFs together, an error that no number of points
    averages out.
    """
    cube = cube_covariance(slopes, free, variance)
    shift = cube @ (slopes.T @ level) / variance
    derivative = parameters_at(model, u[None])[1][0] * free
    return derivative @ (cube + np.outer(shift, shift)) @ derivative.T


def level_shift(model, slopes, u, free, variance: float, level) -> np.ndarray:
    """How far the parameters (n,) move at most when the scale of all BRDFs is wrong by one standard
    deviation.

    Finite steps, so that a parameter can leave its bound.
    """
    shift = cube_covariance(slopes, free, variance) @ (slopes.T @ level) / variance
    ends = parameters_at(model, np.clip([u, u + shift, u - shift], 0, 1))[0]
    return np.max(np.abs(ends[1:] - ends[0]), axis=0)


def standard_errors(model, matrix) -> np.ndarray:
    """Standard errors (n,), none larger than the parameter's range."""
    ranges = [parameter.upper - parameter.lower for parameter in model.parameters]
    return np.minimum(np.sqrt(np.maximum(np.diag(matrix), 0)), ranges)


def correlation(matrix) -> np.ndarray:
    size = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    ratio = np.clip(matrix / np.outer(size, size), -1, 1)
    return np.where(np.eye(len(matrix), dtype=bool), 1.0, ratio)


class Held:
    """Residuals with one parameter held at a value of its own in each lane, by one more, very stiff
    row.
    """

    def __init__(self, model, residuals, which, value, stiffness):
        self.model, self.residuals = model, residuals
        self.which, self.value, self.stiffness = which, value, stiffness
        self.unit = residuals.unit

    def __call__(self, u, lanes):
        rows, slopes = self.residuals(u)
        values, derivatives = parameters_at(self.model, u)
        pick = np.arange(len(u)), self.which[lanes]
        row = (values[pick] - self.value[lanes]) * self.stiffness[lanes]
        slope = derivatives[pick] * self.stiffness[lanes, None]
        return np.concatenate([rows, row[:, None]], axis=1), np.concatenate(
            [slopes, slope[:, None]], axis=1
        )


def profile_intervals(
    model, residuals, u, cost: float, free, matrix, variance: float, dof: float, systematic
) -> np.ndarray:
    """Confidence intervals (n, 2): how far each parameter can move while the others are refitted.

    u (n,), cost: the minimum; free (n,): coordinates that the chosen variant lets move. The cost
    may rise by variance t^2 / 2 with Student's t; systematic (n,): standard errors from the common
    scale, added in squares.
    """
    best, errors = parameters_at(model, u[None])[0][0], standard_errors(model, matrix)
    lower, upper = model.feasible_range(best)
    t = stats.t.ppf(0.5 + CONFIDENCE / 2, dof)
    lanes = []
    for k in range(len(best)):
        for side, bound in ((-1, lower[k]), (1, upper[k])):
            reach = side * (bound - best[k])
            if reach <= 1e-12:
                continue
            step = (
                errors[k] if errors[k] > 0 else reach / 1000
            )  # a parameter at its bound has no error yet
            steps = np.append(PROFILE_STEPS * step, reach * np.array([0.1, 0.3, 1]))
            lanes += [(k, side, distance) for distance in np.unique(steps[steps <= reach])]
    which, side, distance = (np.array(column) for column in zip(*lanes))
    value = best[which] + side * distance
    start = np.stack([neighbour(model, best, matrix, k, target) for k, target in zip(which, value)])
    may_move = free | (np.arange(len(best)) == which[:, None])
    stiffness = 1e4 * np.sqrt(variance) / distance
    minima = levenberg_marquardt(
        Held(model, residuals, which, value, stiffness),
        model.to_cube(start),
        may_move,
        iterations=30,
        tolerance=1e-5,
    )
    rise = np.sqrt(np.maximum(2 * (minima.cost - cost) / variance, 0))
    intervals = np.column_stack([lower, upper])
    for k in range(len(best)):
        for column, sign in ((0, -1), (1, 1)):
            chosen = (which == k) & (side == sign)
            if not chosen.any():
                continue
            reached = np.flatnonzero(np.append(rise[chosen], np.inf) > t)[0]
            if reached == chosen.sum():
                continue  # the bound itself still fits
            x, y = np.append(0, distance[chosen]), np.append(0, rise[chosen])
            width = x[reached] + (t - y[reached]) * (x[reached + 1] - x[reached]) / (
                y[reached + 1] - y[reached]
            )
            far = best[k] + sign * np.hypot(width, t * systematic[k])
            intervals[k, column] = np.clip(far, lower[k], upper[k])
    return intervals


def neighbour(model, best, matrix, k: int, target: float) -> np.ndarray:
    """Feasible parameters with the k-th at `target` and the others moved along with it, as their
    covariance says.
    """
    slope = matrix[:, k] / matrix[k, k] if matrix[k, k] > 0 else np.zeros(len(best))
    moved = best + slope * (target - best[k])
    moved[k] = target
    near = np.abs(moved - best) <= 0.5 * np.abs(best)
    return model.nearest_feasible(np.where(near | (np.arange(len(best)) == k), moved, best), k)

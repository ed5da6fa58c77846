"""Uncertainty of the parameters of a fit: covariance and profile intervals."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mi_lcair.fitting.cube import parameters_at
from mi_lcair.fitting.descent import levenberg_marquardt
from mi_lcair.physics.estimation.profiles import further, profile_ends, student_factor
from mi_lcair.physics.reflection.interface import ReflectionModel

# Correlation of neighbours that white noise shows by chance, times the root of their number. Noise
# exceeds it in 1 of 740 fits.
BY_CHANCE = 3.0


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


@dataclass(frozen=True)
class Linearized:
    """A fit near its minimum, where the rows are linear in the coordinates.

    The prior of a coordinate is uniform in 0..1, so that its covariance is finite even if the data
    do not determine it.

    Attributes
    ----------
    model
        The reflection model.
    u
        Coordinates of the minimum, (n,).
    free
        Mask of the coordinates that the variant lets move, (n,).
    slopes
        Derivatives of the rows with respect to the coordinates, (r, n).
    variance
        Variance of a row.
    level
        Change of the rows for one standard deviation of the common scale of all BRDFs, (r,). This
        error does not average out over the points.
    """

    model: ReflectionModel
    u: np.ndarray
    free: np.ndarray
    slopes: np.ndarray
    variance: float
    level: np.ndarray

    @cached_property
    def parameters(self) -> np.ndarray:
        """Parameters at the minimum, (n,)."""
        return parameters_at(self.model, self.u[None])[0][0]

    @cached_property
    def cube_covariance(self) -> np.ndarray:
        """Covariance of the coordinates, (n, n), without the error of the common scale."""
        return self.cube_covariance_of(self.free)

    def cube_covariance_of(self, free: np.ndarray) -> np.ndarray:
        """`cube_covariance` if the coordinates in the mask `free` (n,) move."""
        slopes = self.slopes * free
        prior = 12 * np.eye(len(free))  # a uniform coordinate has the variance 1/12
        inverse = np.linalg.inv(slopes.T @ slopes / self.variance + prior)
        return inverse * np.outer(free, free)

    @cached_property
    def shift(self) -> np.ndarray:
        """Change of the coordinates (n,) for one standard deviation of the common scale."""
        return self.cube_covariance @ (self.slopes.T @ self.level) / self.variance

    def covariance(self, with_level: bool = True) -> np.ndarray:
        """Covariance of the parameters, (n, n); 0 for coordinates that are not free.

        with_level: whether the error of the common scale is part of it.
        """
        return self.covariance_of(parameters_at(self.model, self.u[None])[1][0], with_level)

    def covariance_of(self, derivative: np.ndarray, with_level: bool = True) -> np.ndarray:
        """Covariance (m, m) of numbers with derivatives (m, n) with respect to the coordinates."""
        cube = self.cube_covariance
        if with_level:
            cube = cube + np.outer(self.shift, self.shift)
        derivative = derivative * self.free
        return derivative @ cube @ derivative.T

    def variance_of(self, derivative: np.ndarray) -> np.ndarray:
        """Diagonal (m,) of `covariance_of`."""
        derivative = derivative * self.free
        level = (derivative @ self.shift) ** 2
        return np.sum(derivative @ self.cube_covariance * derivative, axis=1) + level

    def moved(self, k: int) -> float:
        """Change of the k-th parameter for one standard deviation of its coordinate.

        It is computed with finite steps in both directions and is thus finite at a bound, where the
        parameter may have no derivative. The coordinate moves even if the variant holds it.
        """
        cube = self.cube_covariance_of(self.free | (np.arange(len(self.free)) == k))
        step = cube[k] / np.sqrt(cube[k, k])
        ends = parameters_at(self.model, np.clip([self.u + step, self.u - step], 0, 1))[0]
        return float(np.max(np.abs(ends[:, k] - self.parameters[k])))

    def level_shift(self) -> np.ndarray:
        """Largest change of the parameters (n,) for one standard deviation of the common scale.

        It is computed with finite steps in both directions, so that a parameter at a bound can
        leave it.
        """
        steps = np.clip([self.u, self.u + self.shift, self.u - self.shift], 0, 1)
        ends = parameters_at(self.model, steps)[0]
        return np.max(np.abs(ends[1:] - ends[0]), axis=0)


def standard_errors(model, matrix) -> np.ndarray:
    """Standard errors (n,) from a covariance matrix (n, n), at most the parameter's range."""
    ranges = [parameter.upper - parameter.lower for parameter in model.parameters]
    return np.minimum(np.sqrt(np.maximum(np.diag(matrix), 0)), ranges)


class Held:
    """Residuals with one parameter held at a given value in each lane.

    An additional, very stiff row holds it.

    Parameters
    ----------
    model
        The reflection model.
    residuals
        The residuals of the fit.
    which, value
        Index of the held parameter and its value in each lane, (l,).
    stiffness
        Weight of the additional row in each lane, (l,).
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
    near: Linearized, residuals, cost: float, curvature: float, dof: float
) -> np.ndarray:
    """Confidence intervals: how far each parameter can move while the others are refitted.

    Within an interval the cost rises by at most variance t^2 / 2, with Student's t. The error of
    the common scale is added in squares.

    Parameters
    ----------
    near
        The fit near its minimum.
    residuals, cost
        Residuals that were minimized, and the cost at the minimum.
    curvature
        Mean second derivative of a row's loss, 1 for squares.
    dof
        Degrees of freedom.

    Returns
    -------
    numpy.ndarray
        Lower and upper ends of the intervals, (n, 2).
    """
    model, best, matrix = near.model, near.parameters, near.covariance(with_level=False)
    errors, variance = standard_errors(model, matrix), near.variance * curvature
    for k, bound in enumerate(model.bound_names(near.u)):
        if bound is not None or errors[k] == 0:
            errors[k] = near.moved(k)
    t, ends = student_factor(dof), np.stack(model.feasible_range(best), axis=1)
    parameter, side = np.nonzero(np.abs(ends - best[:, None]) > 1e-12)
    middle, bound = best[parameter], ends[parameter, side]
    # A parameter that has no standard error begins with a part of its range
    step = np.where(errors > 0, errors, np.ptp(ends, axis=1) / 1000)[parameter]
    first = middle + np.sign(bound - middle) * t * step

    def refit(profiles, value, starts):
        """All of these profiles are refitted at once, with one parameter held in each lane."""
        which = parameter[profiles]
        near_by = zip(parameters_at(model, starts)[0], which, value)
        start = np.stack([neighbour(model, of, matrix, k, target) for of, k, target in near_by])
        stiffness = 1e4 * np.sqrt(variance) / np.abs(value - best[which])
        minima = levenberg_marquardt(
            Held(model, residuals, which, value, stiffness),
            model.to_cube(start),
            near.free | (np.arange(len(best)) == which[:, None]),
            iterations=30,
            tolerance=1e-5,
        )
        return np.sqrt(np.maximum(2 * (minima.cost - cost) / variance, 0)), minima.u

    inside, distance, outside = profile_ends(refit, middle, near.u, first, bound, t)
    place = parameters_at(model, inside)[0][np.arange(len(parameter)), parameter]
    width = np.abs(further(middle, place, distance, t) - middle)
    width = np.minimum(width, np.abs(outside - middle))
    far = middle + np.sign(bound - middle) * np.hypot(width, t * near.level_shift()[parameter])
    ends[parameter, side] = np.clip(far, *ends[parameter].T)
    return ends


def neighbour(model, best, matrix, k: int, target: float) -> np.ndarray:
    """Feasible parameters (n,) with the k-th one at `target`, as a start for refitting the others.

    The others move with it as their covariance `matrix` predicts, if that changes them by at most
    half of their value.
    """
    slope = matrix[:, k] / matrix[k, k] if matrix[k, k] > 0 else np.zeros(len(best))
    moved = best + slope * (target - best[k])
    moved[k] = target
    near = np.abs(moved - best) <= 0.5 * np.abs(best)
    return model.nearest_feasible(np.where(near | (np.arange(len(best)) == k), moved, best), k)

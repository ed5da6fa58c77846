"""Uncertainty of the parameters of a fit: covariance, profile intervals, verdicts."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from mi_lcair.errors import option
from mi_lcair.fitting.model import Hemispherical, parameters_at
from mi_lcair.fitting.search import levenberg_marquardt
from mi_lcair.physics.estimation.verdicts import (
    Verdict,
    correlation,
    further,
    profile_ends,
    student_factor,
)
from mi_lcair.physics.reflection.interface import ModelParameter, ReflectionModel

# An interval that begins below this multiple of the lower bound is said to reach the bound.
NEAR_LOWER = 1.5
# Smallest number of degrees of freedom. Correlated residuals can leave fewer, for which Student's t
# is very large.
LEAST_DOF = 3
# Calibration error of a scatterometer that does not state one, relative. A parameter that it moves
# by more than the share FELT of its standard error depends on the level of the readings.
CALIBRATION, FELT = 0.05, 0.25
CURVED = 1.5  # ratio of both errors from which that of the interval counts, not that of the slopes
LEVEL = ", if the level is calibrated"


@dataclass(frozen=True)
class Linearized:
    """A fit near its minimum, where the rows are linear in the coordinates.

    The prior of a coordinate is uniform in 0..1, so that its covariance is finite even if the data
    do not determine it. All coordinates move, also one that a simpler variant holds. Data that do
    not require a parameter do not determine it either.

    Attributes
    ----------
    model
        The reflection model.
    u
        Coordinates of the minimum, (n,).
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
        prior = 12 * np.eye(len(self.u))  # a uniform coordinate has the variance 1/12
        return np.linalg.inv(self.slopes.T @ self.slopes / self.variance + prior)

    @cached_property
    def shift(self) -> np.ndarray:
        """Change of the coordinates (n,) for one standard deviation of the common scale."""
        return self.cube_covariance @ (self.slopes.T @ self.level) / self.variance

    def covariance(self, with_level: bool = True) -> np.ndarray:
        """Covariance of the parameters, (n, n).

        with_level: whether the error of the common scale is part of it.
        """
        cube = self.cube_covariance
        if with_level:
            cube = cube + np.outer(self.shift, self.shift)
        derivative = parameters_at(self.model, self.u[None])[1][0]
        return derivative @ cube @ derivative.T

    def variance_of(self, derivative: np.ndarray) -> np.ndarray:
        """Variances (m,) of numbers with derivatives (m, n) with respect to the coordinates."""
        level = (derivative @ self.shift) ** 2
        return np.sum(derivative @ self.cube_covariance * derivative, axis=1) + level

    def moved(self, k: int) -> float:
        """Change of the k-th parameter for one standard deviation of its coordinate.

        It is computed with finite steps in both directions and is thus finite at a bound, where the
        parameter may have no derivative.
        """
        cube = self.cube_covariance
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
    trapped = np.flatnonzero(np.isin(near.u, (0, 1)))

    def refit(profiles, value, starts):
        """All of these profiles are refitted at once, with one parameter held in each lane."""
        which = parameter[profiles]
        near_by = zip(parameters_at(model, starts)[0], which, value)
        start = np.stack([neighbour(model, of, matrix, k, target) for of, k, target in near_by])
        stiffness = 1e4 * np.sqrt(variance) / np.abs(value - best[which])
        # At its bound a coordinate may be trapped, with a better valley at the far end of its range
        starts = np.tile(model.to_cube(start), (1 + len(trapped), 1, 1))
        starts[range(1, 1 + len(trapped)), :, trapped] = 0.5
        lanes = (np.tile(of, len(starts)) for of in (which, value, stiffness))
        minima = levenberg_marquardt(
            Held(model, residuals, *lanes), np.concatenate(starts), iterations=30, tolerance=1e-5
        )
        costs = minima.cost.reshape(starts.shape[:2])
        lowest = np.argmin(costs, axis=0), np.arange(len(start))
        distances = np.sqrt(np.maximum(2 * (costs[lowest] - cost) / variance, 0))
        return distances, minima.u.reshape(starts.shape)[lowest]

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


def judge(data, candidate, noise, settings, curve: Hemispherical, quality) -> dict:
    """Standard errors, intervals, verdicts and correlations of a candidate's parameters.

    The cost has no curvature in a parameter at its bound or in one that a restriction holds. Its
    standard error is half the width of its interval.

    Parameters
    ----------
    data
        The `Data` of the fit.
    candidate
        The chosen `FittedVariant` at its minimum.
    noise
        The `Noise` that the candidate leaves.
    settings
        The `FitSettings`.
    curve
        The emissivity that is predicted from the parameters.
    quality
        The `Quality` of the fit.

    Returns
    -------
    dict
        standard_error, interval and verdict by parameter name, the correlation matrix (n, n),
        standard errors and 95 % intervals of the emissivity at the angles of the curve, and 95 %
        intervals of the fitted BRDF at the points.
    """
    model, u = candidate.variant.model, candidate.u
    residuals = data.residuals(candidate.variant)
    slopes = residuals(u[None])[1][0]
    decade = data.per_decade(residuals.instrument(u[None])[0][0])
    level = np.hypot(noise.level_dex, (settings.calibration or 0) / np.log(10)) * decade
    near = Linearized(model, u, slopes, noise.variance, level)
    matrix, values = near.covariance(), near.parameters
    dof = max(noise.effective - candidate.size, LEAST_DOF)
    intervals = profile_intervals(near, candidate.residuals, candidate.cost, noise.curvature, dof)
    bounds, at_bounds = np.stack(model.feasible_range(values), axis=1), model.bound_names(u)
    errors = np.where(
        [name is not None for name in at_bounds] | (np.diag(matrix) == 0),
        0.5 * (intervals[:, 1] - intervals[:, 0]),
        standard_errors(model, matrix),
    )
    # Where another parameter has no slope at its bound, the interval shows what the slopes do not
    shown = np.abs(intervals - values[:, None]).max(axis=1) / student_factor(dof)
    errors = np.where(shown > CURVED * errors, shown, errors)
    is_drawn = noise.has_outliers(data.points) and not settings.robust
    felt = replace(near, level=decade * CALIBRATION / np.log(10)).level_shift() > FELT * errors
    doubt = Doubt(quality.missed, bool(data.directional), noise.outliers if is_drawn else 0)
    verdicts = [
        verdict(*row, replace(doubt, of_level=settings.calibration is None and is_felt))
        for *row, is_felt in zip(model.parameters, values, intervals, bounds, at_bounds, felt)
    ]
    emissivity_error, ends = curve_errors(near, curve, dof, intervals)
    _, decades = curve_errors(near, logarithm_of(residuals.instrument), dof, intervals)
    return {
        "standard_error": dict(zip(model.names, errors.tolist())),
        "interval": {name: tuple(pair) for name, pair in zip(model.names, intervals.tolist())},
        "verdict": dict(zip(model.names, verdicts)),
        "correlation": correlation(matrix),
        "emissivity_error": emissivity_error,
        "emissivity_interval": np.clip(ends, 0, 1),
        "brdf_interval": 10**decades,
    }


def curve_errors(near: Linearized, curve, dof: float, intervals) -> tuple:
    """Standard errors (a,) and 95 % intervals (a, 2) of a curve that a fit predicts.

    They are linear in the coordinates. A parameter at its bound may have no slope there. What it
    changes at the other end of its interval (n, 2) is added in squares on its side. curve: a
    function of coordinates (1, n) that returns values (1, a) and derivatives (1, a, n).
    """
    values, slopes = (array[0] for array in curve(near.u[None]))
    variance = near.variance_of(slopes)
    width = student_factor(dof) * np.sqrt(variance)
    best, squares = near.parameters, np.stack([width**2, width**2])
    for k, bound in enumerate(near.model.bound_names(near.u)):
        if bound is None:
            continue
        moved = best.copy()
        moved[k] = max(intervals[k], key=lambda end: abs(end - best[k]))
        moved = near.model.nearest_feasible(moved, k)
        change = curve(near.model.to_cube([moved]))[0][0] - values
        squares += np.stack([np.minimum(change, 0), np.maximum(change, 0)]) ** 2
        variance = variance + (change / 2) ** 2
    below, above = np.sqrt(squares)
    return np.sqrt(variance), np.stack([values - below, values + above], axis=1)


def logarithm_of(curve):
    """log10 of a curve, and its derivatives, as `curve_errors` takes them."""

    def logarithm(u):
        values, slopes = curve(u)
        values = np.maximum(values, 1e-30)
        return np.log10(values), slopes / (values[..., None] * np.log(10))

    return logarithm


@dataclass
class Doubt:
    """Properties of a fit on which the verdicts on all of its parameters depend.

    missed: what the model misses, in words, or "". joint: whether a directional table was fitted
    with the BRDF. outliers: number of outliers that had full weight and are worth reporting.
    of_level: whether the verdict holds only if the common factor of all readings is right.
    """

    missed: str
    joint: bool
    outliers: int
    of_level: bool = False


def verdict(
    parameter: ModelParameter, value: float, interval, bounds, at_bound: str | None, doubt: Doubt
) -> str:
    """The verdict on one parameter, in one line.

    parameter, value: its description and fitted value. interval, bounds: its 95 % interval and its
    feasible range (low, high). at_bound: name of the bound on which it lies, or None. doubt: what
    concerns the whole fit.
    """
    (low, high), (lowest, highest) = interval, bounds
    span = f"{low:.3g}..{high:.3g}"
    advice = f"; {parameter.advice}" if parameter.advice and not doubt.joint else ""
    if parameter.at_lower and low <= NEAR_LOWER * lowest:
        return Verdict.ONE_SIDED.sentence(what=parameter.at_lower.format(high=high))
    precision = max(parameter.precision * value, parameter.absolute_precision)
    is_precise = 0.5 * (high - low) <= precision
    result = Verdict.of(high - low, highest - lowest, at_bound is not None, is_precise)
    if doubt.outliers and result in (Verdict.DETERMINED, Verdict.WEAK):
        result = Verdict.WEAK
        advice = f", drawn by {doubt.outliers} outliers; try {option('robust', True)}"
    if doubt.missed and Verdict.has_interval(result):
        return Verdict.MISSED.sentence(what=doubt.missed) + advice
    sentence = result.sentence(span=span, bound=at_bound)
    if doubt.of_level and result is not Verdict.WIDE:
        sentence += LEVEL
    return sentence if result is Verdict.DETERMINED else sentence + advice

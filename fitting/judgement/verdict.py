"""The uncertainty of each parameter of a fit, in numbers and as a verdict in words."""

from dataclasses import dataclass

import numpy as np

from mi_lcair.errors import option
from mi_lcair.fitting.judgement.uncertainty import (
    Linearized,
    profile_intervals,
    standard_errors,
)
from mi_lcair.fitting.model import Hemispherical
from mi_lcair.physics.estimation.profiles import correlation, student_factor
from mi_lcair.physics.estimation.verdicts import Verdict
from mi_lcair.physics.reflection.interface import ModelParameter

# An interval that begins below this multiple of the lower bound is said to reach the bound.
NEAR_LOWER = 1.5
# Smallest number of degrees of freedom. Correlated residuals can leave fewer, for which Student's t
# is very large.
LEAST_DOF = 3
# Number of independent BRDF points below which the model is said to miss whole scans.
LEAST_EFFECTIVE = 10
# Outliers are reported if they are more than the share MANY_OUTLIERS of the points, and if the
# correlation of neighbours is below SCATTERED, so that they are single points.
MANY_OUTLIERS, SCATTERED = 0.01, 0.3


def judge(data, candidate, noise, robust: bool, curve: Hemispherical) -> dict:
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
    robust
        Whether outliers were given little weight.
    curve
        The emissivity that is predicted from the parameters.

    Returns
    -------
    dict
        standard_error, interval and verdict by parameter name, the correlation matrix (n, n),
        standard errors and 95 % intervals of the emissivity at the angles of the curve, and 95 %
        intervals of the fitted BRDF at the points.
    """
    model, u = candidate.variant.model, candidate.u
    residuals = data.residuals(candidate.variant)
    near = Linearized(
        model=model,
        u=u,
        free=candidate.variant.free,
        slopes=residuals(u[None])[1][0],
        variance=noise.variance,
        level=data.per_decade(residuals.instrument(u[None])[0][0]) * noise.level_dex,
    )
    matrix, values = near.covariance(), near.parameters
    dof = max(noise.effective - candidate.size, LEAST_DOF)
    intervals = profile_intervals(near, candidate.residuals, candidate.cost, noise.curvature, dof)
    bounds, at_bounds = np.stack(model.feasible_range(values), axis=1), model.bound_names(u)
    errors = np.where(
        [name is not None for name in at_bounds] | (np.diag(matrix) == 0),
        0.5 * (intervals[:, 1] - intervals[:, 0]),
        standard_errors(model, matrix),
    )
    many = noise.outliers > MANY_OUTLIERS * data.points and noise.correlation < SCATTERED
    outliers = noise.outliers if many and not robust else 0
    doubt = Doubt(noise.brdf_effective < LEAST_EFFECTIVE, bool(data.directional), outliers)
    verdicts = [
        verdict(*row, doubt) for row in zip(model.parameters, values, intervals, bounds, at_bounds)
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

    misses: whether the model misses whole scans. joint: whether a directional table was fitted with
    the BRDF. outliers: number of outliers that had full weight and are worth reporting.
    """

    misses: bool
    joint: bool
    outliers: int


def verdict(
    parameter: ModelParameter, value: float, interval, bounds, at_bound: str | None, doubt: Doubt
) -> str:
    """The verdict on one parameter, in words.

    Parameters
    ----------
    parameter
        The model's description of the parameter.
    value
        Its fitted value.
    interval, bounds
        Its 95 % interval and its feasible range (low, high).
    at_bound
        Name of the bound on which it lies, or None.
    doubt
        Properties of the whole fit.

    Returns
    -------
    str
        The verdict, in one line.
    """
    (low, high), (lowest, highest) = interval, bounds
    span = f"{low:.3g}..{high:.3g}"
    advice = f"; {parameter.advice}" if parameter.advice and not doubt.joint else ""
    if doubt.misses and not (parameter.advice and doubt.joint):
        return Verdict.MISSED.sentence(what="whole scans") + advice
    if parameter.at_lower and low <= NEAR_LOWER * lowest:
        return Verdict.ONE_SIDED.sentence(what=parameter.at_lower.format(high=high))
    precision = max(parameter.precision * value, parameter.absolute_precision)
    is_precise = 0.5 * (high - low) <= precision
    result = Verdict.of(high - low, highest - lowest, at_bound is not None, is_precise)
    if doubt.outliers and result in (Verdict.DETERMINED, Verdict.WEAK):
        result = Verdict.WEAK
        advice = f", drawn by {doubt.outliers} outliers; try {option('robust', True)}"
    sentence = result.sentence(span=span, bound=at_bound)
    return sentence if result is Verdict.DETERMINED else sentence + advice

"""What is known of each parameter, in numbers and in words."""

from dataclasses import dataclass

import numpy as np

from mi_lcair.fitting.cube import parameters_at
from mi_lcair.fitting.uncertainty import (
    correlation,
    covariance,
    level_shift,
    profile_intervals,
    standard_errors,
)
from mi_lcair.physics.reflection.interface import Parameter

UNDETERMINED = 0.5  # the interval, relative to the feasible range
NEAR_LOWER = 1.5  # an interval that begins below this multiple of the lower bound reaches it
LEAST_DOF = 3  # keeps Student's t finite where the misfit leaves few independent points
LEAST_EFFECTIVE = 10  # independent points; fewer, and the model misses whole scans
MANY_OUTLIERS, SCATTERED = (
    0.01,
    0.3,
)  # share of the points, and correlation of neighbours below which they are single


def judge(data, candidate, noise, robust: bool) -> dict:
    """standard_error, interval and verdict by parameter, and the correlation matrix, of a fitted
    candidate.

    A parameter at its bound, or one that a restriction holds, has no curvature: its standard error
    is half the interval's width.
    """
    u, model, free = candidate.u, candidate.variant.model, candidate.variant.free
    residuals = data.residuals(candidate.variant)
    slopes = residuals(u[None])[1][0]
    level = data.per_decade(residuals.instrument(u[None])[0][0]) * noise.level_dex
    matrix = covariance(model, slopes, u, free, noise.variance, level)
    alone = covariance(model, slopes, u, free, noise.variance, 0 * level)
    dof = max(noise.effective - candidate.size, LEAST_DOF)
    intervals = profile_intervals(
        model,
        candidate.residuals,
        u,
        candidate.cost,
        free,
        alone,
        noise.variance * noise.curvature,
        dof,
        level_shift(model, slopes, u, free, noise.variance, level),
    )
    values = parameters_at(model, u[None])[0][0]
    bounds, at_bounds = np.stack(model.feasible_range(values), axis=1), model.bound_names(u)
    errors = np.where(
        [name is not None for name in at_bounds] | (np.diag(matrix) == 0),
        0.5 * (intervals[:, 1] - intervals[:, 0]),
        standard_errors(model, matrix),
    )
    doubt = Doubt(
        misses=noise.brdf_effective < LEAST_EFFECTIVE,
        joint=bool(data.directional),
        outliers=noise.outliers
        * (
            not robust
            and noise.outliers > MANY_OUTLIERS * data.points
            and noise.correlation < SCATTERED
        ),
    )
    verdicts = [
        verdict(*row, doubt) for row in zip(model.parameters, values, intervals, bounds, at_bounds)
    ]
    return {
        "standard_error": dict(zip(model.names, errors.tolist())),
        "interval": {name: tuple(pair) for name, pair in zip(model.names, intervals.tolist())},
        "verdict": dict(zip(model.names, verdicts)),
        "correlation": correlation(matrix),
    }


@dataclass
class Doubt:
    """What all verdicts of a fit depend on: the model misses whole scans; a directional table was
    fitted with the BRDF; number of outliers that count in full.
    """

    misses: bool
    joint: bool
    outliers: int


def verdict(
    parameter: Parameter, value: float, interval, bounds, at_bound: str | None, doubt: Doubt
) -> str:
    """One parameter's verdict in words; at_bound: name of the bound that it lies on, or None."""
    (low, high), (lowest, highest) = interval, bounds
    span = f"{low:.3g}..{high:.3g}"
    advice = f"; {parameter.advice}" if parameter.advice and not doubt.joint else ""
    half = 0.5 * (high - low)
    if doubt.misses and not (parameter.advice and doubt.joint):
        return f"not determined by these data: the model misses whole scans{advice}"
    if parameter.at_lower and low <= NEAR_LOWER * lowest:
        return f"not determined by these data: {parameter.at_lower.format(high=high)}"
    if high - low >= UNDETERMINED * (highest - lowest):
        return f"not determined by these data: anything in {span} fits{advice}"
    if at_bound:
        return f"at its bound {at_bound}: interval {span}{advice}"
    if doubt.outliers:
        return (
            f"weakly determined: interval {span}, drawn by {doubt.outliers} outliers; try --robust"
        )
    if half <= max(parameter.precision * value, parameter.absolute_precision):
        return "determined"
    return f"weakly determined: interval {span}{advice}"

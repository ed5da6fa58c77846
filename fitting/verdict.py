"""What is known of each parameter, in numbers and in words."""

from dataclasses import dataclass

import numpy as np

from mi_lcair.fitting.parameters import E_MIN, NAMES, feasible_range, parameters_at
from mi_lcair.fitting.uncertainty import (
    correlation,
    covariance,
    level_shift,
    profile_intervals,
    standard_errors,
)

DETERMINED = {
    "epsilon": 0.1,
    "rho_d": 0.25,
    "b": 0.25,
    "e": 0.25,
}  # half the interval, relative to the value
DETERMINED_EPSILON = 0.025  # or absolute
UNDETERMINED = 0.5  # the interval, relative to the feasible range
LEAST_DOF = 3  # keeps Student's t finite where the misfit leaves few independent points
LEAST_EFFECTIVE = 10  # independent points; fewer, and the model misses whole scans
MANY_OUTLIERS, SCATTERED = (
    0.01,
    0.3,
)  # share of the points, and correlation of neighbours below which they are single


def judge(data, candidate, noise, robust: bool) -> dict:
    """standard_error, interval and verdict by parameter, and the correlation matrix, of a fitted
    candidate.

    A parameter at its bound has no curvature there: its standard error is half the interval's
    width.
    """
    u, residuals = candidate.u, candidate.residuals
    slopes = data.residuals(candidate.form)(u[None])[1][0]
    level = (
        data.per_decade(data.residuals(candidate.form).instrument(u[None])[0][0]) * noise.level_dex
    )
    matrix = covariance(slopes, u, candidate.free, noise.variance, level)
    alone = covariance(slopes, u, candidate.free, noise.variance, 0 * level)
    dof = max(noise.effective - candidate.size, LEAST_DOF)
    intervals = profile_intervals(
        residuals,
        u,
        candidate.cost,
        candidate.free,
        alone,
        noise.variance * noise.curvature,
        dof,
        level_shift(slopes, u, candidate.free, noise.variance, level),
    )
    values = parameters_at(u[None])[0][0]
    bounds, names = np.stack(feasible_range(values[2]), axis=1), bound_names(u)
    errors = np.where(
        [name is not None for name in names],
        0.5 * (intervals[:, 1] - intervals[:, 0]),
        standard_errors(matrix),
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
        verdict(name, *row, doubt) for name, *row in zip(NAMES, values, intervals, bounds, names)
    ]
    return {
        "standard_error": dict(zip(NAMES, errors.tolist())),
        "interval": {name: tuple(pair) for name, pair in zip(NAMES, intervals.tolist())},
        "verdict": dict(zip(NAMES, verdicts)),
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


def bound_names(u) -> list[str | None]:
    """For each parameter the bound that it lies on, or None. epsilon + rho_d = G(b) leaves nothing
    for the lobe.
    """
    full = "epsilon + rho_d = G(b)" if u[1] >= 1 else None
    return [
        "0" if u[0] <= 0 else full,
        "0" if u[1] <= 0 else full,
        {0: "0", 1: "1"}.get(u[2]),
        {0: f"{E_MIN:g}", 1: "1"}.get(u[3]),
    ]


def verdict(name: str, value: float, interval, bounds, at_bound: str | None, doubt: Doubt) -> str:
    """One parameter's verdict in words; at_bound: the name of the bound that it lies on, or None."""
    (low, high), (lowest, highest) = interval, bounds
    span = f"{low:.3g}..{high:.3g}"
    measure = "; measure it and give --emissivity" if name == "epsilon" and not doubt.joint else ""
    half = 0.5 * (high - low)
    if doubt.misses and not (name == "epsilon" and doubt.joint):
        return f"not determined by these data: the model misses whole scans{measure}"
    if name == "e" and low <= 1.5 * E_MIN:
        return f"not determined by these data: any lobe narrower than {high:.3g} fits"
    if high - low >= UNDETERMINED * (highest - lowest):
        return f"not determined by these data: anything in {span} fits{measure}"
    if at_bound:
        return f"at its bound {at_bound}: interval {span}{measure}"
    if doubt.outliers:
        return (
            f"weakly determined: interval {span}, drawn by {doubt.outliers} outliers; try --robust"
        )
    if half <= DETERMINED[name] * value or (name == "epsilon" and half <= DETERMINED_EPSILON):
        return "determined"
    return f"weakly determined: interval {span}{measure}"

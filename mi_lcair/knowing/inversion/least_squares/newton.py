"""Gauss-Newton steps between two renders, within bounds and with what is known beforehand.

What is known of facets of a group, or of nodes of a spectrum, is that near ones are alike.

Second derivatives of predictions are learned from the renders that an iteration makes anyway. The
prediction is linear in the blackbody radiances of sources, and their products with material
parameters bend it: a wall's (1 - R) B(T) is the same along a curve of R and T. A step along such a
valley leaves it at once without second derivatives.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from mi_lcair.errors import InputError
from mi_lcair.knowing.inversion.least_squares.prediction import (
    DatumBlock,
    Equations,
    change_of_gradient,
    cost_of,
    equations,
)
from mi_lcair.knowing.inversion.unknowns import Unknown, base_name
from mi_lcair.physics.blackbody import brightness_temperature, in_band_radiance, in_band_slope

MOST_FACETS = 2000  # facets with a correlation, whose equations are dense
NUGGET = 1e-6  # share of the variance that each facet has for itself, so that inverses exist
LARGEST = 30_000_000  # second derivatives of a datum above which they are left out
INNER = 50  # largest number of steps between two renders
SMALLEST = 0.1  # least factor by which a step changes a blackbody radiance
CONVERGED = 0.02  # largest last step, in standard errors, see `length`
PROBE = 0.1  # share of a step with which it is found how the prediction bends along it
ROUNDING = 1e-8  # change of the cost, relative or absolute, that is none
FALL = 0.9  # ratio of the squared residuals after a step and before it that is a success
HALVINGS = 12  # attempts to shorten a step that raises the cost, or that no surface can have


def matern(distance: np.ndarray, length: float) -> np.ndarray:
    """Correlation of values at a distance for a correlation length, in the same unit.

    Matern's with the parameter 3/2, whose fields have one derivative (Rasmussen and Williams 2006,
    Eq. 4.17).
    """
    scaled = np.sqrt(3) * distance / length
    return (1 + scaled) * np.exp(-scaled)


def precision(unknowns: list[Unknown], sigma: np.ndarray) -> np.ndarray | None:
    """Inverse covariance (N, N) that is known beforehand; None without correlated facets.

    Facets of one group and state correlate by the straight distance of their centres. sigma:
    standard deviations (N,). Raises InputError for too many facets.
    """
    groups = {}
    for k, unknown in enumerate(unknowns):
        if unknown.correlation_m:
            groups.setdefault((base_name(unknown), unknown.data, unknown.correlation_m), []).append(
                k
            )
    if not groups:
        return None
    if len(unknowns) > MOST_FACETS:
        raise InputError(
            f"correlation_m with {len(unknowns)} unknowns; at most {MOST_FACETS} are possible: "
            "use a coarser model, or leave it out"
        )
    result = np.diag(sigma**-2.0)
    for (_, _, length), numbers in groups.items():
        centre = np.array([unknowns[k].centre for k in numbers])
        distance = np.linalg.norm(centre[:, None] - centre, axis=-1)
        correlation = (matern(distance, length) + NUGGET * np.eye(len(numbers))) / (1 + NUGGET)
        of_group = np.outer(sigma[numbers], sigma[numbers]) * correlation
        result[np.ix_(numbers, numbers)] = np.linalg.inv(of_group)
    return result


def bent(block: DatumBlock, other: DatumBlock) -> DatumBlock:
    """A block whose second derivatives explain the first ones at the values of another block.

    Of the derivatives that do, those with the smallest change of what the block knows are taken
    (Powell's symmetric update of quasi-Newton methods, for each value), where they are 0 between
    two temperatures that are followed. The columns are scaled to the same norm before.
    """
    size = len(block.columns) * len(block.measured) * len(block.unknown) ** 2
    is_large = any(sparse.issparse(of.columns[0]) for of in (block, other)) or size > LARGEST
    if is_large or not block.learns_curvature:
        return block
    (u, rate), (other_u, other_rate) = (of.rendered_coordinates for of in (block, other))
    J, other_J = np.array(block.columns) / rate, np.array(other.columns) / other_rate
    known = 0.0 if block.curvature is None else block.curvature
    moved = other_u - u
    missing = other_J - J
    if block.curvature is not None:
        missing -= block.curvature @ moved
    scale = np.linalg.norm(J, axis=(0, 1))
    scale[scale == 0] = 1
    missing, moved = missing / scale, moved * scale
    curved = np.where(block.is_temperature, 0.0, moved)
    squared = curved @ curved
    if squared == 0:
        return block
    y = missing - (missing @ (moved - curved))[..., None] * curved / squared
    outer = y[..., None] * curved
    total = outer + outer.swapaxes(-1, -2)
    total -= (y @ curved)[..., None, None] * np.outer(curved, curved) / squared
    return replace(block, curvature=known + total / squared * np.outer(scale, scale))


@dataclass(frozen=True)
class Prior:
    """Means and inverse variances (N,) that are known beforehand, and the bounds (N,).

    correlated: inverse covariance (N, N) in place of the inverse variances.
    """

    mean: np.ndarray
    information: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    correlated: np.ndarray | None = None

    @staticmethod
    def of(unknowns: list[Unknown]) -> "Prior":
        known = [unknown.prior or (unknown.start, unknown.span) for unknown in unknowns]
        mean, sigma = np.array(known, dtype=float).T
        lower, upper = np.array([(unknown.lower, unknown.upper) for unknown in unknowns]).T
        # A temperature must be above its bound, and blackbodies below 1 K radiate nothing
        lower = np.where(
            [unknown.unit == "K" for unknown in unknowns], np.maximum(lower, 1.0), lower
        )
        return Prior(mean, sigma**-2.0, lower, upper, precision(unknowns, sigma))

    @property
    def matrix(self) -> np.ndarray:
        """Inverse covariance (N, N)."""
        return np.diag(self.information) if self.correlated is None else self.correlated

    def times(self, step: np.ndarray) -> np.ndarray:
        """Inverse covariance times a step, (N,)."""
        return self.information * step if self.correlated is None else self.correlated @ step

    def cost(self, x) -> float:
        return float((x - self.mean) @ self.times(x - self.mean))


def minimiser(
    blocks: list[DatumBlock], start, prior: Prior, damping: float, is_sparse: bool
) -> np.ndarray:
    """The values that minimise the cost of blocks rendered at `start`, with damping toward it."""
    x, first = start, equations(blocks, start, is_sparse)
    pressure = first.pressure(prior.information)
    damped = damping * (np.maximum(first.information.diagonal(), 0) + prior.information)

    def weighed(x, there: Equations | None = None) -> tuple[Equations, float]:
        """The equations at x, weighed by the same noise at all of them, and what a step lowers."""
        normal = (there or equations(blocks, x, is_sparse)).weighed_as(first)
        added = prior.cost(x) + damped @ (x - start) ** 2
        return normal, pressure(normal) + added

    def misfit(x) -> float:
        return cost_of(blocks, x) + prior.cost(x)

    normal, cost = weighed(x, first)
    for _ in range(INNER):
        step, bend = second_order(blocks, x, start, normal, prior, damped)
        steps = [s * step + s**2 * bend for s in 0.5 ** np.arange(HALVINGS)]
        tried = []
        for share in steps:
            new = np.clip(followed(blocks, x, share), prior.lower, prior.upper)
            tried.append(new)
            ahead, ahead_cost = weighed(new)
            if ahead_cost <= cost * (1 + ROUNDING) + ROUNDING or is_sparse:
                break
        else:
            # Far from the solution a gradient may grow on the way, where a derivative was 0
            new = min(tried, key=misfit)
            if misfit(new) > FALL * misfit(x):
                return x  # no step in this direction lowers the cost
            ahead, ahead_cost = weighed(new)
        moved = length(new - x, normal, prior)
        x, normal, cost = new, ahead, ahead_cost
        if moved < CONVERGED / 10:
            break
    return x


def undamped(normal: Equations, prior: Prior, x: np.ndarray, damped=0.0, start=None) -> np.ndarray:
    """The Gauss-Newton step (N,) from x, damped toward `start`.

    An unknown at its bound moves only if it is still pulled inward when the others have moved.
    """
    toward = 0.0 if start is None else damped * (start - x)
    g = normal.pull + prior.times(prior.mean - x) + toward
    step, left, free = np.zeros(len(x)), g, np.zeros(len(x), dtype=bool)
    while True:
        inward = ~((x <= prior.lower) & (left < 0) | (x >= prior.upper) & (left > 0))
        if not (inward & ~free).any():
            return step
        free |= inward
        step = solved(normal, prior, damped, g, free)
        left = g - normal.information @ step - prior.times(step) - damped * step


def second_order(
    blocks, x, start, normal: Equations, prior: Prior, damped
) -> tuple[np.ndarray, np.ndarray]:
    """The damped step (N,) from x, and the geodesic acceleration (N,) that bends it.

    A step of share t goes to t step + t^2 acceleration: it follows a curved valley to second order
    (Transtrum and Sethna 2012, arXiv:1201.5885).
    """
    step = undamped(normal, prior, x, damped, start)
    if sparse.issparse(normal.matrix):
        return step, np.zeros(len(x))
    change = change_of_gradient(blocks, x, followed(blocks, x, PROBE * step))
    change -= PROBE * normal.matrix @ step
    bend = -normal.transfer @ change / PROBE**2
    return step, solved(normal, prior, damped, bend, step != 0)


def followed(blocks: list[DatumBlock], x: np.ndarray, step: np.ndarray) -> np.ndarray:
    """x + step, (N,), where temperatures follow the blackbody radiance in which data are linear.

    A step that would make a radiance negative leaves SMALLEST of it.
    """
    new = x + step
    for block in blocks:
        hot = block.unknown[block.is_temperature]
        if not len(hot):
            continue
        T = x[hot]
        radiance = in_band_radiance(block.band, T)
        wanted = radiance + in_band_slope(block.band, T) * step[hot]
        new[hot] = brightness_temperature(block.band, np.maximum(wanted, SMALLEST * radiance))
    return new


def length(step: np.ndarray, normal: Equations, prior: Prior) -> float:
    """Length of a step in standard errors: the square root of the change of cost that it makes.

    A step along a direction that the data do not determine is short.
    """
    squared = step @ (normal.information @ step) + step @ prior.times(step)
    return float(np.sqrt(max(squared, 0)))


def solved(normal: Equations, prior: Prior, damping, right, free) -> np.ndarray:
    """Solution (N,) of the damped equations for the free unknowns."""
    result = np.zeros(len(right))
    if not sparse.issparse(normal.matrix):
        both = normal.information + prior.matrix + np.diag(damping + np.zeros(len(right)))
        both = both[np.ix_(free, free)]
        # Along a valley the matrix may be singular to within rounding
        scale = 1 / np.sqrt(np.diag(both))
        scaled = both * np.outer(scale, scale)
        try:
            result[free] = scale * np.linalg.solve(scaled, scale * right[free])
        except np.linalg.LinAlgError:
            result[free] = scale * np.linalg.lstsq(scaled, scale * right[free])[0]
        return result
    # Facets of which the data know less than the prior have but noise in the matrix
    informed = free & is_informed(normal, prior.information)
    both = (normal.matrix + sparse.diags_array(prior.information + damping))[informed][:, informed]
    result[informed] = splu(sparse.csc_array(both)).solve(right[informed])
    return result


def is_informed(normal: Equations, information: np.ndarray) -> np.ndarray:
    """Unknowns (N,) of a sparse problem of which the data know more than the prior."""
    noise = normal.noise.diagonal()
    of_data = np.divide(
        normal.matrix.diagonal() ** 2, noise, out=np.zeros(len(noise)), where=noise > 0
    )
    return (of_data > information) & (normal.matrix.diagonal() > 0)

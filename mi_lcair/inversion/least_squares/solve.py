"""Gauss-Newton with Levenberg-Marquardt damping on unbiased normal equations.

An unknown without a prior gets a weak one: its first guess, with the width of the interval in which
it lies before any measurement (`Unknown.span`). It is negligible for what the data determine, and
keeps what they do not determine near the first guess.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from mi_lcair.errors import InputError
from mi_lcair.inversion.data.images import slope
from mi_lcair.inversion.least_squares.bad_pixels import Search
from mi_lcair.inversion.least_squares.curvature import bent
from mi_lcair.inversion.least_squares.prediction import (
    DatumBlock,
    Equations,
    change_of_gradient,
    cost_of,
    equations,
    hidden,
    without,
)
from mi_lcair.inversion.unknowns import Unknown
from mi_lcair.physics.blackbody import brightness_temperature, in_band_radiance

FIRST_DAMPING, LEAST_DAMPING, MOST_DAMPING = 1e-3, 1e-12, 1e8
INNER = 50  # largest number of steps between two renders
SMALLEST = 0.1  # least factor by which a step changes a blackbody radiance
# Relative change of a predicted value after which a datum that holds for all values is rendered
# once more at the solution, where its paths go to what is bright there.
FAR = 0.5
NEAR = 3.0  # length of a step, in standard errors, up to which the gradient decides about it
CONVERGED = 0.02  # largest last step, in standard errors, see `length`
UNRESOLVED = 0.2  # the same where the noise of the render hides it; it adds 2 % to an error
PROBE = 0.1  # share of a step with which it is found how the prediction bends along it
HALVINGS = 12  # attempts to shorten a step that no surface can have
# Columns of the inverse of a sparse matrix that are computed together. With a hundred or more,
# SuperLU starts threads that take far longer than the solution.
CHUNK = 32


@dataclass(frozen=True)
class Step:
    """Values that an iteration tried.

    renders: number of renders of each datum so far. paths: paths of all of them. step_sigmas:
    length of the undamped step from these values to the solution, in standard errors. chi_square:
    weighted squared residuals there. is_kept: whether the iteration went on from these values.
    values: (N,).
    """

    renders: int
    paths: int
    step_sigmas: float
    chi_square: float
    is_kept: bool
    values: list[float]


@dataclass(frozen=True)
class State:
    """An estimate.

    x: values (N,). blocks: the data's predictions, rendered at or near x. equations: the normal
    equations at x. prior: inverse variances (N,). covariance: (N, N). render_share: part of each
    variance that the noise of the render makes, (N,). at_bound: -1 or 1 where a value lies at its
    lower or upper bound, else 0. held: unknowns whose derivatives the noise of the render hides, so
    that they stay at the first guess, (N,). renders: number of renders of each datum.
    converged: whether the last step was small. trace: all values that were tried.
    """

    x: np.ndarray
    blocks: list[DatumBlock]
    equations: Equations
    prior: np.ndarray
    covariance: np.ndarray
    render_share: np.ndarray
    at_bound: np.ndarray
    held: np.ndarray
    renders: int
    converged: bool
    trace: list[Step]


@dataclass(frozen=True)
class Prior:
    """Means and inverse variances (N,) that are known beforehand, and the bounds (N,)."""

    mean: np.ndarray
    information: np.ndarray
    lower: np.ndarray
    upper: np.ndarray

    @staticmethod
    def of(unknowns: list[Unknown]) -> "Prior":
        known = [unknown.prior or (unknown.start, unknown.span) for unknown in unknowns]
        mean, sigma = np.array(known, dtype=float).T
        lower, upper = np.array([(unknown.lower, unknown.upper) for unknown in unknowns]).T
        # A temperature must be above its bound, and blackbodies below 1 K radiate nothing
        lower = np.where(
            [unknown.unit == "K" for unknown in unknowns], np.maximum(lower, 1.0), lower
        )
        return Prior(mean, sigma**-2.0, lower, upper)

    def cost(self, x) -> float:
        return float(np.sum(self.information * (x - self.mean) ** 2))


def solve(
    unknowns: list[Unknown],
    render: Callable[[np.ndarray], list[DatumBlock]],
    weigh: Callable[[np.ndarray], list[np.ndarray]],
    is_exact: bool,
    iterations: int,
    progress=None,
) -> State:
    """The estimate of the unknowns.

    Parameters
    ----------
    unknowns : list of Unknown
    render : callable
        Gives the blocks of all data at values x, (N,). Raises InputError for values that no surface
        can have.
    weigh : callable
        Gives the weights of all data at values x, (N,), see `Datum.weight`.
    is_exact : bool
        Whether the blocks of one render hold for all values.
    iterations : int
        Largest number of renders of each datum.
    progress : callable or None
        Called with the number of renders that are done and the largest number.

    Returns
    -------
    State
    """
    prior = Prior.of(unknowns)
    x = np.clip([unknown.start for unknown in unknowns], prior.lower, prior.upper)
    is_sparse = all(unknown.kind == "facet" for unknown in unknowns)
    done, trace = 0, []

    held = np.zeros(len(x), dtype=bool)

    def rendered(x):
        nonlocal done
        blocks = [without(block, held) for block in render(x)]
        done += 1
        if progress:
            progress(done, 1 if is_exact else iterations)
        return blocks

    def noted(blocks, x, is_kept=True) -> float:
        normal = equations(blocks, x, is_sparse)
        whole = length(undamped(normal, prior, x), normal, prior)
        paths = done * sum(block.paths for block in blocks)
        trace.append(Step(done, paths, whole, cost_of(blocks, x), is_kept, x.tolist()))
        return whole

    start, weights = x, weigh(x)
    blocks = rendered(x)
    search, is_first, is_searching = Search(blocks), True, True
    while is_searching:
        blocks = search.weighed(blocks, weights)
        if is_first:
            held = hidden(blocks, len(x))
        blocks = [without(block, held) for block in blocks]
        if is_exact:
            noted(blocks, x)
            x, converged = nearest(blocks, x, prior, is_sparse)
        else:
            x, blocks, converged = descent(
                blocks, x, prior, is_sparse, rendered, noted, lambda: done >= iterations
            )
        is_far = length(x - start, equations(blocks, x, is_sparse), prior) >= 1
        # Weights at the first guess are not the best ones, so they are found once more
        is_searching = is_first and is_far
        if converged:
            is_searching |= search.continues(blocks, x, weights)
        is_first = False
        if is_searching and is_far:
            start, weights = x, weigh(x)
            if is_exact and max(block.change(x) for block in blocks) > FAR:
                blocks = rendered(x)
    if is_exact:
        noted(blocks, x)
    result = state(blocks, x, prior, is_sparse)
    return replace(result, held=held, renders=done, converged=converged, trace=trace)


def nearest(blocks, x, prior: Prior, is_sparse: bool) -> tuple[np.ndarray, bool]:
    """The values that minimise the cost of blocks that hold for all values, and convergence."""
    for _ in range(INNER):
        new = near(blocks, x, prior, 0.0, is_sparse)
        moved, x = length(new - x, equations(blocks, new, is_sparse), prior), new
        if moved < CONVERGED:
            return x, True
    return x, False


def descent(blocks, x, prior: Prior, is_sparse: bool, rendered, noted, is_over) -> tuple:
    """Levenberg-Marquardt steps, each with a render: values, blocks there, and convergence.

    Far from the solution the cost decides whether a step is kept. Near it, the noise of the render
    hides the change of the cost, and the gradient decides, which is 0 at the solution.

    rendered: gives the blocks at values. noted: traces blocks at values, and gives the length of
    the undamped step from there, since a damped step is short far from the solution too. is_over:
    whether no further render is allowed.
    """
    damping, largest = FIRST_DAMPING, CONVERGED
    whole = noted(blocks, x)
    while damping <= MOST_DAMPING:
        normal = equations(blocks, x, is_sparse)
        if whole < largest or is_over():
            return x, blocks, whole < largest
        new, trial = feasible(rendered, x, near(blocks, x, prior, damping, is_sparse))
        if trial is None:
            damping *= 10
            continue
        is_near = whole <= NEAR
        near_by = normal if is_near else None
        predicted = cost_change(blocks, x, blocks, new, prior, near_by)
        trial = [
            replace(block, weight=old.weight, curvature=old.curvature)
            for block, old in zip(trial, blocks)
        ]
        if length(new - x, normal, prior) > NEAR:
            # The noise of the render hides what a shorter step says about second derivatives
            trial = [bent(block, old) for block, old in zip(trial, blocks)]
            blocks = [replace(old, curvature=block.curvature) for block, old in zip(trial, blocks)]
        change = cost_change(blocks, x, trial, new, prior, near_by)
        # Far from the solution the change of the cost is noisy
        is_kept = change < (0 if is_near else whole**2)
        ahead = noted(trial, new, is_kept)
        if is_kept:
            x, blocks, whole = new, trial, ahead
        # A step that should have come nearer and did not shows how near the noise of the render,
        # which is another one at other values, lets the iteration come
        largest = CONVERGED if is_kept or whole > NEAR else UNRESOLVED
        if change < predicted / 2 < 0:
            damping /= 1000  # the step went as it was predicted
        else:
            damping = damping / 10 if change < 0 else max(10 * damping, FIRST_DAMPING)
        damping = max(damping, LEAST_DAMPING)
    return x, blocks, False


def cost_change(
    blocks: list[DatumBlock], x, trial: list[DatumBlock], new, prior: Prior, normal
) -> float:
    """Change of the cost from blocks at x to blocks at new values.

    With normal equations at x it is that of the gradient, which noise of the render disturbs less.
    """
    change = prior.cost(new) - prior.cost(x)
    if normal is None:
        return change + cost_of(trial, new) - cost_of(blocks, x)
    there = equations(trial, new, sparse.issparse(normal.matrix))
    return change + normal.pressure(there) - normal.pressure(normal)


def state(blocks, x, prior: Prior, is_sparse: bool) -> State:
    """The State at the values x, without what the iteration alone knows."""
    normal = equations(blocks, x, is_sparse)
    outward = normal.pull + prior.information * (prior.mean - x)
    margin = 1e-9 * np.maximum(np.abs(x), 1)
    at_bound = np.where(
        (x <= prior.lower + margin) & (outward < 0),
        -1,
        np.where((x >= prior.upper - margin) & (outward > 0), 1, 0),
    )
    covariance, measured = covariances(normal, prior.information)
    variance = np.diag(covariance)
    return State(
        x=x,
        blocks=blocks,
        equations=normal,
        prior=prior.information,
        covariance=covariance,
        render_share=np.clip(1 - measured / variance, 0, 1),
        at_bound=at_bound,
        held=np.zeros(len(x), dtype=bool),
        renders=0,
        converged=False,
        trace=[],
    )


def feasible(rendered, x, new):
    """(values, blocks) of the longest of some shorter steps that a surface can have.

    (x, None) if there is none.
    """
    for _ in range(HALVINGS):
        try:
            return new, rendered(new)
        except InputError:
            new = (x + new) / 2
    return x, None


def near(
    blocks: list[DatumBlock], start, prior: Prior, damping: float, is_sparse: bool
) -> np.ndarray:
    """The values that minimise the cost of blocks rendered at `start`, with damping toward it."""
    x, normal = start, equations(blocks, start, is_sparse)
    noise = normal.noise
    damped = damping * (np.maximum(normal.information.diagonal(), 0) + prior.information)

    def weighed(x) -> tuple[Equations, float]:
        """The equations at x, weighed by the same noise at all of them, and what a step lowers."""
        normal = replace(equations(blocks, x, is_sparse), noise=noise)
        added = prior.cost(x) + damped @ (x - start) ** 2
        return normal, normal.pressure(normal) + added

    normal, cost = weighed(x)
    for _ in range(INNER):
        step, bend = second_order(blocks, x, start, normal, prior, damped)
        for share in 0.5 ** np.arange(HALVINGS):
            new = followed(blocks, x, share * step + share**2 * bend)
            new = np.clip(new, prior.lower, prior.upper)
            ahead, ahead_cost = weighed(new)
            if ahead_cost <= cost or is_sparse:
                break
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
    g = normal.pull + prior.information * (prior.mean - x) + toward
    step, left, free = np.zeros(len(x)), g, np.zeros(len(x), dtype=bool)
    while True:
        inward = ~((x <= prior.lower) & (left < 0) | (x >= prior.upper) & (left > 0))
        if not (inward & ~free).any():
            return step
        free |= inward
        step = solved(normal, prior, damped, g, free)
        left = g - normal.information @ step - (prior.information + damped) * step


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
        wanted = radiance + slope(block.band, T) * step[hot]
        new[hot] = brightness_temperature(block.band, np.maximum(wanted, SMALLEST * radiance))
    return new


def length(step: np.ndarray, normal: Equations, prior: Prior) -> float:
    """Length of a step in standard errors: the square root of the change of cost that it makes.

    A step along a direction that the data do not determine is short.
    """
    squared = step @ (normal.information @ step) + np.sum(prior.information * step**2)
    return float(np.sqrt(max(squared, 0)))


def solved(normal: Equations, prior: Prior, damping, right, free) -> np.ndarray:
    """Solution (N,) of the damped equations for the free unknowns."""
    diagonal, result = prior.information + damping, np.zeros(len(right))
    if not sparse.issparse(normal.matrix):
        both = normal.information[np.ix_(free, free)] + np.diag(diagonal[free])
        result[free] = np.linalg.solve(both, right[free])
        return result
    # Facets of which the data know less than the prior have but noise in the matrix
    informed = free & is_informed(normal, prior.information)
    both = (normal.matrix + sparse.diags_array(diagonal))[informed][:, informed]
    result[informed] = splu(sparse.csc_array(both)).solve(right[informed])
    return result


def is_informed(normal: Equations, information: np.ndarray) -> np.ndarray:
    """Unknowns (N,) of a sparse problem of which the data know more than the prior."""
    noise = normal.noise.diagonal()
    of_data = np.divide(
        normal.matrix.diagonal() ** 2, noise, out=np.zeros(len(noise)), where=noise > 0
    )
    return (of_data > information) & (normal.matrix.diagonal() > 0)


def covariances(normal: Equations, information: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Covariance (N, N) of the estimate, and its variances (N,) without the render's noise.

    information: inverse variances (N,) of the prior.
    """
    if not sparse.issparse(normal.matrix):
        inverse = np.linalg.inv(normal.information + np.diag(information))
        spread = inverse @ normal.transfer
        measured = spread @ normal.measured_noise @ spread.T
        return inverse, np.diag(measured) + inverse**2 @ information
    covariance, variance = np.diag(1 / information), 1 / information
    some = np.flatnonzero(is_informed(normal, information))
    if not len(some):
        return covariance, variance

    def part(matrix):
        return sparse.csr_array(matrix)[some][:, some]

    prior = sparse.diags_array(information[some])
    factor = splu(sparse.csc_array(part(normal.matrix) + prior))
    inverse = np.empty((len(some), len(some)))
    for first in range(0, len(some), CHUNK):
        unit = np.eye(len(some), min(CHUNK, len(some) - first), -first)
        inverse[:, first : first + CHUNK] = factor.solve(unit)
    covariance[np.ix_(some, some)] = inverse @ ((part(normal.noise) + prior) @ inverse.T)
    measured = (part(normal.measured_noise) + prior) @ inverse.T
    variance[some] = np.einsum("ij,ji->i", inverse, measured)
    return covariance, variance

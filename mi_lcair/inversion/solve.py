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
from mi_lcair.inversion.prediction import Block, Equations, cost_of, equations
from mi_lcair.inversion.unknowns import Unknown

FIRST_DAMPING, LEAST_DAMPING, MOST_DAMPING = 1e-3, 1e-12, 1e8
INNER = 50  # largest number of steps between two renders
CONVERGED = 0.02  # largest last step, in standard errors, see `length`
HALVINGS = 12  # attempts to shorten a step that no surface can have
CHUNK = 256  # columns of the inverse of a sparse matrix that are computed together


@dataclass(frozen=True)
class State:
    """An estimate.

    x: values (N,). blocks: the data's predictions, rendered at or near x. equations: the normal
    equations at x. prior: inverse variances (N,). covariance: (N, N). at_bound: -1 or 1 where a
    value lies at its lower or upper bound, else 0. renders: number of renders of each datum.
    converged: whether the last step was small.
    """

    x: np.ndarray
    blocks: list[Block]
    equations: Equations
    prior: np.ndarray
    covariance: np.ndarray
    at_bound: np.ndarray
    renders: int
    converged: bool


@dataclass(frozen=True)
class Prior:
    """Means and inverse variances (N,) that are known beforehand, and the bounds (N,)."""

    mean: np.ndarray
    information: np.ndarray
    lower: np.ndarray
    upper: np.ndarray

    @staticmethod
    def of(unknowns: list[Unknown]) -> "Prior":
        known = [one.prior or (one.start, one.span) for one in unknowns]
        mean, sigma = np.array(known, dtype=float).T
        lower, upper = np.array([(one.lower, one.upper) for one in unknowns]).T
        # A temperature must be above its bound, and blackbodies below 1 K radiate nothing
        lower = np.where([one.unit == "K" for one in unknowns], np.maximum(lower, 1.0), lower)
        return Prior(mean, sigma**-2.0, lower, upper)

    def cost(self, x) -> float:
        return float(np.sum(self.information * (x - self.mean) ** 2))


def solve(
    unknowns: list[Unknown],
    render: Callable[[np.ndarray], list[Block]],
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
    x = np.clip([one.start for one in unknowns], prior.lower, prior.upper)
    is_sparse = all(one.kind == "facet" for one in unknowns)
    done = 0

    def rendered(x):
        nonlocal done
        blocks = render(x)
        done += 1
        if progress:
            progress(done, 1 if is_exact else iterations)
        return blocks

    start = x
    blocks = rendered(x)
    while True:
        first = x
        blocks = [replace(block, weight=weight) for block, weight in zip(blocks, weigh(x))]
        if is_exact:
            x, converged = near(blocks, x, prior, 0.0, is_sparse), True
        else:
            x, blocks, converged = descent(
                blocks, x, prior, is_sparse, rendered, lambda: done >= iterations
            )
        # Weights at the first guess are not the best ones, so they are found once more
        if first is not start or length(x - start, equations(blocks, x, is_sparse), prior) < 1:
            return state(blocks, x, prior, is_sparse, done, converged)


def descent(blocks, x, prior: Prior, is_sparse: bool, rendered, is_over) -> tuple:
    """Levenberg-Marquardt steps, each with a render: values, blocks there, and convergence.

    rendered: gives the blocks at values. is_over: whether no further render is allowed.
    """
    damping = FIRST_DAMPING
    while damping <= MOST_DAMPING:
        new = near(blocks, x, prior, damping, is_sparse)
        moved = length(new - x, equations(blocks, x, is_sparse), prior)
        if moved < CONVERGED or is_over():
            return x, blocks, moved < CONVERGED
        new, trial = feasible(rendered, x, new)
        if trial is None:
            damping *= 10
            continue
        trial = [replace(block, weight=old.weight) for block, old in zip(trial, blocks)]
        before = cost_of(blocks, x) + prior.cost(x)
        after = cost_of(trial, new) + prior.cost(new)
        # A worse step of less than a tenth of a standard error is rounding and noise of the render
        if after < before or moved < 0.1:
            x, blocks, damping = new, trial, max(damping / 10, LEAST_DAMPING)
        else:
            damping *= 10
    return x, blocks, False


def state(blocks, x, prior: Prior, is_sparse: bool, renders: int, converged: bool) -> State:
    """The State at the values x."""
    found = equations(blocks, x, is_sparse)
    outward = found.gradient + prior.information * (prior.mean - x)
    margin = 1e-9 * np.maximum(np.abs(x), 1)
    at_bound = np.where(
        (x <= prior.lower + margin) & (outward < 0),
        -1,
        np.where((x >= prior.upper - margin) & (outward > 0), 1, 0),
    )
    return State(
        x=x,
        blocks=blocks,
        equations=found,
        prior=prior.information,
        covariance=covariance(found, prior.information),
        at_bound=at_bound,
        renders=renders,
        converged=converged,
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


def near(blocks: list[Block], start, prior: Prior, damping: float, is_sparse: bool) -> np.ndarray:
    """The values that minimise the cost of blocks rendered at `start`, with damping toward it."""
    x = start
    for _ in range(INNER):
        found = equations(blocks, x, is_sparse)
        D = damping * (np.maximum(found.matrix.diagonal(), 0) + prior.information)
        g = found.gradient + prior.information * (prior.mean - x) + D * (start - x)
        free = ~((x <= prior.lower) & (g < 0) | (x >= prior.upper) & (g > 0))
        step = np.zeros(len(x))
        step[free] = solved(found.matrix, prior.information + D, g, free)
        new = np.clip(x + step, prior.lower, prior.upper)
        moved, x = length(new - x, found, prior), new
        if moved < CONVERGED / 10:
            break
    return x


def length(step: np.ndarray, found: Equations, prior: Prior) -> float:
    """Length of a step in standard errors: the square root of the change of cost that it makes.

    A step along a direction that the data do not determine is short.
    """
    squared = step @ (found.matrix @ step) + np.sum(prior.information * step**2)
    return float(np.sqrt(max(squared, 0)))


def solved(matrix, diagonal, right, free) -> np.ndarray:
    """Solution of (matrix + diag(diagonal)) y = right for the free unknowns."""
    if sparse.issparse(matrix):
        both = (matrix + sparse.diags_array(diagonal))[free][:, free]
        return splu(sparse.csc_array(both)).solve(right[free])
    return np.linalg.solve(
        positive(matrix[np.ix_(free, free)]) + np.diag(diagonal[free]), right[free]
    )


def positive(matrix: np.ndarray) -> np.ndarray:
    """The symmetric matrix without negative eigenvalues, which noise gives it."""
    matrix = (matrix + matrix.T) / 2
    scale = np.sqrt(np.maximum(np.diag(matrix), 0))
    scale[scale == 0] = 1
    values, vectors = np.linalg.eigh(matrix / np.outer(scale, scale))
    if values[0] >= 0:
        return matrix
    return np.outer(scale, scale) * ((vectors * np.maximum(values, 0)) @ vectors.T)


def covariance(found: Equations, information: np.ndarray) -> np.ndarray:
    """Covariance (N, N) of the estimate: noise of the measurement, of the render, and the prior.

    It is M^-1 (middle + prior) M^-T with M = matrix + prior. `middle` has the noise of the
    derivatives in it, so that it counts too.
    """
    if not sparse.issparse(found.matrix):
        inverse = np.linalg.inv(positive(found.matrix) + np.diag(information))
        return inverse @ (found.middle + np.diag(information)) @ inverse.T
    count = len(information)
    factor = splu(sparse.csc_array(found.matrix + sparse.diags_array(information)))
    inverse = np.empty((count, count))
    for first in range(0, count, CHUNK):
        some = np.arange(first, min(first + CHUNK, count))
        right = np.zeros((count, len(some)))
        right[some, np.arange(len(some))] = 1
        inverse[:, some] = factor.solve(right)
    middle = found.middle + sparse.diags_array(information)
    return inverse @ (middle @ inverse.T)


def measurement_variance(state: State) -> np.ndarray:
    """Variances (N,) without the noise of the render's radiance."""
    found = state.equations
    if sparse.issparse(found.matrix):
        inverse = state.covariance  # the middle is nearly the matrix itself
    else:
        inverse = np.linalg.inv(positive(found.matrix) + np.diag(state.prior))
    middle = found.measured_middle
    if sparse.issparse(middle):
        middle = middle + sparse.diags_array(state.prior)
    else:
        middle = middle + np.diag(state.prior)
    return np.einsum("ij,ij->i", inverse, (middle @ inverse.T).T)

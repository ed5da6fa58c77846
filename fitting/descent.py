"""Down to the minimum of a sum of squares over the cube, from many starts at once.

`explore` walks by gradient descent to the bottom of a basin's slope, `levenberg_marquardt` goes on
to the minimum itself. Both hand all starts to one call of the residuals; what remains per start is
a system of n equations, one for each coordinate.
"""

from dataclasses import dataclass

import drjit as dr
import numpy as np
from drjit.llvm.ad import Float64
from drjit.opt import Adam

STEPS, LEARNING_RATE = 5, 0.3  # of `explore`
ROUND_OFF = 1e-12  # gradient / (|column of the Jacobian| |rows|)
FINEST = 1e-4  # decades; rows count as at least this when the gradient is compared with them
SNAP = 1e-6  # a coordinate this close to its bound may step onto it


@dataclass
class Minima:
    """Where each of m starts ended: u (m, n), cost (m,) = half the sum of squares, gradient (m,):
    its largest component along the coordinates that can move, relative to |column of the Jacobian|
    |rows|.
    """

    u: np.ndarray
    cost: np.ndarray
    gradient: np.ndarray


def explore(residuals, u: np.ndarray, free=True, steps: int = STEPS) -> np.ndarray:
    """u (m, n) after some steps of gradient descent (Adam) in logit(u): no step leaves the cube.

    free: which coordinates move.
    """
    inside = np.clip(u, 1e-4, 1 - 1e-4)
    descent = Adam(
        lr=LEARNING_RATE, params={"logit": Float64(np.log(inside / (1 - inside)).ravel())}
    )
    for _ in range(steps):
        here = 1 / (1 + dr.exp(-descent["logit"]))
        rows, slopes = residuals(np.where(free, here.numpy().reshape(u.shape), u))
        gradient = np.einsum("nr,nrk->nk", rows, slopes) * free
        dr.backward(dr.dot(here, Float64(gradient.ravel())))
        descent.step()
    here = 1 / (1 + np.exp(-descent["logit"].numpy().reshape(u.shape)))
    return np.where(free, here, u)


def levenberg_marquardt(
    residuals, u: np.ndarray, free=True, iterations: int = 100, tolerance: float = ROUND_OFF
) -> Minima:
    """The minimum in the cube below each of the starts u (m, n); a bound is reached exactly and
    left again if need be.

    tolerance: a start is done when its relative gradient falls below it, when its cost stops
    falling (by less than tolerance squared of itself), or when its rows are below it, in decades.
    Where costs differ by round-off only, the gradient decides whether a step was good. Starts that
    are done are not evaluated any more.
    """
    u, free, identity = u.copy(), np.broadcast_to(free, u.shape), np.eye(u.shape[1])
    rows, slopes = residuals(u, np.arange(len(u)))
    cost, normal, gradient = normal_equations(rows, slopes)
    decades = 0.5 * rows.shape[1] * residuals.unit**2  # cost of one decade in each row
    norm = relative_gradient(u, cost + FINEST**2 * decades, normal, gradient, free)
    damping, growth = np.full(len(u), 1e-3), np.full(len(u), 2.0)
    active = np.flatnonzero(norm > tolerance)
    for _ in range(iterations):
        if not len(active):
            break
        scale = damping[active, None] * diagonal(normal[active])
        damped = normal[active] + scale[..., None] * identity
        trial = box_step(damped, gradient[active], u[active], free[active])
        step = trial - u[active]
        model = gradient[active] + 0.5 * np.einsum("nij,nj->ni", normal[active], step)
        predicted = -np.einsum("ni,ni->n", model, step)
        rows, slopes = residuals(trial, active)
        new_cost, new_normal, new_gradient = normal_equations(rows, slopes)
        gain = np.clip((cost[active] - new_cost) / np.maximum(predicted, 1e-200), -1, 2)
        new_norm = relative_gradient(
            trial, new_cost + FINEST**2 * decades, new_normal, new_gradient, free[active]
        )
        level = np.abs(cost[active] - new_cost) <= 1e-12 * cost[active]
        better = np.where(level, new_norm < norm[active], new_cost < cost[active])
        took, kept = active[better], active[~better]
        stalled = ~level & better & (cost[active] - new_cost <= tolerance**2 * cost[active])
        u[took], cost[took], normal[took], gradient[took] = (
            trial[better],
            new_cost[better],
            new_normal[better],
            new_gradient[better],
        )
        damping[took] *= np.where(
            level[better], 1 / 10, np.maximum(1 / 10, 1 - (2 * gain[better] - 1) ** 3)
        )
        growth[took] = 2
        damping[kept] *= growth[kept]
        growth[kept] *= 2
        norm[took] = new_norm[better]
        done = (norm[active] < tolerance) | stalled | (cost[active] < tolerance**2 * decades)
        done |= (np.max(np.abs(step), axis=1) < 1e-15) | (damping[active] > 1e16)
        active = active[~done]
    return Minima(u, cost, norm)


def normal_equations(rows, slopes):
    """Half the sum of squares (m,), J^T J (m, n, n) and J^T r (m, n)."""
    transposed = slopes.swapaxes(1, 2)
    return (
        0.5 * np.einsum("nr,nr->n", rows, rows),
        transposed @ slopes,
        (transposed @ rows[..., None])[..., 0],
    )


def diagonal(matrices):
    return np.maximum(np.einsum("nii->ni", matrices), 1e-12)


def held(u, gradient, free):
    """Coordinates that cannot move: not free, or pressed against a bound by the gradient."""
    return ~free | ((u <= 0) & (gradient >= 0)) | ((u >= 1) & (gradient <= 0))


def relative_gradient(u, cost, normal, gradient, free):
    columns = np.einsum("nii->ni", normal)
    columns = np.maximum(
        columns, 1e-16 * columns.max(axis=1, keepdims=True)
    )  # a coordinate without effect is at rest
    size = np.sqrt(np.maximum(columns * 2 * cost[:, None], 1e-300))
    return np.max(np.where(held(u, gradient, free), 0, np.abs(gradient)) / size, axis=1)


def box_step(matrix, gradient, u, free):
    """u + step that minimizes gradient step + step matrix step / 2 without leaving the cube (active
    set).

    A step takes at most nine tenths of the way to a bound: a straight leap to a face of the cube
    often ends in a minimum on it which is not the one that a smaller step finds. Within SNAP of a
    bound the next step may reach it.
    """
    lowest = np.where(u > SNAP, 0.1 * u, 0)
    highest = np.where(u < 1 - SNAP, 1 - 0.1 * (1 - u), 1)
    fixed = held(u, gradient, free)
    step = np.zeros_like(u)
    coordinates = u.shape[1]
    for _ in range(coordinates + 1):  # each round but the last fixes one coordinate or more
        system = np.where(fixed[:, :, None] | fixed[:, None, :], 0, matrix)
        system = system + fixed[:, :, None] * np.eye(coordinates)
        known = np.einsum("nij,nj->ni", matrix, np.where(fixed, step, 0))
        step = np.where(
            fixed, step, np.linalg.solve(system, (-gradient - known)[..., None])[..., 0]
        )
        beyond = ~fixed & ((u + step < lowest) | (u + step > highest))
        if not beyond.any():
            break
        step = np.where(beyond, np.clip(u + step, lowest, highest) - u, step)
        fixed = fixed | beyond
    return np.clip(u + step, lowest, highest)

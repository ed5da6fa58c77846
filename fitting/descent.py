"""Minimization of a sum of squares over the unit cube, from many starts at once.

`explore` takes a few steps of gradient descent into a basin. `levenberg_marquardt` then finds the
minimum. Both evaluate the residuals of all starts in one call. For each start there remains a
system of n linear equations, one for each coordinate.
"""

from dataclasses import dataclass

import drjit as dr
import numpy as np
from drjit.llvm.ad import Float64
from drjit.opt import Adam

STEPS, LEARNING_RATE = 5, 0.3  # steps and learning rate of `explore`
# Relative gradient, gradient / (|column of the Jacobian| |rows|), at which only round-off is left.
ROUND_OFF = 1e-12
FINEST = 1e-4  # smallest residual [decades] with which the gradient is compared
SNAP = 1e-6  # distance from a bound within which a step may end on the bound


@dataclass
class Minima:
    """The minima that m starts led to.

    Attributes
    ----------
    u
        Coordinates, (m, n).
    cost
        Half the sum of squares, (m,).
    gradient
        Largest component of the relative gradient along the coordinates that can move, (m,). It is
        relative to |column of the Jacobian| |rows|.
    """

    u: np.ndarray
    cost: np.ndarray
    gradient: np.ndarray


def explore(residuals, u: np.ndarray, free=True, steps: int = STEPS) -> np.ndarray:
    """Take some steps of gradient descent (Adam) from each start.

    The steps are taken in logit(u), so that none leaves the cube.

    Parameters
    ----------
    residuals
        Function of coordinates u (m, n) that returns rows (m, r) and derivatives (m, r, n).
    u
        Starts, (m, n).
    free
        Mask of the coordinates that move.
    steps
        Number of steps.

    Returns
    -------
    numpy.ndarray
        Coordinates after the steps, (m, n).
    """
    inside = np.clip(u, 1e-4, 1 - 1e-4)
    descent = Adam(
        lr=LEARNING_RATE, params={"logit": Float64(np.log(inside / (1 - inside)).ravel())}
    )
    for _ in range(steps):
        point = 1 / (1 + dr.exp(-descent["logit"]))
        rows, slopes = residuals(np.where(free, point.numpy().reshape(u.shape), u))
        gradient = np.einsum("nr,nrk->nk", rows, slopes) * free
        # The scalar product has the gradient of the cost. Dr.Jit carries it back to the logits.
        dr.backward(dr.dot(point, Float64(gradient.ravel())))
        descent.step()
    final = 1 / (1 + np.exp(-descent["logit"].numpy().reshape(u.shape)))
    return np.where(free, final, u)


def levenberg_marquardt(
    residuals, u: np.ndarray, free=True, iterations: int = 100, tolerance: float = ROUND_OFF
) -> Minima:
    """Find the minimum in the cube below each start, by the Levenberg-Marquardt method.

    A coordinate can reach a bound exactly, and can leave it again in a later step.

    Parameters
    ----------
    residuals
        Function of coordinates u (k, n) and indices of k starts. It returns rows (k, r) and their
        derivatives (k, r, n). Its attribute `unit` is the change of a typical row for one decade of
        the BRDF.
    u
        Starts, (m, n).
    free
        Mask of the coordinates that move, (n,) or (m, n).
    iterations
        Largest number of steps.
    tolerance
        A start is finished when its relative gradient is below `tolerance`, when a step lowers its
        cost by less than the relative amount tolerance^2, or when its rows are below `tolerance`
        decades. Finished starts are not evaluated again.

    Returns
    -------
    Minima
        One minimum for each start.
    """
    u, free, identity = u.copy(), np.broadcast_to(free, u.shape), np.eye(u.shape[1])
    rows, slopes = residuals(u, np.arange(len(u)))
    cost, normal, gradient = normal_equations(rows, slopes)
    decades = 0.5 * rows.shape[1] * residuals.unit**2  # cost if each row were off by one decade
    norm = relative_gradient(u, cost + FINEST**2 * decades, normal, gradient, free)
    damping, growth = np.full(len(u), 1e-3), np.full(len(u), 2.0)
    active = np.flatnonzero(norm > tolerance)
    for _ in range(iterations):
        if not len(active):
            break
        # The step solves the damped normal equations within the cube.
        scale = damping[active, None] * diagonal(normal[active])
        damped = normal[active] + scale[..., None] * identity
        trial = box_step(damped, gradient[active], u[active], free[active])
        step = trial - u[active]
        # The quadratic model predicts how far this step lowers the cost.
        model = gradient[active] + 0.5 * np.einsum("nij,nj->ni", normal[active], step)
        predicted = -np.einsum("ni,ni->n", model, step)
        rows, slopes = residuals(trial, active)
        new_cost, new_normal, new_gradient = normal_equations(rows, slopes)
        gain = np.clip((cost[active] - new_cost) / np.maximum(predicted, 1e-200), -1, 2)
        new_norm = relative_gradient(
            trial, new_cost + FINEST**2 * decades, new_normal, new_gradient, free[active]
        )
        # Where the costs differ by round-off only, the gradient decides whether the step is
        # accepted.
        level = np.abs(cost[active] - new_cost) <= 1e-12 * cost[active]
        better = np.where(level, new_norm < norm[active], new_cost < cost[active])
        accepted, rejected = active[better], active[~better]
        stalled = ~level & better & (cost[active] - new_cost <= tolerance**2 * cost[active])
        u[accepted], cost[accepted], normal[accepted], gradient[accepted] = (
            trial[better],
            new_cost[better],
            new_normal[better],
            new_gradient[better],
        )
        # A rejected step raises the damping, each time by a larger factor (Nielsen 1999).
        damping[accepted] *= np.where(level[better], 1 / 10, easing(gain[better]))
        growth[accepted] = 2
        damping[rejected] *= growth[rejected]
        growth[rejected] *= 2
        norm[accepted] = new_norm[better]
        done = (norm[active] < tolerance) | stalled | (cost[active] < tolerance**2 * decades)
        done |= (np.max(np.abs(step), axis=1) < 1e-15) | (damping[active] > 1e16)
        active = active[~done]
    return Minima(u, cost, norm)


def easing(gain):
    """Factor of the damping after a step with this ratio of actual to predicted gain (Nielsen)."""
    return np.maximum(1 / 10, 1 - (2 * gain - 1) ** 3)


def normal_equations(rows, slopes):
    """Half the sum of squares (m,), J^T J (m, n, n) and J^T r (m, n)."""
    transposed = slopes.swapaxes(1, 2)
    return (
        0.5 * np.einsum("nr,nr->n", rows, rows),
        transposed @ slopes,
        (transposed @ rows[..., None])[..., 0],
    )


def diagonal(matrices):
    """Diagonals (m, n) of matrices (m, n, n), at least 1e-12."""
    return np.maximum(np.einsum("nii->ni", matrices), 1e-12)


def held(u, gradient, free):
    """Mask of the coordinates that cannot move.

    They are not free, or lie on a bound beyond which the cost would fall.
    """
    return ~free | ((u <= 0) & (gradient >= 0)) | ((u >= 1) & (gradient <= 0))


def relative_gradient(u, cost, normal, gradient, free):
    """Largest relative component of the gradient along coordinates that can move, (m,)."""
    columns = np.einsum("nii->ni", normal)
    # The lower limit gives a coordinate without effect on the rows a gradient of about 0.
    columns = np.maximum(columns, 1e-16 * columns.max(axis=1, keepdims=True))
    size = np.sqrt(np.maximum(columns * 2 * cost[:, None], 1e-300))
    return np.max(np.where(held(u, gradient, free), 0, np.abs(gradient)) / size, axis=1)


def box_step(matrix, gradient, u, free):
    """u + step, where the step minimizes gradient . step + step . matrix step / 2 within the cube.

    The method is an active set. A step takes at most nine tenths of the way to a bound. A longer
    step, straight to a face of the cube, often leads to another minimum, on that face. Within SNAP
    of a bound the next step may reach it.

    Parameters
    ----------
    matrix
        Damped normal matrices, (m, n, n).
    gradient
        Gradients of the cost, (m, n).
    u
        Coordinates, (m, n).
    free
        Mask of the coordinates that move, (m, n).

    Returns
    -------
    numpy.ndarray
        Coordinates after the step, (m, n).
    """
    lowest = np.where(u > SNAP, 0.1 * u, 0)
    highest = np.where(u < 1 - SNAP, 1 - 0.1 * (1 - u), 1)
    fixed = held(u, gradient, free)
    step = np.zeros_like(u)
    coordinates = u.shape[1]
    for _ in range(coordinates + 1):  # each round but the last fixes at least one coordinate
        # Rows and columns of fixed coordinates become those of the unit matrix.
        system = np.where(fixed[:, :, None] | fixed[:, None, :], 0, matrix)
        system = system + fixed[:, :, None] * np.eye(coordinates)
        known = np.einsum("nij,nj->ni", matrix, np.where(fixed, step, 0))
        step = np.where(
            fixed, step, np.linalg.solve(system, (-gradient - known)[..., None])[..., 0]
        )
        # Coordinates that would pass their limit are fixed at it; the rest is solved again.
        beyond = ~fixed & ((u + step < lowest) | (u + step > highest))
        if not beyond.any():
            break
        step = np.where(beyond, np.clip(u + step, lowest, highest) - u, step)
        fixed = fixed | beyond
    return np.clip(u + step, lowest, highest)

"""The estimate of a twin: least squares by Gauss and Newton, intervals, and the test of its fit."""

from dataclasses import dataclass

import numpy as np
from scipy import linalg, stats

from mi_lcair.knowing.twin.model import Twin, TwinCourse
from mi_lcair.physics.estimation.verdicts import (
    SIGNIFICANCE,
    profile_ends,
    student_factor,
)

MOST_STEPS, CLOSE = 15, 0.1  # iterations, and the decrease of chi-square at which they end
FLAT = 0.5  # increase of chi-square that the drift of days may make
HALVINGS = 5  # shorter steps that are tried
WIDTH = student_factor(np.inf)
LITTLE = 0.7  # ratio to the standard deviation beforehand above which the data add little
STRAIGHT = 0.15  # relative error of a linear interval from which it is replaced
SETTLINGS = 2  # steps of what does not change the course
HELD_STEPS = 2  # iterations of the others while one unknown is held
MOST_MEANS = 1500  # means of the residuals that are tested together


@dataclass(frozen=True)
class MeanResiduals:
    """Means of the residuals by datum, time and group.

    residual: (s,), in the unit of the datum. matrix: its derivatives, (s, p). variance, per_kelvin:
    of its noise, and its change if all facets are warmer by 1 K, (s,). of: datum, hour, group.
    """

    residual: np.ndarray
    matrix: np.ndarray
    variance: np.ndarray
    per_kelvin: np.ndarray
    of: list[tuple[str, float, int]]

    def kelvin(self, twin: Twin, z: np.ndarray) -> np.ndarray:
        """What is left with the errors of instruments but not that of the balance, (s,) [K]."""
        model = twin.places["model"]
        return (self.residual + self.matrix[:, model] @ z[model]) / self.per_kelvin


@dataclass(frozen=True)
class TwinState:
    """A point of the iteration: z, course, cost, and the normal equations of the data there.

    information: (p, p). gradient: of the data, (p,).
    """

    z: np.ndarray
    course: TwinCourse
    cost: float
    information: np.ndarray
    gradient: np.ndarray


@dataclass(frozen=True)
class TwinEstimate:
    """The estimate z with its covariance (p, p), and ends (K, 2) of the intervals of x.

    means, before: see `MeanResiduals`; with the first guess. p_value: of the fit of the means.
    """

    state: TwinState
    covariance: np.ndarray
    ends: np.ndarray
    means: MeanResiduals
    before: MeanResiduals
    p_value: float
    converged: bool


def evaluated(
    twin: Twin, z: np.ndarray, like: TwinCourse | None = None, course: TwinCourse | None = None
) -> TwinState:
    """The state at z. like: see `Twin.course`. course: that at z, if it is known."""
    course = course or twin.course(z, like)
    information, gradient = np.zeros((len(z),) * 2), np.zeros(len(z))
    apart = z - twin.mean
    cost = apart @ twin.precision @ apart
    for row in twin.rows(course, z):
        of_row, slope, chi_square = row.normal()
        cost += chi_square
        np.add.at(information, np.ix_(row.entries, row.entries), of_row)
        np.add.at(gradient, row.entries, slope)
    return TwinState(z, course, float(cost), information, gradient)


def settled(twin: Twin, state: TwinState) -> TwinState:
    """The state with all but the unknowns at their best, on which its course does not depend."""
    for _ in range(SETTLINGS):
        step = step_of(twin, state, range(len(twin.unknowns)))
        state = evaluated(twin, state.z + step, course=state.course)
    return state


def step_of(twin: Twin, state: TwinState, held=()) -> np.ndarray:
    """The step of Gauss and Newton, (p,). held: unknowns that stay.

    Unknowns at a bound that the step would leave stay there.
    """
    p, K = len(state.z), len(twin.unknowns)
    gradient = state.gradient - twin.precision @ (state.z - twin.mean)
    normal = state.information + twin.precision
    free = ~np.isin(np.arange(p), held)
    low, high = twin.limits
    for _ in range(K + 1):
        index = np.flatnonzero(free)
        factor = linalg.cho_factor(normal[np.ix_(index, index)])
        step = np.zeros(p)
        step[index] = linalg.cho_solve(factor, gradient[index])
        x, dx = state.z[:K], step[:K]
        is_out = free[:K] & ((x <= low) & (dx < 0) | (x >= high) & (dx > 0))
        if not is_out.any():
            break
        free[:K] &= ~is_out
    return step


def decrease(twin: Twin, state: TwinState, step: np.ndarray) -> float:
    """Decrease of the cost that a step promises."""
    return float(step @ (state.gradient - twin.precision @ (state.z - twin.mean)))


def clipped(twin: Twin, z: np.ndarray) -> np.ndarray:
    """z with unknowns within their bounds."""
    K = len(twin.unknowns)
    return np.append(np.clip(z[:K], *twin.limits), z[K:])


def descended(twin: Twin, state: TwinState, most: int, held=(), like=None, progress=None):
    """The state after at most some steps, and whether it moves no more.

    held: unknowns that stay. like: course whose derivatives are taken as they are.
    """
    for number in range(most):
        step = step_of(twin, state, held)
        if decrease(twin, state, step) < CLOSE:
            return state, True
        for halving in range(HALVINGS):
            z = clipped(twin, state.z + step / 3**halving)
            trial = evaluated(twin, z, like)
            if trial.cost > state.cost:
                trial = settled(twin, trial)
            if like or trial.cost <= state.cost + FLAT:
                break
        else:
            return state, False
        state = trial
        if progress:
            progress(number + 1, most)
    return state, decrease(twin, state, step_of(twin, state, held)) < CLOSE


def estimated(twin: Twin, starts: int = 1, progress=None) -> TwinEstimate:
    """The estimate from the best of several first guesses."""
    random, K, found = np.random.default_rng(0), len(twin.unknowns), []
    guess = evaluated(twin, clipped(twin, np.zeros(len(twin.mean))))
    before = means_of(twin, guess)
    for number in range(starts):
        first = guess
        if number:
            z, sigma = np.zeros(len(twin.mean)), np.array([u.sigma for u in twin.unknowns])
            z[:K] = twin.mean[:K] + sigma * random.standard_normal(K)
            first = evaluated(twin, clipped(twin, z))
        found.append(descended(twin, first, MOST_STEPS, progress=progress))
    state, converged = min(found, key=lambda pair: pair[0].cost)
    covariance = np.linalg.inv(state.information + twin.precision)
    means = means_of(twin, state)
    p = p_value(twin, state, means)
    ends = intervals(twin, state, covariance, p >= SIGNIFICANCE)
    return TwinEstimate(state, covariance, ends, means, before, p, converged)


def means_of(twin: Twin, state: TwinState) -> MeanResiduals:
    """Means of the residuals of each block and group with their derivatives."""
    found = []
    data = twin.data(state.course)
    places = ((datum.name, float(hour)) for datum in data for hour in datum.hours)
    for row, place in zip(twin.rows(state.course, state.z), places):
        block = row.block
        for part in np.unique(block.part):
            w = np.where(block.part == part, block.weight, 0.0)
            share = w / w.sum()
            matrix = row.mean(share, len(state.z))
            by_facet = share @ block.facets
            variance = 1 / w.sum() + np.sum((by_facet * row.facet_error) ** 2)
            value, warmer = share @ block.residual, by_facet.sum()
            found.append((value, matrix, variance, warmer, (*place, int(part))))
    *columns, of = zip(*found[:: -(-len(found) // MOST_MEANS)])
    return MeanResiduals(*map(np.array, columns), list(of))


def p_value(twin: Twin, state: TwinState, means: MeanResiduals) -> float:
    """Probability of means that are farther from what was expected beforehand, by chance.

    Unknowns at a bound cannot explain more than they do there.
    """
    K, covariance = len(twin.unknowns), np.linalg.inv(twin.precision)
    is_at_bound = np.isin(state.z[:K], twin.limits)
    matrix = means.matrix * np.append(~is_at_bound, np.ones(len(state.z) - K))
    apart = means.residual + matrix @ (state.z - twin.mean)
    of_means = matrix @ covariance @ matrix.T + np.diag(means.variance)
    chi_square = apart @ linalg.solve(of_means, apart, assume_a="pos")
    return float(stats.chi2.sf(chi_square, len(apart)))


def intervals(
    twin: Twin, state: TwinState, covariance: np.ndarray, is_fit: bool = True
) -> np.ndarray:
    """Ends (K, 2) of the 95 % intervals of x; by the profile where the cost is curved.

    They are linear where the data say little, and if the model does not fit.
    """
    K, (lower, upper) = len(twin.unknowns), twin.limits
    sd = np.sqrt(np.diag(covariance)[:K])
    ends = state.z[:K, None] + WIDTH * sd[:, None] * [-1, 1]
    curved = []
    for k in range(K):
        for side in (0, 1):
            if not is_fit or sd[k] > LITTLE * twin.unknowns[k].sigma:
                continue
            z = state.z + (ends[k, side] - state.z[k]) / sd[k] ** 2 * covariance[k]
            is_out = (z[:K] < lower) | (z[:K] > upper)
            moved = None
            if not is_out.any():
                moved = settled(twin, evaluated(twin, z, state.course))
            if moved is None or abs(distance(state, moved) / WIDTH - 1) > STRAIGHT:
                curved.append((k, side))
    if curved:
        ends[tuple(np.transpose(curved))] = profiled(twin, state, covariance, ends, curved)
    return np.clip(ends, lower[:, None], upper[:, None])


def distance(state: TwinState, other: TwinState) -> float:
    """Distance of another state from the estimate, in standard errors."""
    return float(np.sqrt(max(other.cost - state.cost, 0.0)))


def profiled(
    twin: Twin, state: TwinState, covariance, ends: np.ndarray, curved: list
) -> np.ndarray:
    """Ends of intervals where the cost, with all others at their best, is higher by 1.96^2."""
    limits, like = twin.limits, state.course

    def refit(numbers, held, starts):
        result = []
        for number, value, z in zip(numbers, held, starts):
            k = curved[number][0]
            z = clipped(twin, z + (value - z[k]) / covariance[k, k] * covariance[k])
            z[k] = value
            start = settled(twin, evaluated(twin, z, like))
            moved, _ = descended(twin, start, HELD_STEPS, k, like)
            result.append((distance(state, moved), moved.z))
        return tuple(map(np.array, zip(*result)))

    k, side = np.transpose(curved)
    best = state.z[k]
    first, bound = ends[k, side], limits[side, k]
    inside, reached, outside = profile_ends(refit, best, state.z, first, bound, WIDTH)
    last = inside[range(len(k)), k]
    return np.where(reached > (1 - STRAIGHT) * WIDTH, last, outside)

"""Gauss-Newton with Levenberg-Marquardt damping on unbiased normal equations.

An unknown without a prior gets a weak one: its first guess, with the width of the interval in which
it lies before any measurement (`Unknown.span`). It is negligible for what the data determine, and
keeps what they do not determine near the first guess.

Dead, hot and saturated pixels that nobody listed are found by their residuals and left out.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse, stats
from scipy.sparse.linalg import splu

from mi_lcair.errors import InputError
from mi_lcair.knowing.inversion.least_squares import newton
from mi_lcair.knowing.inversion.least_squares.prediction import (
    DatumBlock,
    Equations,
    Weighing,
    cost_of,
    dense,
    equations,
    hidden,
    mean_of,
    weighted,
    without,
)
from mi_lcair.knowing.inversion.unknowns import Unknown
from mi_lcair.physics.estimation import verdicts

# Profile-likelihood intervals where the linear ones do not hold: at bounds and in curved valleys
# -----------------------------------------------------------------------------------------------
# Whether they are needed follows from the cost at the ends of the linear interval, without a
# render.

WIDTH = verdicts.student_factor(np.inf)  # half of a 95 % interval, standard errors
MOST_UNKNOWNS = 30  # number of unknowns above which all intervals are linear
STRAIGHT = 0.1  # relative error of a linear interval from which it is replaced
RENDERS = 4  # largest number of renders for the end of an interval


def profile_intervals(
    blocks: list[DatumBlock],
    x: np.ndarray,
    prior: newton.Prior,
    covariance: np.ndarray,
    is_noisy: np.ndarray,
    render: Callable[[np.ndarray], list[DatumBlock]] | None,
) -> np.ndarray:
    """Lower and upper ends (N, 2) of the 95 % intervals about the estimate x, (N,).

    They are NaN where the linear interval holds. Standard errors (N,) of the estimate come from its
    covariance (N, N).

    is_noisy: unknowns (N,) of bool whose errors are mostly those of the render. Its noise would
    hide the rise of the cost, so that their intervals stay linear. render: gives the blocks at
    values; None if those at the estimate hold for all values.
    """
    ends = np.full((len(x), 2), np.nan)
    if any(sparse.issparse(block.columns[0]) for block in blocks) or len(x) > MOST_UNKNOWNS:
        return ends
    normal = equations(blocks, x)
    for k in range(len(x)):
        if is_noisy[k] or not covariance[k, k] > 0:
            continue
        profile = Profile(blocks, x, prior, k, covariance[k] / np.sqrt(covariance[k, k]), normal)
        if profile.rise_of_error <= 0:
            continue  # the noise of the render is larger than the rise
        half = WIDTH * np.sqrt(covariance[k, k])
        straight = [profile.straight_end(side) for side in (-1, 1)]
        if None in straight:
            ends[k] = [profile.end(side, render) for side in (-1, 1)]
        elif any(abs(abs(end - x[k]) / half - 1) > STRAIGHT for end in straight):
            ends[k] = straight
    return ends


class Profile:
    """The cost along one unknown k, with the others at their best.

    direction: change (N,) of the estimate for one standard error of the unknown. normal: the
    equations at the estimate x.
    """

    def __init__(self, blocks, x, prior: newton.Prior, k: int, direction: np.ndarray, normal):
        self.blocks, self.x, self.prior, self.k, self.direction = blocks, x, prior, k, direction
        self.cost = cost_of(blocks, x) + prior.cost(x)
        # The weights are not exactly the inverse variances, and the noise of derivatives is in the
        # standard error alone. The rise that belongs to one standard error makes up for both.
        rise = direction @ (normal.matrix @ direction + prior.times(direction))
        self.rise_of_error = float(rise)

    def errors(self, blocks, x) -> float:
        """Distance from the estimate, in standard errors, that the cost at the values x shows."""
        rise = cost_of(blocks, x) + self.prior.cost(x) - self.cost
        return float(np.sqrt(max(rise, 0) / self.rise_of_error))

    def straight_end(self, side: int) -> float | None:
        """The end of the interval on a straight line in the radiances of temperatures.

        None if the line leaves the bounds before, or if the cost is not as expected there.
        """
        x = newton.followed(self.blocks, self.x, side * WIDTH * self.direction)
        if (x < self.prior.lower).any() or (x > self.prior.upper).any():
            return None
        is_straight = abs(self.errors(self.blocks, x) / WIDTH - 1) < STRAIGHT
        return float(x[self.k]) if is_straight else None

    def at(self, blocks, start: np.ndarray, value: float) -> np.ndarray:
        """The best values (N,) of the others if the unknown has this value."""
        lower, upper = self.prior.lower.copy(), self.prior.upper.copy()
        lower[self.k] = upper[self.k] = value
        step = (value - start[self.k]) * self.direction / self.direction[self.k]
        # At a bound, such as a reflectance of 1, the data may know nothing of the others
        first = np.clip(start + step, 0.5 * (start + lower), 0.5 * (start + upper))
        first[self.k] = value
        held = replace(self.prior, lower=lower, upper=upper)
        return newton.minimiser(blocks, first, held, 0.0, False)

    def end(self, side: int, render) -> float:
        """The end of the interval on one side, -1 or 1."""
        bound = (self.prior.upper if side > 0 else self.prior.lower)[self.k]
        if self.x[self.k] == bound:
            return float(bound)
        blocks, first = self.blocks, None
        for _ in range(RENDERS):
            place, predicted, beyond = self.crossing(blocks, side, bound)
            if first is not None and (place == self.x).all():
                # By this render even the estimate is outside: noise of the render hides the rise
                place, predicted, beyond = first
                errors = predicted
                break
            first, errors = first or (place, predicted, beyond), predicted
            if render is None:
                break
            try:
                rendered = render(place)
            except InputError:
                break  # no surface can have these values
            blocks = [newton.bent(new.weighed_as(old), old) for new, old in zip(rendered, blocks)]
            place = self.at(blocks, place, place[self.k])
            errors = self.errors(blocks, place)
            if abs(errors - predicted) < STRAIGHT * WIDTH:
                break
        value = verdicts.further(self.x[self.k], place[self.k], errors, WIDTH)
        return float(min(value, beyond) if side > 0 else max(value, beyond))

    def crossing(self, blocks, side: int, bound: float) -> tuple[np.ndarray, float, float]:
        """Values (N,) within the interval near its end by the blocks, and their distance.

        The third result is a value of the unknown outside the interval, or the bound itself.
        """

        def refit(_, values, starts):
            places = [self.at(blocks, start, value) for value, start in zip(values, starts)]
            return np.array([self.errors(blocks, place) for place in places]), np.array(places)

        x = self.x[self.k]
        first = x + side * WIDTH * self.direction[self.k]
        ends = verdicts.profile_ends(refit, [x], self.x, [first], [bound], WIDTH)
        return tuple(of[0] for of in ends)


FALSE_ALARM = 0.05  # probability that noise alone makes any pixel of an image a bad one
# Share of an image above which large residuals are no bad pixels: the scene misses something.
MOST_BAD = 0.05
# Median of the residuals, relative to that of the given noise, above which the same holds.
LARGEST_SCALE = 1.5
ROUNDS = 6  # largest number of solutions after which bad pixels are looked for
FIRST_DAMPING, LEAST_DAMPING, MOST_DAMPING = 1e-3, 1e-12, 1e8
# Relative change of a predicted value after which a datum that holds for all values is rendered
# once more at the solution, where its paths go to what is bright there.
FAR = 0.5
NEAR = 3.0  # length of a step, in standard errors, up to which the gradient decides about it
NOISY_SHARE = 0.5  # part of a variance, made by the render, from which an interval is linear
UNRESOLVED = 0.2  # step, in standard errors, that adds 2 % to an error, see `unresolved`
# Columns of the inverse of a sparse matrix that are computed together. With a hundred or more,
# SuperLU starts threads that take far longer than the solution.
CHUNK = 32


class BadPixelSearch:
    """The search for bad pixels, after one solution and the next.

    bad: the bad pixels of each datum, (n,) of bool.
    """

    def __init__(self, blocks: list[DatumBlock]):
        self.bad = [np.zeros(len(block.measured), dtype=bool) for block in blocks]
        self.rounds = 0

    def continues(self, blocks: list[DatumBlock], x: np.ndarray, weighings) -> bool:
        """Look for bad pixels at a solution x; whether others are bad than before.

        If they stay too many, the scene misses something, and no pixel counts as bad.
        """
        if self.rounds >= ROUNDS:
            return False
        self.rounds += 1
        listed = [bad_pixels(block, x, of.weight) for block, of in zip(blocks, weighings)]
        before, self.bad = self.bad, [is_bad for is_bad, _ in listed]
        is_new = any((now != then).any() for now, then in zip(self.bad, before))
        are_many = any(many for _, many in listed)
        if are_many and (not is_new or self.rounds == ROUNDS):
            self.bad, self.rounds = [np.zeros_like(now) for now in before], ROUNDS
            return True
        return is_new

    def weighed(self, blocks: list[DatumBlock], weighings) -> list[DatumBlock]:
        """The blocks with weights, which are 0 for bad pixels."""
        return [
            block.weighed(of._replace(weight=np.where(is_bad, 0.0, of.weight)))
            for block, of, is_bad in zip(blocks, weighings, self.bad)
        ]


def bad_pixels(block: DatumBlock, x: np.ndarray, weight: np.ndarray) -> tuple[np.ndarray, bool]:
    """Pixels of an image, (n,), whose residual at the values x is too large for noise.

    The limit follows the median of the residuals, so that it is wide as long as bad pixels spoil
    the solution. Of many pixels only those with the largest residuals are bad, because they may
    have made the other residuals. Data that are no images have none.

    weight: weights (n,) of all pixels, see `Datum.weighing`. The second result is whether the
    residuals are too many, or too large everywhere, to come from bad pixels.
    """
    if not block.is_image:
        return np.zeros(len(weight), dtype=bool), False
    prediction = block.at(x)
    residuals = prediction.without_common(prediction.residuals.mean(axis=0))
    sigmas = np.abs(residuals) * np.sqrt(weight)
    scale = verdicts.inner_deviation(sigmas, 1.0)
    is_bad = sigmas > scale * stats.norm.isf(FALSE_ALARM / 2 / len(weight))
    are_many = np.mean(is_bad) > MOST_BAD or scale > LARGEST_SCALE
    is_bad &= sigmas > np.quantile(sigmas, 1 - MOST_BAD) * (np.mean(is_bad) > MOST_BAD)
    return is_bad, bool(are_many)


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
    equations at x. prior: inverse variances (N,), or inverse covariance (N, N). covariance: (N, N).
    response: change of the estimate for a change of the gradient, (N, N).
    render_share: part of each variance that the noise of the render makes, (N,). at_bound: -1 or 1
    where a value lies at its lower or upper bound, else 0. held: unknowns whose derivatives the
    noise of the render hides, so that they stay at the first guess, (N,). renders: number of
    renders of each datum. converged: whether the last step was small. trace: all values that were
    tried. intervals: ends (N, 2) of profile-likelihood intervals, NaN where the linear one holds.
    model_errors: what errors of the scene that no residual shows add to the standard errors (N,).
    """

    x: np.ndarray
    blocks: list[DatumBlock]
    equations: Equations
    prior: np.ndarray
    covariance: np.ndarray
    response: np.ndarray
    render_share: np.ndarray
    at_bound: np.ndarray
    held: np.ndarray
    renders: int
    converged: bool
    trace: list[Step]
    intervals: np.ndarray
    model_errors: np.ndarray | float = 0.0

    def widened(self, covariance: np.ndarray) -> "State":
        """The State with further errors, of covariance (N, N), that are independent of others."""
        before, more = np.diag(self.covariance), np.diag(covariance)
        x, far = self.x[:, None], self.intervals - self.x[:, None]
        return replace(
            self,
            covariance=self.covariance + covariance,
            render_share=self.render_share * before / (before + more),
            intervals=x + np.sign(far) * np.hypot(far, WIDTH * np.sqrt(more)[:, None]),
        )

    def changes(self, block: DatumBlock, columns: np.ndarray) -> np.ndarray:
        """Changes (N, G) of the estimate for changes (n, G) of the values of a block."""
        prediction = block.at(self.x)
        mean = mean_of(prediction.columns)
        if block.common:
            mean = block.common.removed(block.weight, mean)
        return (
            self.response[:, prediction.unknown] @ dense(columns.T @ weighted(mean, block.weight)).T
        )


def solve(
    unknowns: list[Unknown],
    render: Callable[[np.ndarray], list[DatumBlock]],
    weigh: Callable[[np.ndarray], list[Weighing]],
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
        Gives the weights of all data at values x, (N,), see `Datum.weighing`.
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
    prior = newton.Prior.of(unknowns)
    x = np.clip([unknown.start for unknown in unknowns], prior.lower, prior.upper)
    is_correlated = prior.correlated is not None
    is_sparse = not is_correlated and all(unknown.kind == "facet" for unknown in unknowns)
    done, trace, most = 0, [], 1 if is_exact else iterations

    held = np.zeros(len(x), dtype=bool)

    def rendered(x):
        nonlocal done
        blocks = [without(block, held) for block in render(x)]
        done += 1
        if progress:
            progress(min(done, most), most)
        return blocks

    def record(blocks, x, is_kept=True) -> float:
        normal = equations(blocks, x, is_sparse)
        distance = newton.length(newton.undamped(normal, prior, x), normal, prior)
        paths = done * sum(block.paths for block in blocks)
        trace.append(Step(done, paths, distance, cost_of(blocks, x), is_kept, x.tolist()))
        return distance

    first, start, weighings = x, x, weigh(x)
    blocks = rendered(x)
    search, is_first, is_searching = BadPixelSearch(blocks), True, True
    is_rough = not is_exact  # weights from far away make a solution that is not worth its renders
    while is_searching:
        blocks = search.weighed(blocks, weighings)
        if is_first:
            held = hidden(blocks, len(x), is_correlated)
        blocks = [without(block, held) for block in blocks]
        if is_exact:
            record(blocks, x)
            x, converged = exact_minimum(blocks, x, prior, is_sparse)
        else:
            x, blocks, converged = descent(
                blocks, x, prior, is_sparse, rendered, record, lambda: done >= iterations, is_rough
            )
        is_far = newton.length(x - start, equations(blocks, x, is_sparse), prior) >= 1
        is_rough &= done < iterations
        # Weights at the first guess are not the best ones, so they are found once more
        is_searching = is_far and (is_first or is_rough) or is_rough and not converged
        if converged:
            is_searching |= search.continues(blocks, x, weighings)
            # The derivatives of a lobe that has become much narrower may be noise
            lost = hidden(blocks, len(x), is_correlated) & ~held
            if lost.any():
                held, x, is_searching = held | lost, np.where(lost, first, x), True
                blocks = rendered(x)
        is_first, is_rough = False, is_rough and is_far
        if is_searching and is_far:
            start, weighings = x, weigh(x)
            if is_exact and max(block.change(x) for block in blocks) > FAR:
                blocks = rendered(x)
    if is_exact:
        record(blocks, x)
    result = state(blocks, x, prior, is_sparse)
    if converged:
        again = None if is_exact else rendered
        is_noisy = held | (result.render_share > NOISY_SHARE)
        intervals = profile_intervals(blocks, x, prior, result.covariance, is_noisy, again)
        result = replace(result, intervals=intervals)
    if is_correlated:
        held = np.zeros_like(held)  # what no pixel shows follows from its neighbours
    if held.any():
        result = with_held(result, render(x), held, prior.information**-0.5)
    return replace(result, held=held, renders=done, converged=converged, trace=trace)


def exact_minimum(blocks, x, prior: newton.Prior, is_sparse: bool) -> tuple[np.ndarray, bool]:
    """The values that minimise the cost of blocks that hold for all values, and convergence."""
    for _ in range(newton.INNER):
        new = newton.minimiser(blocks, x, prior, 0.0, is_sparse)
        moved, x = newton.length(new - x, equations(blocks, new, is_sparse), prior), new
        if moved < newton.CONVERGED:
            return x, True
    return x, False


def descent(
    blocks, x, prior: newton.Prior, is_sparse: bool, rendered, record, is_over, is_rough
) -> tuple:
    """Levenberg-Marquardt steps, each with a render: values, blocks there, and convergence.

    Far from the solution the cost decides whether a step is kept. Near it, the noise of the render
    hides the change of the cost, and the gradient decides, which is 0 at the solution.

    rendered: gives the blocks at values. record: traces blocks at values, and gives the distance
    from there to the solution in standard errors. It is the length of the undamped step, because a
    damped one is short far from the solution too. is_over: whether no further render is allowed.
    is_rough: whether to end when a step does not halve the distance.
    """
    damping, largest = FIRST_DAMPING, newton.CONVERGED
    distance = record(blocks, x)
    while damping <= MOST_DAMPING:
        normal = equations(blocks, x, is_sparse)
        if distance < largest or is_over():
            if UNRESOLVED < distance < largest:
                # The errors contain the noise of this render, but not the choice of these values
                x, _ = feasible(rendered, x, newton.minimiser(blocks, x, prior, 0.0, is_sparse))
            return x, blocks, distance < largest
        trial, new = None, newton.minimiser(blocks, x, prior, damping, is_sparse)
        if (new != x).any():
            new, trial = feasible(rendered, x, new)
        if trial is None:  # no step lowers the cost, or a surface can have none of the values
            damping = max(10 * damping, FIRST_DAMPING)
            continue
        is_near = distance <= NEAR
        near_by = normal if is_near else None
        predicted = cost_change(blocks, x, blocks, new, prior, near_by)
        trial = [block.weighed_as(old) for block, old in zip(trial, blocks)]
        if newton.length(new - x, normal, prior) > NEAR:
            # The noise of the render hides what a shorter step says about second derivatives
            trial = [newton.bent(block, old) for block, old in zip(trial, blocks)]
            blocks = [replace(old, curvature=block.curvature) for block, old in zip(trial, blocks)]
        change = cost_change(blocks, x, trial, new, prior, near_by)
        # Far from the solution the change of the cost is noisy
        is_kept = change < (0 if is_near else distance**2)
        before, distance_after = distance, record(trial, new, is_kept)
        if is_kept:
            x, blocks, distance = new, trial, distance_after
        # A step that should have come nearer and did not shows how near the noise of the render,
        # which is another one at other values, lets the iteration come
        is_good = change < predicted / 2 < 0  # the step went as it was predicted
        largest = newton.CONVERGED if is_good or distance > NEAR else unresolved(normal, prior)
        if is_rough and (not is_kept or distance_after > before / 2):
            return x, blocks, False
        if is_good:
            damping /= 1000
        else:
            damping = damping / 10 if change < 0 else max(10 * damping, FIRST_DAMPING)
        damping = max(damping, LEAST_DAMPING)
    return x, blocks, False


def unresolved(normal: Equations, prior: newton.Prior) -> float:
    """Distance, in standard errors, up to which the noise of the render hides the solution.

    It is the rms distance of the solutions by two renders, or UNRESOLVED if that is smaller.
    """
    if sparse.issparse(normal.matrix):
        return UNRESOLVED
    rendered = normal.transfer @ (normal.noise - normal.measured_noise) @ normal.transfer.T
    squared = 2 * np.trace(np.linalg.solve(normal.information + prior.matrix, rendered))
    return float(np.clip(np.sqrt(max(squared, 0)), UNRESOLVED, NEAR))


def cost_change(
    blocks: list[DatumBlock], x, trial: list[DatumBlock], new, prior: newton.Prior, normal
) -> float:
    """Change of the cost from blocks at x to blocks at new values.

    With normal equations at x it is that of the gradient, which noise of the render disturbs less.
    """
    change = prior.cost(new) - prior.cost(x)
    if normal is None:
        return change + cost_of(trial, new) - cost_of(blocks, x)
    there = equations(trial, new, sparse.issparse(normal.matrix))
    pressure = normal.pressure(prior.information)
    return change + pressure(there) - pressure(normal)


def state(blocks, x, prior: newton.Prior, is_sparse: bool) -> State:
    """The State at the values x, without what the iteration alone knows."""
    normal = equations(blocks, x, is_sparse)
    outward = normal.pull + prior.times(prior.mean - x)
    margin = 1e-9 * np.maximum(np.abs(x), 1)
    at_bound = np.where(
        (x <= prior.lower + margin) & (outward < 0),
        -1,
        np.where((x >= prior.upper - margin) & (outward > 0), 1, 0),
    )
    covariance, measured = covariances(normal, prior)
    variance = np.diag(covariance)
    return State(
        x=x,
        blocks=blocks,
        equations=normal,
        prior=prior.information if prior.correlated is None else prior.correlated,
        covariance=covariance,
        response=response(normal, covariance),
        render_share=np.clip(1 - measured / variance, 0, 1),
        at_bound=at_bound,
        held=np.zeros(len(x), dtype=bool),
        renders=0,
        converged=False,
        trace=[],
        intervals=np.full((len(x), 2), np.nan),
    )


def with_held(state: State, blocks: list[DatumBlock], held: np.ndarray, width: np.ndarray) -> State:
    """The State with the errors that held unknowns, (N,) of bool, make in the others.

    blocks: those of the State with the derivatives of the held unknowns. width: standard deviations
    (N,) of what is known of unknowns beforehand.
    """
    for block, full in zip(state.blocks, blocks):
        is_held = held[block.unknown]
        columns = mean_of(full.columns)[:, is_held]
        changes = state.changes(block, columns * width[block.unknown[is_held]])
        state = state.widened(changes @ changes.T)
    return state


def with_noise(state: State, factor: float) -> State:
    """The State with errors for a measurement's noise of `factor` times the given variance.

    The noise of the render, and errors that pixels share, stay as they are.
    """
    is_correlated = state.prior.ndim == 2
    blocks = [
        replace(block, noise=lambda predicted, of=block.noise: np.sqrt(factor) * of(predicted))
        for block in state.blocks
    ]
    normal = equations(blocks, state.x, sparse.issparse(state.equations.matrix))
    information = np.diag(state.prior) if is_correlated else state.prior
    correlated = state.prior if is_correlated else None
    known = newton.Prior(state.x, information, state.x, state.x, correlated)
    covariance, measured = covariances(normal, known)
    variance, x = np.diag(covariance), state.x[:, None]
    wider = np.sqrt(variance / np.diag(state.covariance))[:, None]
    return replace(
        state,
        equations=normal,
        covariance=covariance,
        response=response(normal, covariance),
        render_share=np.clip(1 - measured / variance, 0, 1),
        intervals=x + wider * (state.intervals - x),
    )


def response(normal: Equations, covariance: np.ndarray) -> np.ndarray:
    """Change (N, N) of the estimate of an inverse `covariance` for a change of the gradient."""
    return covariance if sparse.issparse(normal.matrix) else covariance @ normal.transfer


def feasible(rendered, x, new):
    """(values, blocks) of the longest of some shorter steps that a surface can have.

    (x, None) if there is none.
    """
    for _ in range(newton.HALVINGS):
        try:
            return new, rendered(new)
        except InputError:
            new = (x + new) / 2
    return x, None


def covariances(normal: Equations, known: newton.Prior) -> tuple[np.ndarray, np.ndarray]:
    """Covariance (N, N) of the estimate, and its variances (N,) without the render's noise."""
    if not sparse.issparse(normal.matrix):
        inverse = np.linalg.inv(normal.information + known.matrix)
        spread = inverse @ normal.transfer
        measured = spread @ normal.measured_noise @ spread.T
        return inverse, np.diag(measured) + np.diag(inverse @ known.matrix @ inverse)
    information = known.information
    covariance, variance = np.diag(1 / information), 1 / information
    some = np.flatnonzero(newton.is_informed(normal, information))
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

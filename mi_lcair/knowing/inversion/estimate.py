"""Estimates of a problem: its loaded data and unknowns, first guesses, and how near a goal is."""

import pickle
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.knowing.inversion.data.datum import Datum
from mi_lcair.knowing.inversion.data.loader import Loader, check_units, goal_datum
from mi_lcair.knowing.inversion.least_squares.prediction import DatumBlock, Weighing, cost_of
from mi_lcair.knowing.inversion.least_squares.solve import State, solve
from mi_lcair.knowing.inversion.tables import Goal, RenderSettings
from mi_lcair.knowing.inversion.unknowns import (
    FACETS,
    InverseProblem,
    Unknown,
    instruments,
    parts,
    unknowns,
)
from mi_lcair.progress import Progress
from mi_lcair.tasks import in_order, kept

# Factor of the number of randomisations where noise hides an unknown, and the largest number
MORE, MOST_RANDOMISATIONS = 4, 16
DRAWS = 100  # random values drawn for one first guess that a surface can have


def loaded(problem: InverseProblem) -> tuple[Loader, list[Datum], list[Datum], list[Unknown]]:
    """Loader, data, candidates and unknowns of a problem.

    Raises InputError if anything cannot be used, and for too few data.
    """
    loader, groups = Loader(problem.motions), facet_groups(problem)
    if problem.goal is not None:
        data = [goal_datum(problem.goal, problem.render, problem.motions)]
        proposed, everything = [], unknowns_of(problem, data)
        check_goal(everything, problem.goal)
    else:
        entries = enumerate([*problem.data, *problem.candidates])
        made = [loader.datum(entry, number, groups) for number, entry in entries]
        data, proposed = made[: len(problem.data)], made[len(problem.data) :]
        everything = [*unknowns_of(problem, data), *instruments(data)]
    check_counts(everything, data)
    return loader, data, proposed, everything


def facet_groups(problem: InverseProblem) -> set[str]:
    """Groups whose facets are unknown."""
    names = [parts(text)[0] for text in (*problem.unknowns, *problem.nuisance)]
    return {name.removesuffix(FACETS) for name in names if name.endswith(FACETS)}


def check_counts(everything: list[Unknown], data: list[Datum]) -> None:
    """Raise InputError for more unknowns without a prior than data."""
    free = sum(unknown.prior is None for unknown in everything)
    points = sum(len(datum.measured) for datum in data)
    if free > points:
        raise InputError(
            f"{free} unknowns without a prior, but only {points} measured "
            f"{'values' if points != 1 else 'value'}; measure more, or give priors"
        )


def check_goal(everything: list[Unknown], goal: Goal) -> None:
    """Raise InputError for a wanted contrast whose hidden background would change."""
    moving = [unknown.name for unknown in everything if unknown.kind == "motion"]
    if goal.background_K is not None and moving:
        raise InputError(
            f"'{moving[0]}' changes the area of the background that the target hides; motions "
            "are possible with a goal of an intensity, but not of a contrast"
        )


def unknowns_of(problem: InverseProblem, data: list[Datum], more=()) -> list[Unknown]:
    """The unknowns of a problem's data, and of more data that may be measured."""
    places = [datum.where for datum in (*data, *more)]
    return unknowns(problem.unknowns, problem.nuisance, places, len(data))


def estimate(
    everything: list[Unknown], data: list[Datum], sampling: RenderSettings, progress
) -> State:
    """The estimate of the unknowns from the data.

    If the noise of the render hides the effect of an unknown, it is made with more randomisations.
    """
    is_checked = False

    def render(x) -> list[DatumBlock]:
        nonlocal is_checked
        blocks = [datum.block(everything, x, sampling) for datum in data]
        if not is_checked:
            check_units(data, blocks)
            check_seen(everything, blocks)
            is_checked = True
        return blocks

    def weigh(x) -> list[Weighing]:
        return [datum.weighing(everything, x, sampling) for datum in data]

    is_exact = all(
        datum.follows(everything[k]) for datum in data for k in datum.numbers(everything)
    )
    state = solve(everything, render, weigh, is_exact, sampling.iterations, progress)
    more = MORE * sampling.randomisations
    if state.held.any() and more <= MOST_RANDOMISATIONS:
        return estimate(everything, data, replace(sampling, randomisations=more), progress)
    return state


def check_seen(everything: list[Unknown], blocks: list[DatumBlock]) -> None:
    """Raise InputError for an unknown, not a facet's, on which no measured value depends."""
    depends = np.zeros(len(everything), dtype=bool)
    for block in blocks:
        of = [abs(columns).sum(axis=0) > 0 for columns in block.columns]
        depends[block.unknown] |= np.any(of, axis=0)
        depends[[k for k in (block.gain, block.offset) if k is not None]] = True
    for unknown, is_seen in zip(everything, depends):
        if not is_seen and unknown.kind != "facet" and unknown.prior is None:
            raise InputError(
                f"'{unknown.label}' is an unknown without any data: no measured value depends on it"
            )


def best_of_starts(everything, data, problem: InverseProblem, progress) -> State:
    """The best estimate from several first guesses.

    The first guess is that of the unknowns, the others are random within the bounds. Guesses that
    no surface can have are drawn again.
    """
    starts = Starts(everything, data, problem, progress)
    guesses = list(first_guesses(everything, data, problem))
    tasks = [partial(starts.estimate, guess, k > 0) for k, guess in enumerate(guesses)]
    if len(tasks) == 1:
        return tasks[0]()
    return min(in_order(tasks), key=lambda state: cost_of(state.blocks, state.x))


@dataclass(frozen=True)
class Starts:
    """Unknowns and data from which estimates start. A worker makes them again from the problem."""

    everything: list[Unknown]
    data: list[Datum]
    problem: InverseProblem
    progress: Progress | None = None

    def __reduce__(self) -> tuple:
        return starts_of, (pickle.dumps(self.problem),)

    def estimate(self, guess: np.ndarray, is_further: bool) -> State:
        """The estimate from a first guess."""
        pairs = zip(self.everything, guess)
        tried = [replace(unknown, start=float(value)) for unknown, value in pairs]
        if self.problem.goal is None and is_further:
            # What is known beforehand does not depend on where an iteration starts
            known = [unknown.prior or (unknown.start, unknown.span) for unknown in self.everything]
            tried = [replace(unknown, prior=prior) for unknown, prior in zip(tried, known)]
        return estimate(tried, self.data, self.problem.render, self.progress)


@kept
def starts_of(problem: bytes) -> Starts:
    """The starts of a pickled problem, which a worker loads once."""
    read = pickle.loads(problem)
    _, data, _, everything = loaded(read)
    return Starts(everything, data, read)


def first_guesses(everything: list[Unknown], data: list[Datum], problem: InverseProblem):
    """Yield the first guesses (N,)."""
    starts = problem.render.starts if problem.goal is None else problem.goal.starts
    random, first = (
        np.random.default_rng(problem.render.seed),
        [unknown.start for unknown in everything],
    )
    yield np.array(first)
    middle = [
        (unknown.lower + unknown.upper) / 2
        if np.isfinite(unknown.upper - unknown.lower)
        else unknown.start
        for unknown in everything
    ]
    spans = [unknown.span for unknown in everything]
    guesses = 1
    for _ in range(DRAWS * starts):
        if guesses == starts:
            return
        guess = middle + (random.random(len(first)) - 0.5) * spans
        try:
            for datum in data:
                with datum.at(everything, guess):
                    pass
        except InputError:
            continue
        guesses += 1
        yield guess


def achieved(datum: Datum, state: State, everything, sampling: RenderSettings) -> str:
    """How near the goal is, before and after."""
    first = np.array([unknown.start for unknown in everything])
    before = datum.block(everything, first, sampling).radiance.mean(axis=0)
    after = state.blocks[0].at(state.x).mean
    rms = [np.sqrt(np.mean((values - datum.background) ** 2)) for values in (before, after)]
    goal = datum.goal
    wanted = f"{'at most ' if goal.at_most else ''}{goal.value:g} W/sr"
    return (
        f"rms {goal.quantity} over {len(datum.views)} aspects: {rms[0]:.4g} W/sr before, "
        f"{rms[1]:.4g} W/sr after; wanted {wanted}"
    )

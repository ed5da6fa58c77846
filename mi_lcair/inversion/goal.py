"""Several first guesses, and a wanted intensity or contrast in place of measurements."""

import pickle
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.inversion.data.datum import Datum
from mi_lcair.inversion.least_squares.estimate import estimate
from mi_lcair.inversion.least_squares.prediction import cost_of
from mi_lcair.inversion.least_squares.solve import State
from mi_lcair.inversion.loaded import loaded
from mi_lcair.inversion.problem import InverseProblem
from mi_lcair.inversion.tables import RenderSettings
from mi_lcair.inversion.unknowns import Unknown
from mi_lcair.progress import Progress
from mi_lcair.startup.tasks import in_order, kept

DRAWS = 100  # random values drawn for one first guess that a surface can have


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
    stated = pickle.loads(problem)
    _, data, _, everything = loaded(stated)
    return Starts(everything, data, stated)


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

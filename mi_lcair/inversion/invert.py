"""Inversion: the unknowns of a scene from measurements, with errors, verdicts and advice."""

import time
from dataclasses import replace

import numpy as np
from scipy import sparse

from mi_lcair.errors import InputError
from mi_lcair.inversion.advice import (
    MOST_UNKNOWNS,
    Advice,
    advice,
    measurements,
    other_bands,
    other_states,
    priors,
)
from mi_lcair.inversion.answers import Answer, answers, chi_square, directions
from mi_lcair.inversion.data import Datum, Loader, check_units, goal_datum
from mi_lcair.inversion.prediction import Block, cost_of
from mi_lcair.inversion.problem import Problem, parts
from mi_lcair.inversion.solution import Fitted, Solution
from mi_lcair.inversion.solve import State, is_informed, solve
from mi_lcair.inversion.tables import Sampling
from mi_lcair.inversion.unknowns import FACETS, Unknown, instruments, unknowns

NOISY = 0.75  # share of a variance from which the noise of the render is said to dominate
DRAWS = 100  # random values drawn for one first guess that a surface can have
UNTESTED = {"chi_square": 0.0, "degrees_of_freedom": 0.0, "p_value": None}
IMPROBABLE = 1e-3  # p-value below which the model is said to miss something


def invert(problem, advise: bool = True, progress=None) -> Solution:
    """Estimate the unknowns of an inverse problem.

    Parameters
    ----------
    problem : path-like, dict or Problem
        TOML file, its content as a dictionary, or the problem itself.
    advise : bool
        Whether to compute what further measurements would bring, if something is not determined.
    progress : callable or None
        Called with (renders of each datum done, largest number).

    Returns
    -------
    Solution

    Raises
    ------
    InputError
        If the problem, or one of its files or scenes, cannot be used.
    """
    start = time.perf_counter()
    if isinstance(problem, dict):
        problem = Problem.of(problem)
    elif not isinstance(problem, Problem):
        problem = Problem.read(problem)
    try:
        return _inverted(problem, advise, progress, start)
    except InputError as error:
        text = str(error)
        prefix = f"problem '{problem.name}': "
        raise InputError(text if text.startswith(prefix) else prefix + text) from None


def _inverted(problem: Problem, advise: bool, progress, start: float) -> Solution:
    loader, groups = Loader(), facet_groups(problem)
    if problem.goal is not None:
        data, proposed = [goal_datum(problem.goal, problem.render)], []
    else:
        places = enumerate([*problem.data, *problem.candidates])
        loaded = [loader.datum(place, number, groups) for number, place in places]
        data, proposed = loaded[: len(problem.data)], loaded[len(problem.data) :]
    expand = lambda more: unknowns(
        problem.unknowns, problem.nuisance, [d.where for d in [*data, *more]], len(data)
    )
    everything = [*expand([]), *instruments(problem.data)]
    check_counts(everything, data)
    if problem.goal is None:
        state = estimate(everything, data, problem.render, progress)
    else:
        state = best_of_starts(everything, data, problem, progress)

    found = answers(everything, state.x, state.covariance, state.at_bound, state.held)
    chi = UNTESTED
    if problem.goal is None:
        chi = chi_square(state.blocks, state.x, determined(state))
    notes = remarks(state, found, chi)
    if problem.goal is not None:
        found = [replace(one, verdict=chosen(one.verdict)) for one in found]
        notes = [achieved(data[0], state, everything, problem.render), *notes]
    advised = []
    if (
        advise
        and problem.goal is None
        and not all(one.is_determined for one in found if one.is_sought)
    ):
        advised = advice_for(
            everything, state, found, data, proposed, expand, loader, problem.render
        )
    return Solution(
        problem=problem.name,
        answers=found,
        covariance=state.covariance,
        directions=directions(found, state.covariance, reasons(everything, data))
        if problem.goal is None
        else [],
        advice=advised,
        **chi,
        render_share=state.render_share,
        data=[
            fitted(datum, block, everything, state.x) for datum, block in zip(data, state.blocks)
        ],
        materials=materials(data, everything, state.x),
        remarks=notes,
        renders=state.renders,
        converged=state.converged,
        seconds=time.perf_counter() - start,
    )


def estimate(everything: list[Unknown], data: list[Datum], sampling: Sampling, progress) -> State:
    """The estimate of the unknowns from the data."""
    is_checked = False

    def render(x) -> list[Block]:
        nonlocal is_checked
        blocks = [datum.block(everything, x, sampling) for datum in data]
        if not is_checked:
            check_units(data, blocks)
            check_seen(everything, blocks)
            is_checked = True
        return blocks

    weigh = lambda x: [datum.weight(everything, x, sampling) for datum in data]
    is_exact = all(datum.follows(everything[k]) for datum in data for k in datum.own(everything))
    return solve(everything, render, weigh, is_exact, sampling.iterations, progress)


def best_of_starts(everything, data, problem: Problem, progress) -> State:
    """The best estimate for a goal from several first guesses.

    The first guess is that of the unknowns, the others are random within the bounds. Guesses that
    no surface can have are drawn again.
    """
    best = None
    for start in first_guesses(everything, data[0], problem):
        tried = [replace(one, start=float(value)) for one, value in zip(everything, start)]
        found = estimate(tried, data, problem.render, progress)
        if best is None or cost_of(found.blocks, found.x) < cost_of(best.blocks, best.x):
            best = found
    return best


def first_guesses(everything: list[Unknown], datum: Datum, problem: Problem):
    """Yield the first guesses (N,) for a goal."""
    random, first = np.random.default_rng(problem.render.seed), [one.start for one in everything]
    yield np.array(first)
    middle = [
        (one.lower + one.upper) / 2 if np.isfinite(one.upper - one.lower) else one.start
        for one in everything
    ]
    spans = [one.span for one in everything]
    guesses = 1
    for _ in range(DRAWS * problem.goal.starts):
        if guesses == problem.goal.starts:
            return
        guess = middle + (random.random(len(first)) - 0.5) * spans
        try:
            with datum.at(everything, guess):
                pass
        except InputError:
            continue
        guesses += 1
        yield guess


def chosen(verdict: str) -> str:
    """The verdict on an unknown of a goal."""
    what, _, span = verdict.partition(":")
    if what.startswith("not determined by"):
        return f"free: {span.strip().removesuffix(' fits')} does as well"
    if what == "weakly determined":
        return f"chosen, but {span.strip().removeprefix('interval ')} does nearly as well"
    return "chosen" if verdict == "determined" else verdict


def achieved(datum: Datum, state: State, everything, sampling: Sampling) -> str:
    """How near the goal is, before and after."""
    first = np.array([one.start for one in everything])
    before = datum.block(everything, first, sampling).radiance.mean(axis=0)
    after = state.blocks[0].at(state.x).mean
    rms = [np.sqrt(np.mean((values - datum.background) ** 2)) for values in (before, after)]
    goal = datum.goal
    wanted = f"{'at most ' if goal.at_most else ''}{goal.value:g} W/sr"
    return (
        f"rms {goal.quantity} over {len(datum.views)} aspects: {rms[0]:.4g} W/sr before, "
        f"{rms[1]:.4g} W/sr after; wanted {wanted}"
    )


def facet_groups(problem: Problem) -> set[str]:
    """Groups whose facets are unknown."""
    names = [parts(text)[0] for text in (*problem.unknowns, *problem.nuisance)]
    return {name.removesuffix(FACETS) for name in names if name.endswith(FACETS)}


def check_counts(everything: list[Unknown], data: list[Datum]) -> None:
    """Raise InputError for more unknowns without a prior than data."""
    free = sum(one.prior is None for one in everything)
    points = sum(len(datum.measured) for datum in data)
    if free > points:
        raise InputError(
            f"{free} unknowns without a prior, but only {points} measured "
            f"{'values' if points != 1 else 'value'}; measure more, or give priors"
        )


def check_seen(everything: list[Unknown], blocks: list[Block]) -> None:
    """Raise InputError for an unknown, not a facet's, on which no measured value depends."""
    depends = np.zeros(len(everything), dtype=bool)
    for block in blocks:
        of = [abs(columns).sum(axis=0) > 0 for columns in block.columns]
        depends[block.unknown] |= np.any(of, axis=0)
        depends[[k for k in (block.gain, block.offset) if k is not None]] = True
    for one, is_seen in zip(everything, depends):
        if not is_seen and one.kind != "facet" and one.prior is None:
            raise InputError(
                f"'{one.label}' is an unknown without any data: no measured value depends on it"
            )


def determined(state: State) -> float:
    """Number of combinations of unknowns that the data determine, rather than the priors."""
    found, prior = state.equations, state.prior
    if sparse.issparse(found.matrix):
        return float(np.count_nonzero(is_informed(found, prior)))
    scale = np.sqrt(prior)
    values = np.linalg.eigvalsh(found.information / np.outer(scale, scale))
    values = np.maximum(values, 0)
    return float(np.sum(values / (1 + values)))


def reasons(everything: list[Unknown], data: list[Datum]):
    """Function of two unknowns' numbers that says why the data cannot tell them apart."""

    def why(first: int, second: int) -> str:
        used = [data[k] for k in {*everything[first].data, *everything[second].data}]
        bands = len({datum.where.band for datum in used})
        states = len({datum.where.state for datum in used})
        what = "one band" if bands == 1 else f"{bands} bands with a value each"
        if states > 1:
            what += f" and {states} states with a value each"
        return f"{what} cannot separate them"

    return why


def remarks(state: State, found: list[Answer], chi: dict) -> list[str]:
    """What a user should know about a solution, one line each."""
    lines = []
    if not state.converged:
        lines.append(
            "the iteration has not converged; raise iterations of [render], or start closer"
        )
    noisy = [
        one.label for one, part in zip(found, state.render_share) if part > NOISY and one.is_sought
    ]
    if noisy:
        lines.append(
            f"the noise of the render dominates the error of {len(noisy)} unknowns, such as "
            f"{noisy[0]}; raise spp of [render]"
        )
    if chi["p_value"] is not None and chi["p_value"] < IMPROBABLE:
        lines.append(
            f"the residuals are larger than the noise explains (chi-square {chi['chi_square']:.4g} "
            f"for {chi['degrees_of_freedom']:.4g} degrees of freedom): the scene misses something, "
            "or the noise is understated"
        )
    return lines


def advice_for(
    everything, state: State, found, data: list[Datum], proposed, expand, loader, sampling
) -> list[Advice]:
    """What further measurements would bring: those of [[candidates]] and some others."""
    if len(everything) > MOST_UNKNOWNS:
        return []
    by_name = {datum.label: [datum] for datum in proposed}
    by_name |= other_bands(data, loader, len(data) + len(proposed))
    more = [datum for made in by_name.values() for datum in made]
    instrument = [one for one in everything if one.kind in ("gain", "offset")]
    proposals = [
        *priors(everything),
        *measurements(everything, state.x, [*expand(more), *instrument], by_name, sampling),
        *other_states(everything, state.x, data, sampling),
    ]
    return advice(everything, state, found, proposals)


def fitted(datum: Datum, block: Block, everything: list[Unknown], x: np.ndarray) -> Fitted:
    """A datum after the solution."""
    found = block.at(x)
    predicted = found.mean
    residual = found.residuals.mean(axis=0) * np.sqrt(block.weight)
    image = datum.image if datum.is_image else lambda values: values
    own = [everything[k] for k in datum.own(everything)]
    facets = {}
    for k in datum.own(everything):
        if (one := everything[k]).kind == "facet":
            facets.setdefault(one.name, {})[one.facet] = float(x[k])
    return Fitted(
        name=datum.label,
        scene=datum.scene.name,
        band=datum.scene.band.name,
        state=datum.place.state,
        parameters=dict(datum.scene.parameters),
        values=datum.settings(everything, x),
        kinds={one.name: one.kind for one in own if one.name in datum.where.parameters},
        facets=facets,
        measured=image(datum.measured - datum.background),
        predicted=image(predicted - datum.background),
        residual=image(residual),
        aspects=list(datum.aspects),
        quantity=datum.quantity,
    )


def materials(data: list[Datum], everything: list[Unknown], x: np.ndarray) -> dict:
    """Estimated materials by name and band, in the form of a fit's report.

    A material that is not the same in all data of a band is left out.
    """
    result, ambiguous = {}, set()
    for datum in data:
        names = {
            everything[k].name.rpartition(".")[0]
            for k in datum.own(everything)
            if everything[k].kind == "material"
        }
        with datum.at(everything, x):
            for surface in datum.scene.surfaces():
                if (surface.material or surface.model.name) not in names:
                    continue
                entry = {
                    "model": surface.model.name,
                    "form": surface.form,
                    "band": datum.scene.band.name,
                    "parameters": dict(zip(surface.model.names, surface.values)),
                }
                key = surface.material or surface.model.name, datum.scene.band.name
                of_material = result.setdefault(key[0], {})
                if of_material.setdefault(key[1], entry) != entry:
                    ambiguous.add(key)
    for name, band in ambiguous:
        del result[name][band]
    return {name: bands for name, bands in result.items() if bands}

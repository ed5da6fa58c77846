"""Inversion: the unknowns of a scene from measurements, with errors, verdicts and advice."""

import time
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy import sparse

from mi_lcair.declared import percent
from mi_lcair.knowing.inversion.advice import (
    MOST_UNKNOWNS,
    Advice,
    advice,
    listed,
    measurements,
    other_bands,
    other_states,
    priors,
)
from mi_lcair.knowing.inversion.answers import (
    UNTESTED,
    Answer,
    answers,
    chi_square,
    directions,
    in_words,
    misfit,
    withdrawn,
)
from mi_lcair.knowing.inversion.data.datum import Datum
from mi_lcair.knowing.inversion.data.nuisances import GAIN, GRADIENT, MODEL, OFFSET, VIGNETTING
from mi_lcair.knowing.inversion.data.readings import ASSUMED_SIGMA
from mi_lcair.knowing.inversion.dead_pixels import gathering
from mi_lcair.knowing.inversion.estimate import achieved, best_of_starts, loaded, unknowns_of
from mi_lcair.knowing.inversion.least_squares.newton import is_informed
from mi_lcair.knowing.inversion.least_squares.prediction import DatumBlock
from mi_lcair.knowing.inversion.least_squares.solve import State, with_noise
from mi_lcair.knowing.inversion.solution import Fitted, Solution
from mi_lcair.knowing.inversion.unknowns import INSTRUMENT, InverseProblem, Unknown
from mi_lcair.physics.blackbody import in_band_radiance, in_band_slope
from mi_lcair.physics.estimation.verdicts import OVERSTATED, SIGNIFICANCE, Verdict, correlation
from mi_lcair.progress import Progress

NOISY = 0.75  # share of a variance from which the noise of the render is said to dominate
SCALED = (
    "the errors assume {:.3g} times the given noise, because scale_errors is set; chi-square "
    "then does not test the model"
)
# Inputs of a heat balance whose common factor changes no temperature
SCALED_TOGETHER = {"absorptance", "emissivity", "h", "conductivity", "density", "heat_capacity"}
LEAST_SHARE = 0.01  # share of a variance from which what is assumed is listed
LARGEST_SIZE = 3.0  # size of an error, in its standard deviations, from which it is reported
KINDS = GAIN, OFFSET, VIGNETTING, GRADIENT, MODEL
LARGEST_MODEL_ERROR = 0.1  # relative error of a model above which it is not proposed to state it


def fitted(datum: Datum, block: DatumBlock, everything: list[Unknown], x: np.ndarray) -> Fitted:
    """A datum after the solution."""
    prediction = block.at(x)
    predicted = prediction.mean
    weight = np.where(block.weight > 0, block.weight, np.nan)  # bad pixels have no residual
    residual = prediction.without_common(prediction.residuals.mean(axis=0)) * np.sqrt(weight)
    image = datum.image if datum.is_image else lambda values: values
    own_unknowns = [everything[k] for k in datum.numbers(everything)]
    facets = {}
    for k in datum.numbers(everything):
        if (unknown := everything[k]).kind == "facet":
            facets.setdefault(unknown.name, {})[unknown.facet] = float(x[k])
    return Fitted(
        name=datum.label,
        scene=datum.scene.name,
        band=datum.scene.band.name,
        state=datum.entry.state,
        parameters=dict(datum.scene.parameters),
        values=datum.settings(everything, x),
        kinds={
            unknown.name: unknown.kind
            for unknown in own_unknowns
            if unknown.name in datum.where.parameters
        },
        facets=facets,
        points=int(np.isfinite(residual).sum()),
        size=image(residual).size,
        residual_rms_sigmas=float(np.sqrt(np.nanmean(residual**2))),
        measured=image(datum.measured - datum.background),
        predicted=image(predicted - datum.background),
        residual=image(residual),
        aspects=list(datum.aspects),
        quantity=datum.quantity,
        bad_pixels=datum.bad_pixels(block),
    )


def materials(data: list[Datum], everything: list[Unknown], x, covariance) -> dict:
    """Estimated materials by name and band, in the form of a fit's report.

    Parameters that were not estimated have an error of 0.

    A material that is not the same in all data of a band is left out.
    """
    result, ambiguous = {}, set()
    for datum in data:
        number_of = {
            everything[k].name: k
            for k in datum.numbers(everything)
            if everything[k].kind == "material"
        }
        names = {name.rpartition(".")[0] for name in number_of}
        with datum.at(everything, x):
            for surface in datum.scene.surfaces():
                material = surface.material
                if material not in names:
                    continue
                entry = {
                    "model": surface.model.name,
                    "form": surface.form,
                    "band": datum.scene.band.name,
                    "parameters": dict(zip(surface.model.names, surface.values)),
                    **spread(material, surface.model.names, number_of, covariance),
                }
                key = material, datum.scene.band.name
                of_material = result.setdefault(key[0], {})
                if of_material.setdefault(key[1], entry) != entry:
                    ambiguous.add(key)
    for name, band in ambiguous:
        del result[name][band]
    return {name: bands for name, bands in result.items() if bands}


def spread(material: str, names, number_of: dict[str, int], covariance: np.ndarray) -> dict:
    """Standard errors and correlations of a material's parameters, as in a fit's report."""
    columns = [number_of.get(f"{material}.{name}") for name in names]
    estimated = [k for k in columns if k is not None]
    total = np.zeros((len(names),) * 2)
    is_estimated = np.array([k is not None for k in columns])
    total[np.ix_(is_estimated, is_estimated)] = covariance[np.ix_(estimated, estimated)]
    return {
        "standard_error": dict(zip(names, np.sqrt(np.diag(total)).tolist())),
        "correlation": correlation(total).tolist(),
    }


def solve_problem(problem: InverseProblem, advise: bool, progress: Progress | None) -> Solution:
    """Load the scenes of a problem, and estimate its unknowns.

    Parameters
    ----------
    problem : InverseProblem
    advise : bool
        Whether to compute what further measurements would bring, if something is not determined.
    progress : callable or None
        Called with (renders of each datum done, largest number).
    """
    start = time.perf_counter()
    loader, data, proposed, everything = loaded(problem)
    state = best_of_starts(everything, data, problem, progress)
    data = [datum.moved(everything, state.x) for datum in data]
    if problem.goal is not None:
        answered, chi, pairs, advised = answers(everything, state, True), UNTESTED, [], []
        reached = achieved(data[0], state, everything, problem.render)
        notes = [reached, *remarks(state, answered, chi)]
    else:
        chi = chi_square(state.blocks, state.x, determined(state))
        tested, scaling = chi, []
        if problem.render.scale_errors and chi["chi_square"] > 0 and chi["p_value"] is not None:
            factor = chi["chi_square"] / chi["degrees_of_freedom"]
            state, tested = with_noise(state, factor), UNTESTED
            scaling = [SCALED.format(np.sqrt(factor))]
        errors = model_errors(everything, data, state.x)
        changes = changes_by_fault(data, state)
        state = state.widened(np.diag(errors**2)).widened(common_errors(changes))
        state = replace(state, model_errors=errors)
        assumed = assumptions(data, state, changes)
        answered = answers(everything, state, assumed=assumed)
        if not state.converged:
            answered = withdrawn(answered, Verdict.UNFINISHED)
        notes = [*scaling, *remarks_on_assumptions(assumed, answered, state.covariance)]
        notes += remarks(
            state, answered, tested, any(d.entry.model_sigma and d.entry.model_error for d in data)
        )
        notes += [*remarks_on_faults(data, state), *remarks_on_pixels(data, state)]
        pairs, advised = directions(answered, state.covariance, reasons(everything, data)), []
        if advise and any(answer.is_sought and not answer.is_determined for answer in answered):
            advised = advice_for(problem, everything, state, answered, data, proposed, loader)
        if words := misfit(tested["p_value"]) or misfit_of_pixels(data, state):
            answered = withdrawn(answered, words)
    return Solution(
        problem=problem.name,
        answers=answered,
        covariance=state.covariance,
        directions=pairs,
        advice=advised,
        **chi,
        render_share=state.render_share,
        data=[
            fitted(datum, block, everything, state.x) for datum, block in zip(data, state.blocks)
        ],
        materials=materials(data, everything, state.x, state.covariance),
        remarks=notes,
        renders=state.renders,
        converged=state.converged,
        trace=state.trace,
        seconds=time.perf_counter() - start,
    )


def determined(state: State) -> float:
    """Number of combinations of unknowns that the data determine, rather than the priors."""
    normal = state.equations
    if sparse.issparse(normal.matrix):
        return float(np.count_nonzero(is_informed(normal, state.prior)))
    return float(np.sum(state.response * normal.matrix.T))


def reasons(everything: list[Unknown], data: list[Datum]):
    """Function of two unknowns' numbers that says why the data cannot separate them."""

    def why(first: int, second: int) -> str:
        bare = {everything[k].name.rpartition(".")[2] for k in (first, second)}
        if {everything[k].kind for k in (first, second)} == {"mode"} and bare <= SCALED_TOGETHER:
            return "one factor of all that heats, cools and stores changes no temperature"
        used = [data[k] for k in {*everything[first].data, *everything[second].data}]
        bands = len({datum.where.band for datum in used})
        states = len({datum.where.state for datum in used})
        what = "one band" if bands == 1 else f"{bands} bands with a value each"
        if states > 1:
            what += f" and {states} states with a value each"
        return f"{what} cannot separate them"

    return why


def model_errors(everything: list[Unknown], data: list[Datum], x: np.ndarray) -> np.ndarray:
    """Errors (N,) of unknown temperatures from errors of the radiances of their groups.

    A group that emits more is as one that is hotter, also in all reflections. No residual shows it.
    """
    errors = np.zeros(len(x))
    for datum in data:
        for k in datum.numbers(everything):
            if datum.is_image and everything[k].kind in ("temperature", "facet"):
                band = datum.scene.band
                kelvin = in_band_radiance(band, x[k]) / in_band_slope(band, x[k])
                errors[k] = max(errors[k], datum.entry.model_error * kelvin)
    return errors


class Fault(NamedTuple):
    """An error that pixels share: its name, its label, its band, and whether it is not stated."""

    name: str
    label: str
    band: str
    is_assumed: bool


def changes_by_fault(data: list[Datum], state: State) -> dict[Fault, np.ndarray]:
    """Changes (images, N) of the estimate for one standard deviation of each error of images."""
    changes = {}
    for datum, block in zip(data, state.blocks):
        if (of := datum.nuisances) is not None:
            by_error = state.changes(block, of.columns(block.at(state.x).mean)).T
            for name, label, change in zip(of.names, of.labels, by_error):
                fault = Fault(name, label, datum.where.band, name in datum.assumed)
                changes.setdefault(fault, []).append(change)
    return {fault: np.array(rows) for fault, rows in changes.items()}


def common_errors(changes: dict[Fault, np.ndarray]) -> np.ndarray:
    """What is missing in the covariance (N, N) if all images of a band have the same errors.

    Least squares takes the errors of two images for independent. One camera has the same in all its
    images. What that adds to a variance counts, and what it takes away does not.
    """
    more = 0.0
    for rows in changes.values():
        whole = rows.sum(axis=0)
        more = more + np.outer(whole, whole) - rows.T @ rows
    sizes, directions = np.linalg.eigh(np.atleast_2d(more))
    return (directions * np.maximum(sizes, 0)) @ directions.T


def assumptions(data: list[Datum], state: State, changes) -> dict[str, np.ndarray]:
    """What errors that the problem does not state add to the standard errors (N,), by name.

    changes: see `changes_by_fault`.
    """
    result = {}
    if any(datum.is_image and MODEL in datum.assumed for datum in data):
        result[MODEL] = state.model_errors
    for fault, rows in changes.items():
        if fault.is_assumed:
            errors = np.maximum(np.abs(rows.sum(axis=0)), np.linalg.norm(rows, axis=0))
            result[fault.name] = np.hypot(result.get(fault.name, 0.0), errors)
    return {name: result[name] for name in KINDS if name in result}


def remarks_on_assumptions(assumed: dict[str, np.ndarray], answered, covariance) -> list[str]:
    """One line with the errors that are assumed, and the largest part of a variance of each."""
    parts = []
    for name, errors in assumed.items():
        shares = errors**2 / np.maximum(np.diag(covariance), np.finfo(float).tiny)
        worst = int(np.argmax(np.where([a.is_sought for a in answered], shares, 0)))
        if shares[worst] < LEAST_SHARE:
            continue
        parts.append(f"{name} ({shares[worst]:.0%} of the variance of {answered[worst].label})")
    if not parts:
        return []
    return [
        f"assumed to be right within {percent(ASSUMED_SIGMA)}: {', '.join(parts)}; camera_sigma "
        "and model_sigma of [[data]] set other errors"
    ]


def remarks_on_faults(data: list[Datum], state: State) -> list[str]:
    """Errors that the pixels of an image share and that are larger than stated or assumed."""
    lines = []
    for datum, block in zip(data, state.blocks):
        if datum.nuisances is None:
            continue
        prediction = block.at(state.x)
        residual = prediction.residuals.mean(axis=0)
        labels = datum.nuisances.labels
        sizes = block.common.sizes(block.weight, residual)[-len(labels) :]
        for label, size, of in zip(labels, sizes, np.abs(datum.nuisances.patterns).max(axis=0)):
            if abs(size) > LARGEST_SIZE:
                lines.append(
                    f"{datum.label}: the image shows an error of the {label} of "
                    f"{100 * size * of:+.2g} %, {abs(size):.2g} times its standard deviation"
                )
    return lines


def remarks(
    state: State, answered: list[Answer], chi: dict, is_model_stated: bool = False
) -> list[str]:
    """What a user should know about a solution, one line each."""
    lines = []
    if not state.converged:
        lines.append(
            "the iteration has not converged; raise spp or iterations of [render], or start closer"
        )
    unseen = unseen_facets(state, answered)
    if unseen:
        names = listed([str(facet) for facet in unseen])
        consequence = "they follow their neighbours, as correlation_m says"
        if state.prior.ndim == 1:
            consequence = "they keep their first guess; give them a prior, or add views"
        lines.append(f"{len(unseen)} facets are seen by no pixel ({names}): {consequence}")
    noisy = [
        answer.label
        for answer, part in zip(answered, state.render_share)
        if part > NOISY and answer.is_sought
    ]
    if noisy:
        lines.append(
            f"the noise of the render dominates the error of {len(noisy)} unknowns, such as "
            f"{noisy[0]}; raise spp of [render]"
        )
    return [*lines, *remarks_on_residuals(state, chi, is_model_stated)]


def remarks_on_residuals(state: State, chi: dict, is_model_stated: bool) -> list[str]:
    """What the size of the residuals says about the model and the given noise."""
    p = chi["p_value"]
    if p is None:
        return []
    sums = f"(chi-square {in_words(**chi)})"
    if p < SIGNIFICANCE:
        size = model_error(state)
        remedy = "check its geometry and materials"
        if size <= LARGEST_MODEL_ERROR:
            remedy += f'; if they are slightly wrong, give model_sigma, at least "{percent(size)}"'
        return [
            f"the residuals are larger than the noise explains {sums}: something is missing in "
            f"the scene, or the given noise is too small; {remedy}"
        ]
    if p > 1 - SIGNIFICANCE and not is_model_stated:
        return [f"{OVERSTATED} {sums}: the given noise is too large, and so are the errors"]
    return []


def misfit_of_pixels(data: list[Datum], state: State) -> str | None:
    """The verdict on unknowns if the pixels of an image that were left out are not scattered."""
    for datum, block in zip(data, state.blocks):
        if where := gathering(datum, block):
            what = f"pixels of {datum.label} that were left out and {where}"
            return Verdict.MISSED.sentence(what=what)
    return None


def remarks_on_pixels(data: list[Datum], state: State) -> list[str]:
    """Which pixels of the images were left out, one line for each image."""
    lines = []
    for datum, block in zip(data, state.blocks):
        if datum.plateau is not None and (count := int(datum.plateau.sum())):
            lines.append(
                f"{datum.label}: {count} pixels have the same largest value and are left out as "
                "saturated; set saturation = inf if they are not"
            )
        places = [f"({row}, {column})" for row, column in datum.bad_pixels(block)]
        if places:
            what = "1 pixel is" if len(places) == 1 else f"{len(places)} pixels are"
            lines.append(
                f"{datum.label}: {what} left out as dead, hot or saturated (row, column): "
                f"{listed(places)}; the JSON lists all"
            )
        if where := gathering(datum, block):
            lines.append(
                f"{datum.label}: the pixels that are left out {where}, unlike dead pixels: "
                "something is missing in the scene there"
            )
    return lines


def model_error(state: State) -> float:
    """Rms relative error of the prediction that makes the residuals as large as they are."""
    excess = power = 0.0
    for block in state.blocks:
        prediction = block.at(state.x)
        r, is_good = prediction.residuals.mean(axis=0), block.weight > 0
        r = prediction.without_common(r)
        excess += float(np.sum((r**2 - prediction.noise**2 - prediction.variance)[is_good]))
        power += float(np.sum(prediction.mean[is_good] ** 2))
    return float(np.sqrt(max(excess, 0) / power))


def unseen_facets(state: State, answered: list[Answer]) -> list[int]:
    """Unknown facets on which no measured value depends."""
    is_seen = np.zeros(len(answered), dtype=bool)
    for block in state.blocks:
        is_seen[block.unknown] |= sum(abs(columns).sum(axis=0) for columns in block.columns) > 0
    return [
        answer.facet
        for answer, seen in zip(answered, is_seen)
        if answer.kind == "facet" and not seen
    ]


def advice_for(
    problem: InverseProblem, everything, state: State, answered, data: list[Datum], proposed, loader
) -> list[Advice]:
    """What further measurements would bring: those of [[candidates]] and some others."""
    if len(everything) > MOST_UNKNOWNS:
        return []
    by_name = {datum.label: [datum] for datum in proposed}
    by_name |= other_bands(data, loader, len(data) + len(proposed))
    more = [datum for made in by_name.values() for datum in made]
    instrument = [unknown for unknown in everything if unknown.kind in INSTRUMENT]
    everywhere = [*unknowns_of(problem, data, more), *instrument]
    proposals = [
        *priors(everything),
        *measurements(everything, state.x, everywhere, by_name, problem.render),
        *other_states(everything, state.x, data, problem.render),
    ]
    return advice(everything, state, answered, proposals)

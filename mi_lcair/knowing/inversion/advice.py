"""What a further measurement would bring, computed from the columns at the solution."""

from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.knowing.inversion.answers import Answer
from mi_lcair.knowing.inversion.data.datum import Datum
from mi_lcair.knowing.inversion.data.loader import Loader
from mi_lcair.knowing.inversion.data.readings import Candidate
from mi_lcair.knowing.inversion.least_squares.prediction import DatumBlock, dense, equations
from mi_lcair.knowing.inversion.least_squares.solve import State
from mi_lcair.knowing.inversion.tables import RenderSettings
from mi_lcair.knowing.inversion.unknowns import Unknown
from mi_lcair.rendering.loading.files import survey
from mi_lcair.rendering.parameters.values import changed

HOTTER_K = 20.0  # difference of temperatures in the heating states that are proposed
BANDS = ("MWIR", "LWIR")  # bands that are proposed where the scene has a parameter `band`
# Entries of an image that the same image in another band has, too
ALIKE = ("scene", "sensor", "state", "netd_mK", "camera_sigma", "model_sigma")
PRIORS = {"material": 0.01, "emissivity": 0.01, "temperature": 1.0}  # sigmas that are proposed
WORTH = 0.8  # ratio of standard errors below which a proposal is worth mentioning
MOST_UNKNOWNS = 200  # unknowns up to which measurements are proposed
MOST_NAMED = 3  # unknowns that a sentence names


@dataclass(frozen=True)
class Advice:
    """A further measurement and what it would bring.

    measure: what to measure. errors: standard error of each unknown that is not determined now, by
    label. now: the same without it. words: the same as a sentence.
    """

    measure: str
    errors: dict[str, float]
    now: dict[str, float]
    words: str

    @property
    def gain(self) -> float:
        """Mean logarithm of the factor by which the errors fall."""
        return float(np.mean([np.log(self.now[k] / self.errors[k]) for k in self.errors]))


@dataclass(frozen=True)
class Proposal:
    """A further measurement: what it is, its information (N, N), and unknowns that come with it.

    information: of the estimated unknowns and, behind them, `extra` ones (their spans are their
    only other knowledge).
    """

    measure: str
    information: np.ndarray
    extra: tuple[Unknown, ...] = ()


def advice(
    unknowns: list[Unknown], state: State, answers: list[Answer], proposals: list[Proposal]
) -> list[Advice]:
    """The advice that each proposal gives, the most useful first."""
    wanted = [
        k for k, unknown in enumerate(answers) if unknown.is_sought and not unknown.is_determined
    ]
    now = dense(state.equations.information) + (
        np.diag(state.prior) if state.prior.ndim == 1 else state.prior
    )
    result = []
    for proposal in proposals:
        spans = [unknown.span**-2.0 for unknown in proposal.extra]
        count = len(unknowns)
        total = np.diag(np.append(np.zeros(count), spans))
        total[:count, :count] += now
        inverse = np.linalg.inv(total + proposal.information)
        after = np.sqrt(np.diag(inverse)[:count] + np.square(state.model_errors))
        errors = {answers[k].label: float(min(after[k], answers[k].standard_error)) for k in wanted}
        before = {answers[k].label: answers[k].standard_error for k in wanted}
        if min(errors[label] / before[label] for label in errors) > WORTH:
            continue
        result.append(
            Advice(
                proposal.measure, errors, before, words(proposal.measure, errors, before, answers)
            )
        )
    return sorted(result, key=lambda unknown: -unknown.gain)


def words(measure: str, errors: dict, before: dict, answers: list[Answer]) -> str:
    """A proposal as a sentence."""
    units = {unknown.label: unknown.unit.removesuffix("1") for unknown in answers}
    best = sorted(errors, key=lambda label: errors[label] / before[label])[:MOST_NAMED]
    parts = [
        f"{label} from +- {before[label]:.2g} to +- {errors[label]:.2g} {units[label]}".rstrip()
        for label in best
        if errors[label] <= WORTH * before[label]
    ]
    return f"{measure} would bring {', '.join(parts)}"


# ---------------------------------------------------------------- Proposals


def priors(unknowns: list[Unknown]) -> list[Proposal]:
    """Proposals to measure one unknown in another way."""
    result = []
    for k, unknown in enumerate(unknowns):
        sigma = PRIORS.get(unknown.kind)
        if sigma is None or unknown.prior and unknown.prior[1] <= sigma:
            continue
        information = np.zeros((len(unknowns), len(unknowns)))
        information[k, k] = sigma**-2.0
        what = f"knowing {unknown.label} to +- {sigma:g} {unknown.unit.removesuffix('1')}".rstrip()
        result.append(Proposal(what, information))
    return result


def measurements(
    unknowns: list[Unknown],
    x: np.ndarray,
    everything: list[Unknown],
    proposed: dict[str, list[Datum]],
    sampling: RenderSettings,
) -> list[Proposal]:
    """Proposals to make further measurements.

    Parameters
    ----------
    unknowns : list of Unknown
        Those that were estimated.
    x : ndarray, shape (N,)
        Their values.
    everything : list of Unknown
        The unknowns of the data and of all that is proposed.
    proposed : dict of str to list of Datum
        Measurements by what they are, numbered behind the data.
    sampling : RenderSettings

    Returns
    -------
    list of Proposal
    """
    if not proposed:
        return []
    first = min(datum.number for made in proposed.values() for datum in made)
    of_data = {
        (unknown.name, unknown.facet, tuple(k for k in unknown.data if k < first)): unknown
        for unknown in everything
    }
    shared = [
        replace(unknown, data=of_data[unknown.name, unknown.facet, unknown.data].data)
        for unknown in unknowns
    ]
    result = []
    for what, made in proposed.items():
        numbers = {datum.number for datum in made}
        extra = [
            unknown
            for unknown in everything
            if min(unknown.data) >= first and numbers & set(unknown.data)
        ]
        values = np.append(x, [unknown.start for unknown in extra])
        blocks = [rendered(datum, [*shared, *extra], values, sampling) for datum in made]
        total = sum(information(block, values) for block in blocks)
        result.append(Proposal(what, total, tuple(extra)))
    return result


def other_states(
    unknowns: list[Unknown], x: np.ndarray, data: list[Datum], sampling: RenderSettings
) -> list[Proposal]:
    """Proposals to measure all images again with everything of one kind hotter.

    Once with the unknown temperatures higher, which are then unknown again, and once with the known
    temperatures of the surroundings higher.
    """
    images = [datum for datum in data if datum.is_image]
    hot = [k for k, unknown in enumerate(unknowns) if unknown.kind == "temperature"]
    result = []
    if hot and images:
        extra = tuple(
            replace(unknowns[k], start=float(x[k]) + HOTTER_K, prior=None, upper=np.inf)
            for k in hot
        )
        count = len(unknowns)
        total = np.zeros((count + len(hot),) * 2)
        raised = x.copy()
        raised[hot] += HOTTER_K
        new = np.arange(count)
        new[hot] = count + np.arange(len(hot))
        for datum in images:
            block = rendered(datum, unknowns, raised, sampling)
            part = information(block, raised)
            total[np.ix_(new, new)] += part
        names = listed([unknowns[k].label for k in hot])
        result.append(
            Proposal(
                f"a second state with {names} {HOTTER_K:g} K hotter (and unknown again)",
                total,
                extra,
            )
        )
    total, groups = np.zeros((len(unknowns),) * 2), set()
    for datum in images:
        known = surroundings(datum, unknowns)
        if not known:
            continue
        groups |= {name.removesuffix(".temperature") for name in known}
        with changed(datum.scene, {name: value + HOTTER_K for name, value in known.items()}):
            total += information(rendered(datum, unknowns, x, sampling), x)
    if groups:
        result.append(
            Proposal(
                f"a second state with the surroundings ({listed(sorted(groups))}) {HOTTER_K:g} K "
                "hotter by a known amount",
                total,
            )
        )
    return result


def surroundings(datum: Datum, unknowns: list[Unknown]) -> dict[str, float]:
    """Temperatures of the groups of a datum's scene of which nothing is unknown."""
    taken = {unknowns[k].name.partition("@")[0] for k in datum.numbers(unknowns)}
    taken = {name.removesuffix(".temperature") for name in taken}
    return {
        name: parameter.value
        for name, parameter in datum.where.parameters.items()
        if parameter.kind == "temperature"
        and "@" not in name
        and name.removesuffix(".temperature") not in taken
    }


def other_bands(data: list[Datum], loader: Loader, first: int) -> dict[str, list[Datum]]:
    """The images again in other bands, by what they are, numbered from `first` on.

    A scene without a parameter `band`, or a material that was not measured in the band, gives none.
    """
    result = {}
    for band in BANDS:
        made = []
        for datum in data:
            entry = datum.entry
            if (
                datum.is_image
                and entry.netd_mK is not None
                and band != datum.scene.band.name
                and "band" in survey(datum.scene.path, datum.scene.parameters)
            ):
                same = {name: getattr(entry, name) for name in ALIKE}
                in_band = {**entry.parameters, "band": band}
                candidate = Candidate(**same, name=f"{entry.name} in {band}", parameters=in_band)
                with suppress(InputError):
                    made.append(loader.datum(candidate, first, set()))
                    first += 1
        if made:
            result[f"the same {'image' if len(made) == 1 else 'images'} in {band}"] = made
    return result


def rendered(
    datum: Datum, unknowns: list[Unknown], x: np.ndarray, sampling: RenderSettings
) -> DatumBlock:
    block = datum.block(unknowns, x, sampling)
    return block.weighed(datum.weighing(unknowns, x, sampling))


def information(block: DatumBlock, x: np.ndarray) -> np.ndarray:
    """Information (N, N) that a measurement with this prediction would give."""
    expected = replace(block, measured=block.radiance.mean(axis=0))
    return equations([expected], x).information


def listed(names: list[str]) -> str:
    shown = names[:MOST_NAMED]
    more = len(names) - len(shown)
    return ", ".join(shown) + (f" and {more} more" if more else "")

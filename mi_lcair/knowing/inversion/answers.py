"""What an estimate says: errors, verdicts, and the directions that the data cannot separate."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
from scipy import stats

from mi_lcair.declared import percent
from mi_lcair.knowing.inversion.data.readings import ASSUMED_SIGMA
from mi_lcair.knowing.inversion.least_squares.prediction import DatumBlock, weighed_product
from mi_lcair.knowing.inversion.least_squares.solve import State
from mi_lcair.knowing.inversion.unknowns import Unknown
from mi_lcair.physics.estimation.verdicts import (
    SIGNIFICANCE,
    Verdict,
    chi_square_text,
    correlation,
    student_factor,
)

HALF_WIDTH = student_factor(np.inf)  # half of a 95 % interval, standard errors
LEAST_FREEDOM = 1.0  # smallest number of degrees of freedom with which residuals are tested
MOST_ASSUMED = 5.0  # factor by which what is assumed may widen an interval that is determined
NAMED = 0.1  # share of a variance from which what is assumed is named
ALIKE = 0.95  # correlation from which two unknowns are said to trade
# The entries of `chi_square` where there is nothing to test
UNTESTED = {
    "chi_square": 0.0,
    "chi_square_scatter": 0.0,
    "degrees_of_freedom": 0.0,
    "p_value": None,
}
OF_UNKNOWN = ("label", "name", "kind", "unit", "is_sought", "facet")  # fields of an `Unknown`
LONGEST_WORDS = 12  # largest number of directions that are put into words
ASSUMED = 0.5  # part of a variance, made by assumed ranges, from which the data say nothing


@dataclass(frozen=True)
class Answer:
    """What the data say about one unknown.

    label, name, kind, unit, facet: as in `Unknown`. value, standard_error: the estimate.
    lower, upper: its 95 % interval. verdict: in words. is_sought: False for a nuisance parameter.
    """

    label: str
    name: str
    kind: str
    unit: str
    value: float
    standard_error: float
    lower: float
    upper: float
    verdict: str
    is_sought: bool
    facet: int | None

    @property
    def is_determined(self) -> bool:
        return self.verdict.startswith(Verdict.DETERMINED)


@dataclass(frozen=True)
class Direction:
    """Two unknowns that the data hardly separate.

    labels: their labels. correlation: of their errors. slope: change of the first for a change of 1
    of the second. words: the same as a sentence.
    """

    labels: tuple[str, str]
    correlation: float
    slope: float
    words: str


def answers(
    unknowns: list[Unknown],
    state: State,
    is_goal: bool = False,
    assumed: Mapping[str, np.ndarray] = MappingProxyType({}),
) -> list[Answer]:
    """The answer for each unknown.

    is_goal: whether the values were chosen to reach a goal. assumed: what errors that nobody stated
    add to the standard errors (N,), by name.
    """
    result, free = [], assumed_share(unknowns, state.covariance)
    for k, unknown in enumerate(unknowns):
        value, error = float(state.x[k]), float(np.sqrt(max(state.covariance[k, k], 0)))
        low, high = state.intervals[k]
        if np.isnan(low):
            low, high = value - HALF_WIDTH * error, value + HALF_WIDTH * error
        half, at_bound = max(value - low, high - value), state.at_bound[k]
        is_precise = unknown.is_determined(value, half)
        verdict = Verdict.of(high - low, unknown.span, at_bound != 0, is_precise)
        if free[k] > ASSUMED:
            verdict = Verdict.ASSUMED
        if state.held[k]:
            verdict = Verdict.HIDDEN
        shares = {name: of[k] ** 2 / error**2 for name, of in assumed.items() if error}
        without = half * np.sqrt(max(1 - sum(shares.values()), 0))
        is_near = unknown.is_determined(value, half / MOST_ASSUMED)
        if verdict == Verdict.WEAK and is_near and unknown.is_determined(value, without):
            verdict = Verdict.CONDITIONAL
        verdict = verdict.of_goal if is_goal else verdict
        low, high = np.clip((low, high), unknown.lower, unknown.upper).tolist()
        span = f"{low:.4g}..{high:.4g} {unknown.unit.removesuffix('1')}".rstrip()
        bound = f"{unknown.lower if at_bound < 0 else unknown.upper:.4g}"
        estimate = {"value": value, "standard_error": error, "lower": low, "upper": high}
        same = {name: getattr(unknown, name) for name in OF_UNKNOWN}
        words = verdict.sentence(span=span, bound=bound, what=condition(shares))
        result.append(Answer(**same, **estimate, verdict=words))
    return result


def assumed_share(unknowns: list[Unknown], covariance: np.ndarray) -> np.ndarray:
    """Part of each variance, (N,), that comes from the ranges of modes without a prior.

    The range of an amplitude is no knowledge, unlike those of other unknowns. If the data leave a
    direction of modes open, it limits all that change along it, even to a narrow interval.
    """
    modes = [k for k, u in enumerate(unknowns) if u.kind == "mode" and u.prior is None]
    spans = np.array([unknowns[k].span for k in modes])
    variance = np.maximum(np.diag(covariance), np.finfo(float).tiny)
    return np.sum((covariance[:, modes] / spans) ** 2, axis=1) / variance


def condition(shares: dict[str, float]) -> str:
    """The assumption on which an interval rests. shares: of the variance, by name."""
    names = [name for name, share in shares.items() if share > NAMED]
    verb = "is" if len(names) == 1 else "are"
    return f"{' and '.join(names)} {verb} right within {percent(ASSUMED_SIGMA)}"


def withdrawn(answers: list[Answer], words: str) -> list[Answer]:
    """The answers with other words where the verdict claims an interval, exact or wide."""
    return [
        replace(answer, verdict=words) if Verdict.has_interval(answer.verdict) else answer
        for answer in answers
    ]


def misfit(p_value: float | None) -> str | None:
    """The verdict on unknowns whose data the model misses; None if it does not miss them."""
    if p_value is None or p_value >= SIGNIFICANCE:
        return None
    return Verdict.MISSED.sentence(what=f"the measured values (p = {p_value:.1g})")


def directions(answers: list[Answer], covariance: np.ndarray, reasons) -> list[Direction]:
    """Pairs of unknowns that the data hardly separate, the worst first.

    Only pairs with one that is not determined count. reasons: function of the numbers of two
    unknowns that says why.
    """
    matrix = correlation(covariance)
    pairs = [
        (abs(matrix[a, b]), a, b)
        for a in range(len(answers))
        for b in range(a)
        if abs(matrix[a, b]) >= ALIKE
        and not (answers[a].is_determined and answers[b].is_determined)
        and not answers[a].kind == answers[b].kind == "facet"
    ]
    result = []
    for _, a, b in sorted(pairs, reverse=True)[:LONGEST_WORDS]:
        # The quantity with a unit is said to change for 1 of the other
        first, second = sorted((a, b), key=lambda k: (answers[k].unit == "1", k))
        slope = covariance[first, second] / covariance[second, second]
        result.append(
            Direction(
                labels=(answers[first].label, answers[second].label),
                correlation=float(matrix[a, b]),
                slope=float(slope),
                words=f"{traded(answers[first], answers[second], slope)}: {reasons(first, second)}",
            )
        )
    return result


def traded(first: Answer, second: Answer, slope: float) -> str:
    """The trade of two unknowns in words."""
    unit = first.unit.removesuffix("1")
    per = "a unit" if second.unit == "1" else f"for 1 {second.unit}"
    owner, name = split(first.label)
    other, other_name = split(second.label)
    if owner == other:
        both = f"{name} and {other_name} of `{owner}`"
    else:
        both = f"`{first.label}` and `{second.label}`"
    return f"{both} trade at {f'{abs(slope):.3g} {unit}'.rstrip()} {per}"


def split(label: str) -> tuple[str, str]:
    """Owner and rest of a label: ("lid", "temperature [hot]")."""
    name, bracket, of = label.partition(" [")
    owner, _, rest = name.rpartition(".")
    return owner, rest + bracket + of


def chi_square(blocks: list[DatumBlock], x: np.ndarray, determined: float) -> dict:
    """Squared residuals in units of the measurement's noise, and how probable larger ones are.

    Products of different randomisations keep the render's own noise out of the sum, but it widens
    the sum's distribution. The probability is that of the chi-square distribution of the
    measurement's noise alone, stretched about its mean to the sum's variance. Pixels in which the
    render is noisier than the measurement count less. `chi_square_scatter` is the standard
    deviation of the sum that the noise of the render makes; with much noise of the render the sum
    may be far from the degrees of freedom, and negative.

    determined: number of combinations of unknowns that the data determine.
    """
    total, expected, squared, added, points = 0.0, 0.0, 0.0, 0.0, 0
    for block in blocks:
        prediction = block.at(x)
        w, R = block.weight, len(prediction.radiance)
        r = [row[:, None] for row in prediction.residuals]
        total += float(np.ravel(weighed_product(w, block.common, r, r))[0])
        measured, rendered = w * prediction.noise**2, w * prediction.variance
        expected += float(measured.sum())
        if block.common:
            expected += block.common.expected(w, prediction.noise**2)
        squared += float(np.sum(measured**2))
        # A product of different randomisations has R / (R - 1) times the square of the variance,
        # and the square of its estimate is too large by (R + 1) / (R - 1)
        both = R / (R + 1) * block.spread * rendered**2
        added += float(np.sum(2 * measured * rendered + both))
        points += np.count_nonzero(w)
    dof = points - determined
    if dof < LEAST_FREEDOM:
        return UNTESTED | {"chi_square": total}
    share = dof / points
    equivalent = share * expected**2 / squared
    ratio = total / (share * expected)
    stretch = np.sqrt(1 + added / squared)
    p = float(stats.chi2.sf(equivalent * (1 + (ratio - 1) / stretch), equivalent))
    scatter = dof * float(np.sqrt(2 * added / squared / equivalent))
    return {
        "chi_square": ratio * dof,
        "chi_square_scatter": scatter,
        "degrees_of_freedom": dof,
        "p_value": p,
    }


def in_words(chi_square, chi_square_scatter, degrees_of_freedom, p_value) -> str:
    """The entries of `chi_square` in words."""
    freedom = degrees_of_freedom
    return chi_square_text(chi_square / freedom, freedom, p_value, chi_square_scatter / freedom)

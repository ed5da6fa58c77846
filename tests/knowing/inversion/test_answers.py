"""Verdicts, trades and chi-square of invented estimates."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from mi_lcair.knowing.inversion.answers import answers, chi_square, directions
from mi_lcair.physics.estimation.verdicts import Verdict
from tests.knowing.inversion.blocks import block, estimated, kelvin, unknown

GAIN = unknown("gain [a]", kind="gain", lower=0.0, upper=np.inf, start=1.0, is_sought=False)


def answer(one, value, error, at_bound=0, held=False):
    (result,) = answers([one], estimated([value], [[error**2]], at_bound, held))
    return result


@pytest.mark.parametrize(
    ("one", "value", "error", "verdict"),
    [
        (kelvin(), 300.0, 0.51, "determined"),  # 1.96 x 0.51 is just below 1 K
        (kelvin(), 300.0, 0.52, "weakly determined: interval 299..301 K"),
        (kelvin(), 300.0, 12.7, "weakly determined: interval 275.1..324.9 K"),
        # an interval of half of 100 K says nothing
        (kelvin(), 300.0, 12.8, "not determined by these data: any value in 274.9..325.1 K fits"),
        (kelvin(lower=290.0), 300.0, 13.0, "not determined .* any value in 290..325.5 K fits"),
        (unknown(), 0.04, 0.0103, "weakly determined: interval 0.01981..0.06019"),
        (unknown(), 0.04, 0.0101, "determined"),  # 0.02
        (unknown(), 0.4, 0.050, "determined"),  # a quarter of the value
        (unknown(), 0.4, 0.052, "weakly determined: interval 0.2981..0.5019"),
        (unknown(), 0.9, 0.12, "weakly determined: interval 0.6648..1"),
        (GAIN, 1.0, 0.0254, "determined"),
        (GAIN, 1.0, 0.0256, "weakly determined: interval 0.9498..1.05"),
    ],
)
def test_verdicts(one, value, error, verdict):
    assert re.fullmatch(verdict, answer(one, value, error).verdict)


@pytest.mark.parametrize(
    ("error", "gain", "offset", "verdict"),
    [
        (0.9, 0.8, 0.0, "determined if the gain is right within 1 %: interval 298.2..301.8 K"),
        (0.9, 0.6, 0.6, "determined if the gain and the offset are right within 1 %: interval .*"),
        (0.5, 0.4, 0.0, "determined"),
        (0.9, 0.7, 0.2, "weakly determined: interval 298.2..301.8 K"),  # 1.96 x 0.53 K without it
        (2.6, 2.59, 0.0, "weakly determined: interval 294.9..305.1 K"),  # more than 5 K
    ],
)
def test_a_verdict_on_an_assumption(error, gain, offset, verdict):
    """An interval that would be short without what is assumed, and is not much longer with it."""
    assumed = {"the gain": np.array([gain]), "the offset": np.array([offset])}
    (result,) = answers([kelvin()], estimated([300.0], [[error**2]]), assumed=assumed)
    assert re.fullmatch(verdict, result.verdict)
    assert result.is_determined == verdict.startswith("determined")


def test_intervals_end_at_the_bounds():
    result = answer(unknown(), 0.9, 0.1)
    assert (result.lower, result.upper) == pytest.approx((0.9 - 1.959964 * 0.1, 1.0))
    assert result.value == 0.9 and result.standard_error == pytest.approx(0.1)
    assert answer(unknown(), 0.0, 0.02, -1).verdict == "at its bound 0: interval 0..0.0392"
    assert answer(unknown(), 1.0, 0.02, 1).verdict == "at its bound 1: interval 0.9608..1"
    assert answer(unknown(), 0.5, 0.001, held=True).verdict == Verdict.HIDDEN
    assert answer(unknown(), 0.5, 0.0).is_determined


@pytest.mark.parametrize(
    ("error", "at_bound", "words"),
    [
        (0.01, 0, "chosen"),
        (0.065, 0, "chosen, but 0.3726..0.6274 does nearly as well"),
        (0.2, 0, "free: any value in 0.108..0.892 does as well"),
        (0.01, 1, "at its bound 1: interval 0.4804..0.5196"),
    ],
)
def test_values_that_reach_a_goal(error, at_bound, words):
    state = estimated([0.5], [[error**2]], at_bound)
    assert answers([unknown()], state, is_goal=True)[0].verdict == words


def test_profile_intervals_take_the_place_of_linear_ones():
    """Their wider side decides whether the unknown is determined."""
    state = estimated([0.02], [[0.001**2]])
    for interval, words in (((0.015, 0.035), "determined"), ((0.0, 0.041), "weakly determined: ")):
        state.intervals[0] = interval
        (answer,) = answers([unknown()], state)
        assert (answer.lower, answer.upper) == interval
        assert answer.verdict.startswith(words) and answer.standard_error == 0.001


def test_the_range_of_an_amplitude_is_no_knowledge():
    """a and 1000 h trade: the range of a, not the data, limits h to 0.2. A prior of a is known."""
    mode = {"kind": "mode", "lower": -100.0, "upper": 100.0, "start": 0.0}
    h, known = unknown("heat.h", **mode), unknown("heat.sky_K", **mode)
    ratio, data = np.array([1.0, 1e-3, 0.0]), 1e-6 * np.eye(3)
    a = unknown("heat.absorptance", **mode)
    found = answers([a, h, known], estimated([0.0] * 3, 200**2 * np.outer(ratio, ratio) + data))
    assert [one.verdict for one in found] == [Verdict.ASSUMED, Verdict.ASSUMED, "determined"]
    a = unknown("heat.absorptance", prior=(0.0, 1.0), **mode)
    found = answers([a, h, known], estimated([0.0] * 3, np.outer(ratio, ratio) + data))
    assert found[0].verdict.startswith("weakly") and found[1].is_determined


def test_unknowns_that_trade():
    """The one with a unit is said to change; the worst pair comes first."""
    ones = [unknown("paint.b"), kelvin("lid.temperature [hot]"), unknown("paint.e")]
    covariance = np.array([[1.0, 19.2, 0.97], [19.2, 400, 18], [0.97, 18, 1]])
    judged = answers(ones, estimated([0.5, 300, 0.5], covariance))
    found = directions(judged, covariance, lambda a, b: f"because {a}{b}")
    assert [direction.correlation for direction in found] == pytest.approx([0.97, 0.96])
    assert found[0].words == "b and e of `paint` trade at 0.97 a unit: because 02"
    assert found[1].labels == ("lid.temperature [hot]", "paint.b")
    assert found[1].slope == pytest.approx(19.2)
    assert found[1].words.startswith("`lid.temperature [hot]` and `paint.b` trade at 19.2 K a unit")
    small = 1e-8 * covariance
    known = answers(ones, estimated([0.5, 300, 0.5], small))
    assert directions(known, small, None) == []
    facets = [replace(one, kind="facet") for one in judged]
    assert directions(facets, covariance, None) == []


def test_temperatures_that_trade():
    ones = [kelvin("a.temperature"), kelvin("b.temperature")]
    covariance = np.array([[400.0, -790], [-790, 1600]])
    judged = answers(ones, estimated([300, 300], covariance))
    (found,) = directions(judged, covariance, lambda a, b: "so")
    assert found.slope == pytest.approx(-790 / 1600)
    assert found.words == "`a.temperature` and `b.temperature` trade at 0.494 K for 1 K: so"


def test_chi_square_without_noise_of_the_render():
    """The sum of squares, and its probability with the remaining degrees of freedom."""
    r = np.array([0.3, -0.4, 0.1, 0.6, -0.2])
    one = block([np.zeros(5)], np.zeros((1, 5, 1)), r, 0.25)
    total = np.sum(r**2) / 0.25**2
    found = chi_square([one], np.zeros(1), 1.5)
    assert found["degrees_of_freedom"] == 3.5
    # The expectation of 5 values, of which 1.5 are determined, is 3.5
    assert found["chi_square"] == pytest.approx(total)
    assert found["p_value"] == pytest.approx(stats.chi2.sf(total, 3.5))
    twice = chi_square([one, one], np.zeros(1), 1.5)
    assert twice["chi_square"] == pytest.approx(2 * total)
    assert twice["p_value"] == pytest.approx(stats.chi2.sf(2 * total, 8.5))
    for determined in (4.1, 5):  # a fraction of a value is left over, or nothing
        none = chi_square([one], np.zeros(1), determined)
        assert none["p_value"] is None and none["chi_square"] == pytest.approx(total)


@pytest.mark.parametrize("rendered", [0.6, 5.0])
def test_chi_square_with_noise_of_the_render_has_its_mean_and_variance(rendered):
    """Over many draws of both noises: mean and variance of the sum, from which p is computed."""
    random = np.random.default_rng(0)
    R, n, sigma = 4, 30, 0.5
    draws = []
    for _ in range(1500):
        F = rendered * random.normal(size=(R, n))
        one = block(F, np.zeros((R, n, 1)), sigma * random.normal(size=n), sigma)
        draws.append(chi_square([one], np.zeros(1), 0.0))
    total = np.array([draw["chi_square"] for draw in draws])
    assert total.mean() == pytest.approx(n, abs=4 * total.std() / np.sqrt(len(draws)))
    scatter = np.array([draw["chi_square_scatter"] for draw in draws])
    assert total.var() == pytest.approx(2 * n + np.mean(scatter**2), rel=0.15)
    p = np.array([draw["p_value"] for draw in draws])
    assert p.mean() == pytest.approx(0.5, abs=0.03)
    assert np.mean(p < 0.05) == pytest.approx(0.05, abs=0.025)


def test_probability_with_noise_of_the_render():
    """The measurement's chi-square, stretched to the variance of the sum.

    This variance is 2 m^2 + 4 m v + 2 v^2 R / (R - 1), and 2 m^2 for the measurement alone. The
    mean of the square of an estimated v is (R + 1) / (R - 1) v^2.
    """
    random = np.random.default_rng(4)
    R, n, sigma = 3, 12, 0.5
    F, measured = 0.4 * random.normal(size=(R, n)), 0.5 * random.normal(size=n)
    weight = 1 + random.random(n)
    one = block(F, np.zeros((R, n, 1)), measured, sigma, weight=weight)
    found = chi_square([one], np.zeros(1), 2.0)
    r = measured - F
    total = np.mean([np.sum(weight * r[a] * r[b]) for a in range(R) for b in range(R) if a != b])
    m, v = weight * sigma**2, weight * F.var(axis=0, ddof=1) / R
    share = 10 / 12
    variance = share * np.sum(2 * m**2 + 4 * m * v + 2 * v**2 * R / (R + 1))
    alone = 2 * share * np.sum(m**2)
    equivalent = 2 * (share * m.sum()) ** 2 / alone
    ratio = total / (share * m.sum())
    deviation = (total - share * m.sum()) / np.sqrt(variance)
    assert found["chi_square"] == pytest.approx(10 * ratio)
    probability = stats.chi2.sf(equivalent + np.sqrt(2 * equivalent) * deviation, equivalent)
    assert found["p_value"] == pytest.approx(probability)


def test_one_that_is_not_determined_makes_a_pair():
    ones = [kelvin("a.temperature"), unknown("paint.b")]
    covariance = np.array([[0.01, 0.0196], [0.0196, 0.04]])  # the first is known to 0.1 K
    judged = answers(ones, estimated([300, 0.5], covariance))
    assert [one.is_determined for one in judged] == [True, False]
    assert len(directions(judged, covariance, lambda a, b: "so")) == 1

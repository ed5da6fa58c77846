"""Verdicts that follow from intervals, and their sentences."""

import numpy as np
import pytest
from scipy import stats

from mi_lcair.physics.estimation.verdicts import (
    NARROW,
    STEPS,
    Verdict,
    chi_square_text,
    correlation,
    further,
    inner_deviation,
    profile_ends,
    student_factor,
)

# Searches for the ends of intervals against closed forms; correlations
# ---------------------------------------------------------------------

LEVEL = 1.96


def ends(distance, best, first, bound):
    """Ends of profiles with a distance in closed form, and the number of places tried."""
    tried = []

    def refit(profiles, values, minima):
        tried.append(len(profiles))
        assert minima.shape == (len(profiles), 1)
        reached = np.array([distance(p, v) for p, v in zip(profiles, values)])
        return reached, values[:, None]

    inside, reached, outside = profile_ends(refit, best, np.zeros(1), first, bound, LEVEL)
    return further(np.array(best), inside[:, 0], reached, LEVEL), inside[:, 0], outside, tried


def test_ends_of_lines_and_curves():
    """Straight and curved profiles on both sides, from first values too near and too far."""
    slopes, powers = np.array([2.0, 0.05, 3.0, 4.0]), np.array([1, 1, 2, 0.5])
    sign = np.array([1, -1, 1, -1])
    expected = 1 + sign * (LEVEL / slopes) ** (1 / powers)
    found, inside, outside, tried = ends(
        lambda p, value: slopes[p] * abs(value - 1) ** powers[p],
        np.ones(4),
        1 + sign * [50.0, 0.01, 0.2, 10.0],
        1e4 * sign,
    )
    np.testing.assert_allclose(found[:2], expected[:2])
    np.testing.assert_allclose(found - 1, expected - 1, rtol=2 * NARROW)
    assert np.all(sign * (inside - expected) <= 1e-12)
    assert np.all(sign * (expected - outside) <= 1e-12)
    assert len(tried) <= STEPS and tried[0] == 4 and tried[-1] < 4


def test_profiles_end_at_bounds():
    """Data that say nothing; an estimate that lies at its bound is not tried at all."""
    _, inside, outside, tried = ends(lambda p, v: 1e-3, [0.5, 2.0], [0.6, 2.0], [0.9, 2.0])
    np.testing.assert_allclose(outside, [0.9, 2.0])
    assert inside[0] == 0.9 and set(tried) == {1}


@pytest.mark.parametrize(
    "distance, place",
    [(1.7, 1.5 * 1.96 / 1.7), (1.4, 1.95), (1.9, 1.55)],
)
def test_places_between_one_inside_and_one_outside(distance, place):
    """11 is inside and 12 outside. At the middle the distance decides about the next place.

    It is where a straight profile from 10 ends, but 10 % of the gap of 0.5 from either end.
    """
    known, tried = {11.0: LEVEL / 2, 12.0: 3.0, 11.5: distance}, []

    def refit(profiles, values, minima):
        tried.extend(values)
        return np.array([known.get(value, LEVEL) for value in values]), values[:, None]

    inside, reached, outside = profile_ends(refit, [10.0], np.zeros(1), [11.0], [99.0], LEVEL)
    assert tried == pytest.approx([11, 12, 11.5, 10 + place])
    assert (inside[0, 0], reached[0], outside[0]) == (tried[-1], LEVEL, 12)


@pytest.mark.parametrize("distance, places", [(0.9795, 2), (0.9805, 1)])
def test_a_search_ends_within_2_percent_of_the_level(distance, places):
    *_, tried = ends(lambda p, v: distance * LEVEL if v < 11.01 else LEVEL, [10.0], [11.0], [99.0])
    assert len(tried) == places


def test_a_search_ends_where_2_percent_are_left():
    """Jumps between 11 and 13, the first places outside: what is tried closes in on each."""
    jumps, tried = np.linspace(11.0001, 12.9999, 200), [[] for _ in range(200)]

    def refit(profiles, values, minima):
        for profile, value in zip(profiles, values):
            tried[profile].append(value)
        return np.where(values > jumps[profiles], 9.0, 0.0), minima

    best = np.full(200, 10.0)
    profile_ends(refit, best, np.zeros(1), best + 1, best + 90, LEVEL)
    for jump, places in zip(jumps, tried):
        gaps = []
        for k in range(2, 1 + len(places)):
            outside = min(place for place in places[:k] if place > jump)
            inside = max(place for place in places[:k] if place <= jump)
            gaps.append((outside - inside) / (outside - 10))
        assert gaps[-1] < 0.02 <= min(gaps[:-1])


def test_a_search_ends_after_16_places():
    """Where the distance does not grow, each place is three times as far as the last one."""
    _, inside, outside, tried = ends(lambda p, value: 0.0, [0.0], [1.0], [1e30])
    assert len(tried) == 16 and inside[0] == pytest.approx(3.0**15) and outside[0] == 1e30
    assert further(1.0, 10.0, 1e9, LEVEL) == pytest.approx(4)  # a third of the way at least


def test_student_factor():
    for freedom, factor in ((1, 12.706), (5, 2.571), (30, 2.042), (np.inf, 1.95996)):
        assert student_factor(freedom) == pytest.approx(factor, abs=1e-3)
    assert student_factor(0) == np.inf
    for freedom in (*range(1, 70), 2.5):
        assert student_factor(freedom) == pytest.approx(stats.t.ppf(0.975, freedom), rel=1e-13)


def test_correlation_of_values_that_do_not_vary():
    found = correlation(np.array([[4.0, 3.0, 0], [3.0, 9.0, 0], [0, 0, 0]]))
    np.testing.assert_allclose(found, [[1, 0.5, 0], [0.5, 1, 0], [0, 0, 1]])
    for sign in (1, -1):  # the squared root of 3 is rounded to less than 3
        assert correlation(np.array([[3.0, 3 * sign], [3 * sign, 3]]))[0, 1] == sign


def test_inner_deviation_is_that_of_a_normal_distribution():
    white = stats.norm.ppf((np.arange(400) + 0.5) / 400, scale=2)
    assert inner_deviation(white, 0.0) == pytest.approx(2, rel=1e-3)
    assert inner_deviation(np.append(white, np.full(20, 1e9)), 0.0) == pytest.approx(2, rel=0.15)
    assert inner_deviation(np.zeros(5), 1e-9) == 1e-9


@pytest.mark.parametrize(
    ("width", "is_at_bound", "is_precise", "verdict"),
    [
        (0.49, False, True, Verdict.DETERMINED),
        (0.49, False, False, Verdict.WEAK),
        (0.49, True, True, Verdict.AT_BOUND),
        (0.50, True, True, Verdict.WIDE),
    ],
)
def test_verdict_of_an_interval(width, is_at_bound, is_precise, verdict):
    assert Verdict.of(3 * width, 3.0, is_at_bound, is_precise) is verdict


def test_sentences():
    texts = {verdict: verdict.sentence(span="1..2 K", bound="0", what="it") for verdict in Verdict}
    assert texts[Verdict.WEAK] == "weakly determined: interval 1..2 K"
    assert texts[Verdict.AT_BOUND.of_goal] == "at its bound 0: interval 1..2 K"
    assert texts[Verdict.WIDE.of_goal] == "free: any value in 1..2 K does as well"
    with_interval = {verdict for verdict in Verdict if Verdict.has_interval(texts[verdict])}
    assert with_interval == {Verdict.DETERMINED, Verdict.CONDITIONAL, Verdict.WEAK}


def test_chi_square_in_words():
    assert chi_square_text(1.234, 7, 0.0321) == "1.23 for each of 7 degrees of freedom, p = 0.032"
    assert chi_square_text(1.234, 7, 0.5, 0.25).startswith("1.23 +- 0.25 for each of 7 degrees")

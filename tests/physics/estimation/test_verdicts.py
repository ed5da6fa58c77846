"""Verdicts that follow from intervals, and their sentences."""

import numpy as np
import pytest

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


def test_student_factor():
    for freedom, factor in ((1, 12.706), (5, 2.571), (30, 2.042), (np.inf, 1.95996)):
        assert student_factor(freedom) == pytest.approx(factor, abs=1e-3)
    assert student_factor(0) == np.inf


def test_correlation_of_values_that_do_not_vary():
    found = correlation(np.array([[4.0, 3.0, 0], [3.0, 9.0, 0], [0, 0, 0]]))
    np.testing.assert_allclose(found, [[1, 0.5, 0], [0.5, 1, 0], [0, 0, 1]])


def test_inner_deviation_is_that_of_a_normal_distribution():
    white = 2 * np.random.default_rng(0).standard_normal(400)
    assert inner_deviation(white) == pytest.approx(2, rel=0.1)
    assert inner_deviation(np.append(white, np.full(20, 1e9))) == pytest.approx(2, rel=0.15)
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
    assert Verdict.of(width, 1.0, is_at_bound, is_precise) is verdict


def test_sentences():
    texts = {verdict: verdict.sentence(span="1..2 K", bound="0", what="it") for verdict in Verdict}
    assert texts[Verdict.WEAK] == "weakly determined: interval 1..2 K"
    assert texts[Verdict.AT_BOUND.of_goal] == "at its bound 0: interval 1..2 K"
    assert texts[Verdict.WIDE.of_goal] == "free: anything in 1..2 K does as well"
    with_interval = {verdict for verdict in Verdict if Verdict.has_interval(texts[verdict])}
    assert with_interval == {Verdict.DETERMINED, Verdict.WEAK}


def test_chi_square_in_words():
    assert chi_square_text(1.234, 7, 0.0321) == "1.23 for each of 7 degrees of freedom, p = 0.032"
    assert chi_square_text(1.234, 7, 0.5, 0.25).startswith("1.23 +- 0.25 for each of 7 degrees")

"""Verdicts that follow from intervals, and their sentences."""

import pytest

from mi_lcair.physics.estimation.verdicts import Verdict, chi_square_text


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

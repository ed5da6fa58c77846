"""What further measurements would bring to invented estimates."""

from types import SimpleNamespace

import numpy as np
import pytest

from mi_lcair.inversion.advice import Proposal, advice, information, listed, priors
from mi_lcair.inversion.answers import answers
from tests.inversion.blocks import block, kelvin, unknown

UNKNOWNS = [kelvin("a.temperature"), unknown("paint.b")]
INFORMATION = np.array([[0.02, 0.8], [0.8, 40.0]])
PRIOR = np.array([1e-4, 1.0])


def estimate():
    covariance = np.linalg.inv(INFORMATION + np.diag(PRIOR))
    found = answers(UNKNOWNS, [300.0, 0.3], covariance, [0, 0], [False, False])
    assert not any(answer.is_determined for answer in found)
    state = SimpleNamespace(equations=SimpleNamespace(information=INFORMATION), prior=PRIOR)
    return state, found


def test_a_measurement_of_one_unknown():
    """Errors are those of the sum of both informations; useless proposals are left out."""
    state, found = estimate()
    useless = Proposal("nothing", 1e-6 * np.eye(2))
    known = Proposal("the paint", np.diag([0.0, 1e4]))
    better = Proposal("both", np.diag([4.0, 1e4]))
    result = advice(UNKNOWNS, state, found, [useless, known, better])
    assert [one.measure for one in result] == ["both", "the paint"]
    total = INFORMATION + np.diag(PRIOR)
    expected = np.sqrt(np.diag(np.linalg.inv(total + np.diag([0.0, 1e4]))))
    before = np.sqrt(np.diag(np.linalg.inv(total)))
    one = result[1]
    assert list(one.errors.values()) == pytest.approx(expected)
    assert list(one.now.values()) == pytest.approx(before)
    assert one.gain == pytest.approx(np.mean(np.log(before / expected)))
    assert one.words == (
        f"the paint would bring paint.b from +- {before[1]:.2g} to +- {expected[1]:.2g}, "
        f"a.temperature from +- {before[0]:.2g} to +- {expected[0]:.2g} K"
    )


def test_unknowns_that_come_with_a_measurement():
    """A second temperature, known to its span of 100 K, is eliminated."""
    state, found = estimate()
    new = np.array([[0.0, 0.0, 0.0], [0.0, 9000.0, 30.0], [0.0, 30.0, 1.0]])
    (one,) = advice(UNKNOWNS, state, found, [Proposal("more", new, (kelvin("c.temperature"),))])
    whole = np.zeros((3, 3))
    whole[:2, :2] = INFORMATION + np.diag(PRIOR)
    whole[2, 2] = 100.0**-2
    expected = np.sqrt(np.diag(np.linalg.inv(whole + new)))[:2]
    assert list(one.errors.values()) == pytest.approx(expected)


def test_a_proposal_is_worth_a_fifth_of_an_error():
    """Of an unknown alone: from an error of 1 to 0.81 or 0.79."""
    ones = [unknown("a", kind="emissivity")]
    state = SimpleNamespace(equations=SimpleNamespace(information=np.ones((1, 1))), prior=[0.0])
    found = answers(ones, [0.3], np.ones((1, 1)), [0], [False])
    for error, count in ((0.81, 0), (0.79, 1)):
        proposal = Proposal("it", np.array([[error**-2.0 - 1]]))
        assert len(advice(ones, state, found, [proposal])) == count


def test_priors_that_are_proposed():
    ones = [
        kelvin("t"),
        unknown("a", prior=(0.3, 0.1)),
        unknown("b", prior=(0.3, 0.01)),
        unknown("gain [c]", kind="gain"),
        unknown("e", kind="emissivity"),
    ]
    found = {one.measure: one.information for one in priors(ones)}
    assert list(found) == ["knowing t to +- 1 K", "knowing a to +- 0.01", "knowing e to +- 0.01"]
    for measure, k, sigma in zip(found, (0, 1, 4), (1.0, 0.01, 0.01)):
        expected = np.zeros((5, 5))
        expected[k, k] = sigma**-2
        np.testing.assert_allclose(found[measure], expected)


def test_information_of_a_measurement_that_is_not_made():
    """J^T J / sigma^2, whatever the measured values are."""
    J = np.random.default_rng(0).normal(size=(9, 2))
    found = information(block([np.ones(9)], [J], np.full(9, np.nan), 0.3), np.zeros(2))
    np.testing.assert_allclose(found, J.T @ J / 0.09)


def test_lists_of_names():
    assert listed(["a", "b"]) == "a, b" and listed(list("abcde")) == "a, b, c and 2 more"

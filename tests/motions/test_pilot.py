"""Verdicts and errors of a pilot, from functions whose derivatives are known."""

import numpy as np
import pytest

from mi_lcair.motions.differences import Pilot

H = 0.1


def pilot(function, noise: float = 0.0, floor: float = 0.0) -> Pilot:
    """The pilot of a function at five values, with independent deviations of 8 randomisations."""
    offsets = np.array([-2, -1, 0, 1, 2]) * H
    deviations = noise * np.random.default_rng(3).normal(size=(5, 8)) / np.sqrt(8)
    return Pilot(offsets, np.column_stack([[function(x) for x in offsets], deviations]), floor)


def test_cubic():
    """D(h) = a + c h^2: its error is c h^2, a third of the change to twice the step."""
    a, b, c = 2.0, 3.0, 2.0
    result = pilot(np.polynomial.Polynomial([1, a, b, c]))
    assert result.slope(3, 1)[0] == pytest.approx(a + c * H**2)
    assert result.truncation == pytest.approx(c * H**2)
    assert result.jump == pytest.approx(2 * b * H)
    assert (result.noise, result.verdict) == (0, "smooth")


def test_kink_and_glint():
    assert pilot(abs).verdict == "kink"
    assert pilot(abs).jump == pytest.approx(2)
    assert pilot(lambda x: 3 * x + 0.05 * abs(x)).verdict == "smooth"  # 3 % of the derivative
    assert pilot(lambda x: 3 * x + 0.5 * abs(x)).verdict == "kink"
    assert pilot(lambda x: np.tanh(x / H)).verdict == "step-dependent"
    assert pilot(lambda x: x**2).verdict == "smooth"  # its one-sided slopes meet as h falls


def test_noise():
    """The error is the scatter of the difference, or the floor; noise is no verdict."""
    result = pilot(lambda x: 2 * x, noise=0.01)
    assert result.noise == pytest.approx(0.01 * np.sqrt(2) / (2 * H), rel=0.4)
    assert pilot(lambda x: 2 * x, noise=0.01, floor=7.0).noise == 7
    hidden = pilot(lambda x: 2 * x + 0.004 * abs(x), noise=0.05)
    assert (hidden.jump, hidden.verdict) == (0, "smooth")
    drowned = pilot(np.polynomial.Polynomial([0, 2, 0, 0.5]), noise=0.05)
    assert drowned.truncation == 0

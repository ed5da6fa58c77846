"""Verdicts and errors of a pilot, from functions whose derivatives are known."""

import numpy as np
import pytest

from mi_lcair.derivatives.motions.differences import ATTACHED, PILOT_PATHS, Differences, Pilot
from mi_lcair.rendering.sampling import Sampling

H = 0.1


def pilot(function, noise: float = 0.0, floor: float = 0.0, h: float = H) -> Pilot:
    """The pilot of a function at five values, with independent deviations of 8 randomisations."""
    offsets = np.array([-2, -1, 0, 1, 2]) * h
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
    # The one-sided slopes of the second meet fast enough as h falls
    assert pilot(lambda x: abs(x) ** 1.3).verdict == "kink"
    assert pilot(lambda x: abs(x) ** 1.6).verdict == "smooth"


def test_noise():
    """The error is the scatter of the difference, or the floor; noise is no verdict."""
    result = pilot(lambda x: 2 * x, noise=0.01)
    assert result.noise == pytest.approx(0.01 * np.sqrt(2) / (2 * H), rel=0.4)
    assert pilot(lambda x: 2 * x, noise=0.01, floor=7.0).noise == 7
    hidden = pilot(lambda x: 2 * x + 0.004 * abs(x), noise=0.05)
    assert (hidden.jump, hidden.verdict) == (0, "smooth")
    drowned = pilot(np.polynomial.Polynomial([0, 2, 0, 0.5]), noise=0.05)
    assert drowned.truncation == 0


class Along(Differences):
    """Differences of a function, with noise that is a function of the step."""

    def __init__(self, function, noise_of):
        self.function, self.noise_of = function, noise_of
        self.sampling = Sampling(paths=PILOT_PATHS)

    def pilot(self, h, kind):
        return pilot(self.function, floor=self.noise_of(h), h=h)


@pytest.mark.parametrize(
    ("function", "noise_of", "steps"),
    [
        (lambda x: 2 * x + x**3, lambda h: 0.0, 1 / 2),  # truncation of 0.5 % at the first step
        (lambda x: 2 * x, lambda h: 0.01 / h, 2**4),  # noise that a longer step lowers
        (lambda x: 2 * x, lambda h: 0.001, 1),  # fine already
        (lambda x: 2 * x, lambda h: 0.1, 1),  # noise that no step lowers
        (abs, lambda h: 0.01 / h, 1),
    ],
)
def test_better_step(function, noise_of, steps):
    first = Along(function, noise_of).pilot(H, ATTACHED)
    step, result = Along(function, noise_of).better_step(H, first, ATTACHED)
    assert step == pytest.approx(steps * H)
    assert result.offsets[3] == pytest.approx(step)


def test_better_step_stops_before_a_facet_turns_away():
    """A longer step has less noise, but its difference would be another one."""

    def bent(x):
        return 2 * x - np.sign(x) * np.maximum(np.abs(x) - 1.2 * H, 0)

    first = Along(bent, lambda h: 0.02 / h).pilot(H, ATTACHED)
    assert Along(bent, lambda h: 0.02 / h).better_step(H, first, ATTACHED)[0] == H


@pytest.mark.parametrize(
    ("kink", "noise_of", "halvings"),
    [
        (0.2 * H, lambda h: 0.0, 4),  # within twice the step up to an eighth of it
        (0.0, lambda h: 0.0, 0),  # at the present value
        (0.2 * H, lambda h: 0.2 * H / h, 0),  # seen over the first step only
        (3 * H, lambda h: 0.0, 0),  # beyond all five values
    ],
)
def test_smooth_step(kink, noise_of, halvings):
    along = Along(lambda x: abs(x - kink), noise_of)
    step, result = along.smooth_step(H, along.pilot(H, ATTACHED), ATTACHED)
    assert step == H / 2**halvings == pytest.approx(result.offsets[3])
    assert result.verdict == ("kink" if kink < H and not halvings else "smooth")

"""What the first render of an estimate shows; first guesses, and how near a goal is."""

from contextlib import contextmanager
from types import SimpleNamespace

import numpy as np
import pytest

from mi_lcair.errors import InputError
from mi_lcair.knowing.inversion.estimate import (
    achieved,
    best_of_starts,
    check_seen,
    estimate,
    first_guesses,
)
from mi_lcair.knowing.inversion.tables import Goal, RenderSettings
from tests.knowing.inversion.blocks import block, kelvin, unknown

UNKNOWNS = [unknown(start=0.2, lower=0.1, upper=0.9), kelvin()]


def test_every_unknown_needs_data():
    """Facets and unknowns with a prior may do without."""
    columns = np.zeros((2, 3, 3))
    columns[1, 2, 0] = 1e-9  # one value of one randomisation
    seen = block(np.ones((2, 3)), columns, np.ones(3), gain=3)
    facet = kelvin("f", kind="facet", facet=0)
    gain = unknown("gain [a]", kind="gain")
    check_seen([unknown("a"), facet, unknown("c", prior=(0.3, 0.1)), gain], [seen])
    with pytest.raises(InputError, match="'c' is an unknown without any data"):
        check_seen([unknown("a"), facet, unknown("c"), gain], [seen])


class Picky:
    """A datum whose surface cannot have a reflectance above 0.6."""

    @contextmanager
    def at(self, unknowns, x):
        if x[0] > 0.6:
            raise InputError("too bright")
        yield


def guesses(starts):
    goal = Goal("intensity", "cavity", starts=starts)
    problem = SimpleNamespace(goal=goal, render=RenderSettings(seed=3))
    return np.array(list(first_guesses(UNKNOWNS, [Picky()], problem)))


def test_first_guesses():
    """The scene's values first, then random ones over the bounds, or 100 K about the start."""
    found = guesses(40)
    assert found.shape == (40, 2)
    np.testing.assert_array_equal(found[0], [0.2, 300])
    others = found[1:]
    assert 0.1 <= others[:, 0].min() < 0.15 and 0.55 < others[:, 0].max() <= 0.6
    assert 250 <= others[:, 1].min() < 260 and 340 < others[:, 1].max() <= 350
    assert abs(others[:, 1].mean() - 300) < 20
    assert len(guesses(1)) == 1


def test_how_near_a_goal_is():
    """rms of (3, 5) - 1 before, and of (2, 1) - 1 after."""
    before = block([[3.0, 5.0]], np.zeros((1, 2, 2)), [0, 0])
    after = block([[2.0, 1.0]], np.zeros((1, 2, 2)), [0, 0])
    datum = SimpleNamespace(
        block=lambda unknowns, x, sampling: before,
        background=np.ones(2),
        goal=Goal("contrast", "cavity", value=2.5, at_most=True, background_K=290.0),
        views=(1, 2),
    )
    state = SimpleNamespace(blocks=[after], x=np.zeros(2))
    assert achieved(datum, state, UNKNOWNS, RenderSettings()) == (
        "rms contrast over 2 aspects: 3.162 W/sr before, 0.7071 W/sr after; wanted at most 2.5 W/sr"
    )


def test_more_randomisations_where_noise_hides_an_unknown(monkeypatch):
    """Four times as many, once: the unknown is still hidden, and stays so."""
    used = []

    def solve(unknowns, render, weigh, *others):
        render(None)
        return SimpleNamespace(held=np.array([True, False]))

    datum = SimpleNamespace(
        is_image=False,
        block=lambda unknowns, x, sampling: used.append(sampling.randomisations),
        numbers=lambda unknowns: [],
    )
    for name, stub in (("solve", solve), ("check_units", print), ("check_seen", print)):
        monkeypatch.setattr(f"mi_lcair.knowing.inversion.estimate.{name}", stub)
    assert estimate([], [datum], RenderSettings(), None).held.any() and used == [4, 16]


def test_the_best_of_several_starts(monkeypatch):
    """The cost is the square of the first value that each start ends at."""
    ends = iter([0.5, -0.3, 0.4])

    def estimate(tried, data, sampling, progress):
        starts.append([one.start for one in tried])
        return SimpleNamespace(x=np.array([next(ends), 0.0]), blocks=[])

    starts = []
    monkeypatch.setattr("mi_lcair.knowing.inversion.estimate.estimate", estimate)
    monkeypatch.setattr("mi_lcair.knowing.inversion.estimate.cost_of", lambda blocks, x: x[0] ** 2)
    goal = Goal("intensity", "cavity", starts=3)
    problem = SimpleNamespace(goal=goal, render=RenderSettings(seed=3))
    assert best_of_starts(UNKNOWNS, [Picky()], problem, None).x[0] == -0.3
    np.testing.assert_array_equal(starts, guesses(3))


def test_several_starts_for_measurements(monkeypatch):
    """They keep what is known beforehand: the first guess of the problem, or a prior."""
    tries = []

    def estimate(tried, data, sampling, progress):
        tries.append(tried)
        return SimpleNamespace(x=np.array([len(tries), 0.0]), blocks=[])

    monkeypatch.setattr("mi_lcair.knowing.inversion.estimate.estimate", estimate)
    monkeypatch.setattr("mi_lcair.knowing.inversion.estimate.cost_of", lambda blocks, x: -x[0])
    problem = SimpleNamespace(goal=None, render=RenderSettings(seed=3, starts=3))
    assert best_of_starts(UNKNOWNS, [Picky()], problem, None).x[0] == 3
    assert [[one.start for one in tried] for tried in tries] == guesses(3).tolist()
    known = [(one.start, one.span) for one in UNKNOWNS]
    assert all([one.prior for one in tried] == known for tried in tries[1:])
    assert [one.prior for one in tries[0]] == [one.prior for one in UNKNOWNS]

"""Gauss-Newton steps between two renders."""

import numpy as np

from mi_lcair.inversion.least_squares import newton
from tests.inversion.blocks import unknown
from tests.inversion.least_squares.test_profile import product


def test_a_step_that_raises_the_cost_at_any_length_is_not_taken(monkeypatch):
    """The search then ends where it is; from the best values every step is such a step."""
    best = np.array([0.1, 0.5])
    blocks = [product(best, product(best, None).radiance[0])]
    prior = newton.Prior.of([unknown("a", prior=(0.1, 0.2)), unknown("b", prior=(0.5, 0.5))])
    calls = []
    monkeypatch.setattr(
        newton, "second_order", lambda *_: calls.append(1) or (np.ones(2), np.zeros(2))
    )
    np.testing.assert_array_equal(newton.minimiser(blocks, best, prior, 0.0, False), best)
    assert len(calls) == 1

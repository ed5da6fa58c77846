"""Profile-likelihood intervals against searches along closed forms."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq, minimize_scalar
from scipy.sparse import csr_array

from mi_lcair.errors import InputError
from mi_lcair.inversion.least_squares.newton import Prior
from mi_lcair.inversion.least_squares.prediction import equations
from mi_lcair.inversion.least_squares.profile import WIDTH, Profile, profile_intervals
from mi_lcair.inversion.least_squares.solve import solve
from mi_lcair.physics.blackbody import brightness_temperature
from tests.inversion.blocks import LWIR, SKY, VALUES, block, kelvin, unknown, wall

RANDOM = np.random.default_rng(3)
SIGMA, COUNT = 0.05, 30
DESIGN = RANDOM.normal(size=(COUNT, 2))


def product(x, measured):
    """A prediction that is linear in a, and in b with a slope that depends on a."""
    a, b = x
    radiance = DESIGN[:, 0] * a + DESIGN[:, 1] * (0.3 * b + a * b)
    columns = np.stack([DESIGN[:, 0] + DESIGN[:, 1] * b, DESIGN[:, 1] * (0.3 + a)], axis=1)
    weight = np.full(COUNT, SIGMA**-2.0)
    return block([radiance], [columns], measured, SIGMA, reference=np.array(x), weight=weight)


def solved(measured, unknowns):
    weights = [np.full(COUNT, SIGMA**-2.0)]
    return solve(unknowns, lambda x: [product(x, measured)], lambda x: weights, False, 30)


def cost(x, measured, unknowns):
    residual = (measured - product(x, measured).radiance[0]) / SIGMA
    priors = [((v - u.prior[0]) / u.prior[1]) ** 2 for v, u in zip(x, unknowns) if u.prior]
    spans = [((v - u.start) / u.span) ** 2 for v, u in zip(x, unknowns) if not u.prior]
    return residual @ residual + sum(priors) + sum(spans)


def reference_ends(measured, unknowns, best, k):
    """Where the cost with the other unknown at its best is 1.96^2 higher, by scipy."""
    other = unknowns[1 - k]

    def profile(value):
        def at(y):
            return cost((value, y) if k == 0 else (y, value), measured, unknowns)

        options = {"bounds": (other.lower, other.upper), "method": "bounded"}
        return minimize_scalar(at, **options, options={"xatol": 1e-9}).fun

    top = profile(best[k]) + WIDTH**2
    ends = []
    for bound in (unknowns[k].lower, unknowns[k].upper):
        is_inside = profile(bound) <= top
        ends.append(bound if is_inside else brentq(lambda v: profile(v) - top, best[k], bound))
    return ends


@pytest.mark.parametrize("draw", range(6))
def test_intervals_are_those_of_the_profile(draw):
    random = np.random.default_rng(draw)
    truth = random.uniform((0.0, 0.0), (0.15, 1.0))
    measured = product(truth, None).radiance[0] + SIGMA * random.normal(size=COUNT)
    unknowns = [unknown("a", upper=2.0), unknown("b", start=0.5, upper=3.0)]
    if draw % 2:
        unknowns[0] = unknown("a", upper=2.0, prior=(0.1, 0.2))
    state = solved(measured, unknowns)
    assert state.converged
    errors = np.sqrt(np.diag(state.covariance))
    linear = np.stack([state.x - WIDTH * errors, state.x + WIDTH * errors], axis=1)
    for k in range(2):
        expected = np.array(reference_ends(measured, unknowns, state.x, k))
        is_linear = np.isnan(state.intervals[k, 0])
        ends = linear[k] if is_linear else state.intervals[k]
        tolerance = (0.12 if is_linear else 0.04) * (expected[1] - expected[0])
        np.testing.assert_allclose(ends, expected, atol=tolerance)


def test_linear_intervals_stay():
    """Of a linear prediction within its bounds, of sparse equations, and of many unknowns."""
    unknowns = [unknown("a", prior=(0.5, 0.1)), unknown("b")]
    measured = 5 + DESIGN @ [0.5, 0.5]
    weight = np.full(COUNT, SIGMA**-2.0)
    exact = block([np.full(COUNT, 5.0)], [DESIGN], measured, SIGMA, weight=weight)
    state = solve(unknowns, lambda x: [exact], lambda x: [weight], True, 1)
    assert np.isnan(state.intervals).all()
    assert state.renders <= 2
    # At a bound both depend on it, without a render
    narrow = [unknown("a", upper=0.49), unknown("b")]
    state = solve(narrow, lambda x: [exact], lambda x: [weight], True, 1)
    assert state.at_bound.tolist() == [1, 0] and state.intervals[0, 1] == 0.49
    assert np.isfinite(state.intervals).all() and state.renders <= 2
    thin = replace(exact, columns=[csr_array(DESIGN)])
    prior = Prior.of(narrow)
    quiet = np.zeros(2, dtype=bool)
    ends = profile_intervals([thin], state.x, prior, state.covariance, quiet, None)
    assert np.isnan(ends).all()


def test_a_profile_has_the_errors_of_the_estimate():
    """The rise of the cost is compared with that of one standard error of the estimate."""
    measured = 5 + DESIGN @ [0.5, 0.5]
    weight = np.full(COUNT, SIGMA**-2.0)
    exact = block([np.full(COUNT, 5.0)], [DESIGN], measured, SIGMA, weight=weight)
    x, prior = np.array([0.5, 0.5]), Prior.of([unknown("a"), unknown("b")])
    for factor in (4, 0.25):  # errors twice and half as large
        covariance = factor * np.linalg.inv(DESIGN.T @ DESIGN / SIGMA**2)
        direction = covariance[0] / np.sqrt(covariance[0, 0])
        profile = Profile([exact], x, prior, 0, direction, equations([exact], x))
        assert profile.rise_of_error == pytest.approx(factor, rel=0.01)
        assert profile.errors([exact], x + 1.5 * direction) == pytest.approx(1.5, rel=0.01)
        assert profile.is_straight(1) and profile.is_straight(-1)


def test_noise_of_other_renders_does_not_end_a_profile():
    """It raises the cost by 30, and an interval ends where the cost is 3.84 higher."""
    truth = np.array([0.05, 0.5])
    unknowns = [unknown("a", upper=2.0), unknown("b", start=0.5, upper=3.0)]
    widths = []
    for draw in range(20):
        random = np.random.default_rng(draw)
        measured = product(truth, None).radiance[0] + SIGMA * random.normal(size=COUNT)
        state = solved(measured, unknowns)
        expected = reference_ends(measured, unknowns, state.x, 0)

        def noisy(x, random=random, measured=measured):
            clean = product(x, measured)
            return [replace(clean, radiance=clean.radiance + SIGMA * random.normal(size=COUNT))]

        errors = np.sqrt(state.covariance[0, 0])
        profile = Profile(
            state.blocks,
            state.x,
            Prior.of(unknowns),
            0,
            state.covariance[0] / errors,
            equations(state.blocks, state.x),
        )
        width = profile.end(1, noisy) - state.x[0]
        widths.append(width / (expected[1] - state.x[0]))
    assert widths == pytest.approx(np.ones(20), abs=0.1)


def test_values_that_no_surface_can_have_end_a_profile():
    measured = product((0.05, 0.5), None).radiance[0]
    unknowns = [unknown("a"), unknown("b")]
    state = solved(measured, unknowns)

    def refused(x):
        raise InputError("epsilon + rho_d above G(b)")

    prior = Prior.of(unknowns)
    noise = state.blocks, state.x, prior, state.covariance, np.zeros(2, dtype=bool)
    ends = profile_intervals(*noise, refused)
    assert ends.shape == (2, 2) and not np.isinf(ends).any()


def test_a_valley_between_a_cliff_and_a_slope(monkeypatch):
    """Temperature and reflectance of a wall, whose radiance alone is known.

    The temperature cannot be lower than that of a black wall. Above, only the priors end both
    intervals, and all three ends follow from a search along the valley.
    """
    searched, rendered, at = [], [], Profile.at

    def counted(self, *arguments):
        searched.append(arguments)
        return at(self, *arguments)

    monkeypatch.setattr(Profile, "at", counted)
    measured, sigma = wall((310, 0.3)).radiance[0], 0.01

    def render(x):
        rendered.append(x)
        changes = {"noise": lambda predicted: np.full(len(predicted), sigma)}
        return [wall(x, measured=measured, weight=np.full(VALUES, sigma**-2.0), **changes)]

    both = [kelvin(start=320.0, upper=2000.0), unknown(start=0.5)]
    state = solve(both, render, lambda x: [np.full(VALUES, sigma**-2.0)], False, 20)
    R = np.linspace(0, 0.99, 100_001)
    T = brightness_temperature(LWIR, (measured[0] - R * SKY) / (1 - R))
    rise = ((T - 320) / 100) ** 2 + (R - 0.5) ** 2
    inside = rise <= rise.min() + WIDTH**2
    (low, high), (bound, top) = state.intervals
    assert bound == 0 and low == pytest.approx(T[0], abs=0.02 * (state.x[0] - T[0]))
    assert high == pytest.approx(T[inside].max(), abs=0.01 * (high - low))
    assert top == pytest.approx(R[inside].max(), abs=0.01)
    assert len(searched) <= 40 and len(rendered) - state.trace[-1].renders <= 4

"""Gauss-Newton steps between two renders, smoothness, and learned second derivatives."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.sparse import csr_array

from mi_lcair.errors import InputError
from mi_lcair.knowing.inversion.least_squares import newton
from mi_lcair.knowing.inversion.least_squares.newton import bent, matern, precision
from mi_lcair.knowing.inversion.least_squares.prediction import Weighing
from mi_lcair.knowing.inversion.least_squares.solve import solve
from mi_lcair.physics.blackbody import brightness_temperature
from tests.knowing.inversion.blocks import LWIR, SKY, VALUES, block, kelvin, unknown, wall
from tests.knowing.inversion.least_squares.test_solve import product


@pytest.mark.parametrize("length", [0.3, 2.0])
def test_correlation_has_matern_s_spectrum(length):
    """That of a process of second order: density (3 / l^2 + w^2)^-2."""
    rate = 3 / length**2

    def density(w):
        return (rate + w**2) ** -2

    total = quad(density, 0, np.inf)[0]
    for distance in (0.1, 0.5, 3.0):
        part = quad(density, 0, np.inf, weight="cos", wvar=distance)[0]
        assert matern(np.array(distance), length) == pytest.approx(part / total, abs=1e-6)
    assert matern(np.array(0.0), length) == 1


def facets(name, centres, length=0.5, data=(0,)):
    return [
        kelvin(f"{name}[{k}]", name=name, kind="facet", centre=c, correlation_m=length, data=data)
        for k, c in enumerate(centres)
    ]


def test_precision_is_the_inverse_covariance_of_each_group():
    centres = np.random.default_rng(2).random((5, 3))
    unknowns = [*facets("wing", centres), kelvin(), *facets("tail", centres[:2], data=(1,))]
    sigma = np.arange(1.0, 9.0)
    covariance = np.linalg.inv(precision(unknowns, sigma))
    np.testing.assert_allclose(np.diag(covariance), sigma**2, rtol=1e-9)
    wing = covariance[:5, :5] / np.outer(sigma[:5], sigma[:5])
    distance = np.sqrt(((centres[:, None] - centres) ** 2).sum(axis=-1))
    np.testing.assert_allclose(wing, matern(distance, 0.5), atol=3e-6)
    assert abs(covariance[:6, 6:]).max() < 1e-9 and abs(covariance[5, :5]).max() < 1e-9
    assert covariance[6, 7] / (sigma[6] * sigma[7]) == pytest.approx(wing[0, 1], abs=1e-5)


def test_values_that_do_not_correlate(monkeypatch):
    assert precision([kelvin()], np.ones(1)) is None
    monkeypatch.setattr(newton, "MOST_FACETS", 2)
    assert precision(facets("wing", np.eye(3)[:2]), np.ones(2)).shape == (2, 2)
    with pytest.raises(InputError, match="3 unknowns; at most 2 are possible: use a coarser model"):
        precision(facets("wing", np.eye(3)), np.ones(3))


def test_a_product_of_radiance_and_reflectance_is_known_after_one_step():
    """d2F/dB dR = -1 in B = B(T), and 0 otherwise."""
    learned = bent(wall((300, 0.4)), wall((320, 0.1)))
    expected = np.broadcast_to([[0, -1], [-1, 0]], (2, VALUES, 2, 2))
    np.testing.assert_allclose(learned.curvature, expected, atol=1e-9)
    x = np.array([345.0, 0.8])
    direct, predicted = wall(x), learned.at(x)
    np.testing.assert_allclose(predicted.radiance, direct.radiance, rtol=1e-9)
    np.testing.assert_allclose(predicted.columns, direct.columns, rtol=1e-9)
    assert bent(learned, wall((280, 0.9))).curvature == pytest.approx(learned.curvature, abs=1e-9)


def test_second_derivatives_explain_the_first_ones():
    """Those of any symmetric tensors: exactly after one step along the step, then everywhere."""
    random = np.random.default_rng(4)
    K = random.normal(size=(2, 5, 3, 3))
    K += K.swapaxes(-1, -2)
    F, J = random.normal(size=(2, 5)), random.normal(size=(2, 5, 3))

    def at(x):
        radiance = F + J @ x + (K @ x) @ x / 2
        return block(radiance, J + K @ x, np.zeros(5), reference=np.array(x))

    place, learned = np.zeros(3), at(np.zeros(3))
    for _ in range(25):
        x = random.normal(size=3)
        learned = bent(learned, at(x))
        tensor = learned.curvature
        np.testing.assert_allclose(tensor, tensor.swapaxes(-1, -2), atol=1e-12)
        np.testing.assert_allclose(learned.at(x).columns, at(x).columns, atol=1e-9)
        np.testing.assert_allclose(learned.at(place).columns, list(J), atol=1e-12)
    np.testing.assert_allclose(tensor, K, rtol=1e-3, atol=1e-3)


def test_blocks_without_second_derivatives(monkeypatch):
    here, there = wall((300, 0.4)), wall((320, 0.4))
    assert bent(here, there) is here  # linear in the blackbody radiance alone
    thin = replace(here, columns=[csr_array(J) for J in here.columns])
    assert bent(thin, wall((300, 0.1))) is thin
    monkeypatch.setattr(newton, "LARGEST", 2 * VALUES * 4 - 1)
    assert bent(here, wall((300, 0.1))) is here


@pytest.mark.parametrize("start", [(280, 0.05), (300, 0.9), (360, 0.5), (330, 0.0), (295, 1.0)])
def test_a_curved_valley_is_followed(start):
    """Temperature and reflectance of one wall, in sixteen equal values without a solution apart.

    The solution is the point of the valley that is nearest the first guess.
    """
    sigma, random = 0.01, np.random.default_rng(5)
    measured = wall((310, 0.3)).radiance[0] + sigma * random.normal(size=VALUES)

    def render(x):
        changes = {"noise": lambda predicted: np.full(len(predicted), sigma)}
        return [wall(x, measured=measured, weight=np.full(VALUES, sigma**-2.0), **changes)]

    both = [kelvin(start=start[0], upper=2000.0), unknown(start=start[1])]
    state = solve(both, render, lambda x: [Weighing(np.full(VALUES, sigma**-2.0))], False, 20)
    assert state.converged and state.trace[-1].renders <= 12
    # The nearest point by a search along the valley
    R = np.linspace(0, 0.95, 20_001)
    T = brightness_temperature(LWIR, (measured.mean() - R * SKY) / (1 - R))
    nearest = np.argmin(((T - start[0]) / 100) ** 2 + (R - start[1]) ** 2)
    assert state.x[1] == pytest.approx(R[nearest], abs=0.02)
    assert state.x[0] == pytest.approx(T[nearest], abs=2)


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

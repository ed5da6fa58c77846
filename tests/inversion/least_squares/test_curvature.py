"""Second derivatives that are learned from renders, and curved valleys."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse import csr_array

from mi_lcair.inversion.least_squares import curvature
from mi_lcair.inversion.least_squares.curvature import bent
from mi_lcair.inversion.least_squares.solve import solve
from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import brightness_temperature, in_band_radiance, in_band_slope
from tests.inversion.blocks import block, kelvin, unknown

LWIR = band("LWIR")
SKY = in_band_radiance(LWIR, 290.0)
VALUES = 16


def wall(x, R=2, measured=None, **changes):
    """The radiance (1 - R) B(T) + R B(290 K) of a wall at x = (T, R), alike in all values."""
    T, rho = x
    B = in_band_radiance(LWIR, T)
    radiance = np.full((R, VALUES), (1 - rho) * B + rho * SKY)
    columns = np.tile([(1 - rho) * in_band_slope(LWIR, T), SKY - B], (R, VALUES, 1))
    options = {"reference": np.array(x), "band": LWIR, "is_temperature": np.array([True, False])}
    measured = np.zeros(VALUES) if measured is None else measured
    return block(radiance, columns, measured, **options | changes)


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
    monkeypatch.setattr(curvature, "LARGEST", 2 * VALUES * 4 - 1)
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
    state = solve(both, render, lambda x: [np.full(VALUES, sigma**-2.0)], False, 20)
    assert state.converged and state.trace[-1].renders <= 12
    # The nearest point by a search along the valley
    R = np.linspace(0, 0.95, 20_001)
    T = brightness_temperature(LWIR, (measured.mean() - R * SKY) / (1 - R))
    nearest = np.argmin(((T - start[0]) / 100) ** 2 + (R - start[1]) ** 2)
    assert state.x[1] == pytest.approx(R[nearest], abs=0.02)
    assert state.x[0] == pytest.approx(T[nearest], abs=2)

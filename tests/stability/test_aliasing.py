"""A quadrature that looks converged and is wrong: N x N nodes, uniform in theta and phi, over bare
aluminium's lobe.

The lobe is 2 e = 0.5 degrees wide and the nodes lie 90 / N and 360 / N degrees apart; one of them
happens to stand near its top, at N and again at 2 N, since the nodes of the one are among those of
the other.
"""

import numpy as np
import pytest
from drjit.llvm.ad import Float64

from mi_lcair.physics.reflection import sandford_robertson_equations as sr
from mi_lcair.physics.reflection import sandford_robertson_hemispherical as hemispherical
from tests.physics.reflection.surfaces import MATERIALS, direction, surface

ALUMINIUM = surface(*MATERIALS[0])  # MWIR, Float64


def uniform_DHR(theta_i_deg, count, shift):
    """DHR (Eq 2.8) by count x count nodes; shift: 0.5 midpoints, 0 left ends."""
    theta, phi = (
        (np.arange(count) + shift) * np.pi / 2 / count,
        (np.arange(count) + shift) * 2 * np.pi / count,
    )
    theta, phi = (grid.ravel() for grid in np.meshgrid(theta, phi))
    f = sr.f(ALUMINIUM, direction(np.radians(theta_i_deg)), direction(theta, np.pi + phi)).numpy()
    return np.sum(f * np.cos(theta) * np.sin(theta)) * (np.pi / 2 / count) * (2 * np.pi / count)


@pytest.mark.parametrize(
    "theta_i_deg, count, agreement, ratio",
    [(30, 52, 0.01, 1.82), (45, 79, 0.01, 2.54), (60, 50, 0.02, 5.3)],
)
def test_agreement_between_N_and_2N_proves_nothing(theta_i_deg, count, agreement, ratio):
    exact = hemispherical.DHR(ALUMINIUM, Float64(np.radians(theta_i_deg)))[0]
    coarse, fine = uniform_DHR(theta_i_deg, count, 0), uniform_DHR(theta_i_deg, 2 * count, 0)
    assert abs(fine / coarse - 1) <= agreement
    assert coarse / exact == pytest.approx(ratio, rel=0.02) and fine / exact == pytest.approx(
        ratio, rel=0.02
    )


def test_midpoints_miss_the_lobe():
    """At 60 degrees: 3 % of the reflectance at 20 x 20, which is the diffuse floor, and still half
    at 400 x 400.
    """
    exact = hemispherical.DHR(ALUMINIUM, Float64(np.radians(60)))[0]
    assert uniform_DHR(60, 20, 0.5) / exact == pytest.approx(0.025, abs=0.002)
    assert uniform_DHR(60, 400, 0.5) / exact == pytest.approx(0.52, abs=0.01)


def test_a_node_on_the_lobe():
    """A node on its very top (90 / 30 divides 60): 84 times too much at 30 x 30, still 10 times at
    90 x 90.
    """
    exact = hemispherical.DHR(ALUMINIUM, Float64(np.radians(60)))[0]
    assert uniform_DHR(60, 30, 0) / exact == pytest.approx(83.9, rel=0.01)
    assert uniform_DHR(60, 90, 0) / exact == pytest.approx(10.07, rel=0.01)


def test_what_resolves_it():
    """Where nodes are dense enough both rules agree with the quadrature of hemispherical.py."""
    exact = hemispherical.DHR(ALUMINIUM, Float64(np.radians(30)))[0]
    assert [uniform_DHR(30, 1000, shift) / exact for shift in (0, 0.5)] == pytest.approx(
        [1, 1], abs=1e-4
    )

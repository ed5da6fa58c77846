"""A quadrature that appears converged but is wrong.

It has N x N nodes, uniform in theta and phi, over the lobe of bare aluminium. The lobe is
2 e = 0.5 degrees wide and the nodes are 90 / N and 360 / N degrees apart. One node is close to the
peak by chance. It is so for 2 N as well, because the nodes for 2 N include those for N.
"""

import numpy as np
import pytest
from drjit.llvm.ad import Float64

from mi_lcair.physics.reflection import sandford_robertson_equations
from mi_lcair.physics.reflection import sandford_robertson_equations as sr
from tests.physics.reflection.surfaces import MATERIALS, direction, surface

ALUMINIUM = surface(*MATERIALS[0])  # MWIR, Float64


def uniform_DHR(theta_i_deg, count, shift):
    """Return the DHR (Eq 2.8) from count x count nodes.

    shift: 0.5 for midpoints, 0 for left ends.
    """
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
    exact = sandford_robertson_equations.DHR(ALUMINIUM, Float64(np.radians(theta_i_deg)))[0]
    coarse, fine = uniform_DHR(theta_i_deg, count, 0), uniform_DHR(theta_i_deg, 2 * count, 0)
    assert abs(fine / coarse - 1) <= agreement
    assert coarse / exact == pytest.approx(ratio, rel=0.02) and fine / exact == pytest.approx(
        ratio, rel=0.02
    )


def test_midpoints_miss_the_lobe():
    """At 60 degrees 20 x 20 midpoints give 3 % of the reflectance, which is the diffuse floor.

    400 x 400 midpoints give half of it.
    """
    exact = sandford_robertson_equations.DHR(ALUMINIUM, Float64(np.radians(60)))[0]
    assert uniform_DHR(60, 20, 0.5) / exact == pytest.approx(0.025, abs=0.002)
    assert uniform_DHR(60, 400, 0.5) / exact == pytest.approx(0.52, abs=0.01)


def test_a_node_on_the_lobe():
    """A node at the peak gives 84 times the reflectance with 30 x 30 nodes.

    With 90 x 90 nodes it still gives 10 times the reflectance. At 60 degrees one node is at the
    peak, because 60 is a multiple of 90 / 30.
    """
    exact = sandford_robertson_equations.DHR(ALUMINIUM, Float64(np.radians(60)))[0]
    assert uniform_DHR(60, 30, 0) / exact == pytest.approx(83.9, rel=0.01)
    assert uniform_DHR(60, 90, 0) / exact == pytest.approx(10.07, rel=0.01)


def test_what_resolves_it():
    """With enough nodes both rules agree with the project's own quadrature."""
    exact = sandford_robertson_equations.DHR(ALUMINIUM, Float64(np.radians(30)))[0]
    assert [uniform_DHR(30, 1000, shift) / exact for shift in (0, 0.5)] == pytest.approx(
        [1, 1], abs=1e-4
    )

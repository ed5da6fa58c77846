"""Tables with even steps: looked up by straight lines, refined by cubics."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from drjit.llvm.ad import Float64

from mi_lcair.plugins.bsdfs.reflection_bsdf import interpolate, refine


def test_straight_lines():
    table = mi.Float(1, 3, -1)
    np.testing.assert_allclose(
        interpolate(table, mi.Float(0, 0.25, 0.5, 0.9, 1)), [1, 2, 3, -0.2, -1], rtol=1e-6
    )


@pytest.mark.parametrize("nodes, factor", [(4, 3), (9, 4), (33, 1)])
def test_a_cubic_is_refined_exactly(nodes, factor):
    """At the ends too, where no node lies beyond."""
    cubic = lambda x: 2 - x + 3 * x**2 - 4 * x**3
    refined = refine(Float64(cubic(np.linspace(0, 1, nodes))), factor)
    fine = np.linspace(0, 1, (nodes - 1) * factor + 1)
    np.testing.assert_allclose(refined, cubic(fine), rtol=0, atol=1e-14)


def test_the_error_falls_with_the_fourth_power_of_the_step():
    def error(nodes):
        refined = refine(Float64(np.sin(5 * np.linspace(0, 1, nodes))), 4)
        return np.abs(refined.numpy() - np.sin(5 * np.linspace(0, 1, 4 * nodes - 3))).max()

    assert error(65) == pytest.approx(error(33) / 16, rel=0.15)


def test_refining_keeps_derivatives():
    """The weights of each step sum to 1, so that a shift of the table shifts all steps alike."""
    shift = Float64(0.5)
    dr.enable_grad(shift)
    refined = refine(dr.linspace(Float64, 0, 1, 6) + shift, 4)
    dr.forward(shift)
    np.testing.assert_allclose(dr.grad(refined), np.ones(21), rtol=1e-14)

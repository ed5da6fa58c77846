"""Method of Gouffé: the worked example of thesis appendix B, and the sphere."""

import numpy as np
import pytest

from mi_lcair.cavities.gouffe import cavity_emissivity, gouffe, shape_term


def test_worked_example():
    """Thesis, appendix B.2, to all printed digits.

    It rounds s/S to .0157 for the cavity's emissivity, but not for the correction.
    """
    s, S, rounded = 0.0487, 3.106, 0.0157
    cavity, k = cavity_emissivity(0.5, rounded, 1.0), shape_term(0.5, s, S, np.pi)
    assert f"{s / S:.4f}" == f"{rounded:.4f}"
    assert f"{cavity:.4f}" == "0.9845"
    assert f"{k:.2e}" == "8.88e-05"
    assert f"{cavity * (1 + k):.4f}" == "0.9846"
    assert f"{gouffe(0.5, s, S, np.pi):.4f}" == "0.9847"  # without rounding


@pytest.mark.parametrize("seed", range(5))
def test_sphere_has_no_correction(seed):
    """For S = S0 the method is exact: the series of a sphere's reflections."""
    epsilon, f = np.random.default_rng(seed).uniform(0.1, 0.9, 2)
    series = epsilon * np.sum(((1 - epsilon) * (1 - f)) ** np.arange(2000))
    assert gouffe(epsilon, f, 1.0, 1.0) == pytest.approx(series, rel=1e-12)

"""Radiance of a facet against samples of its hemisphere."""

import numpy as np
import pytest
from scipy.integrate import dblquad

from benchmarks.facet_radiance import facet_radiance
from mi_lcair.errors import InputError


@pytest.mark.slow
def test_two_plates():
    """The middle of the diffuse plate against the integral of Eq A.1 over the blackbody."""
    result = facet_radiance([10, 400, 1300], scene="two_plates", facet=0, band="total")

    def integrand(y, z):
        # From the point (0.1, 0, 0) to the place (0, y, z) of the plate x = 0
        d2 = 0.1**2 + y**2 + z**2
        return z * 0.1 / d2**2

    factor = dblquad(integrand, 0, 0.2, -0.05, 0.05)[0] / np.pi
    exact = 5.670374419e-8 * 800**4 / np.pi * factor
    # The edges of the blackbody cross cells, so that the error falls as their width only
    assert result.reference == pytest.approx(exact, rel=5e-3)
    assert result.stratified[-1] == pytest.approx(exact, rel=5e-3)
    errors = abs(result.even / exact - 1)
    assert errors[-1] < 2e-3 < errors[0]


def test_hidden_facet():
    with pytest.raises(InputError, match="does not see the middle of facet 1"):
        facet_radiance([4], scene="two_plates", facet=1)

"""The distribution of facets, against mpmath and quadratures."""

import drjit as dr
import mpmath
import numpy as np
import pytest
from drjit.llvm.ad import Float64
from scipy.integrate import quad

from mi_lcair.physics.reflection import microfacet_distribution as distribution

LOBES = [(1e-3, 0.5), (0.05, 1.0), (0.05, 1.7), (0.3, 2.0), (0.3, 1 - 1e-9), (0.9, 4.0)]


def test_bernoulli():
    x = [-30.0, -1.0, -0.1001, -0.0999, -0.03, -1e-9, 0.0, 1e-9, 0.03, 0.0999, 0.1001, 1.0, 30.0]
    with mpmath.workdps(40):
        exact = [1.0 if v == 0 else float(v / (1 - mpmath.exp(-mpmath.mpf(v)))) for v in x]
    np.testing.assert_allclose(distribution.bernoulli(Float64(x)), exact, rtol=2e-15)


def D(sin2, alpha, gamma):
    """Not normalised: 1 / (alpha^2 cos^2 + sin^2)^gamma"""
    return (alpha**2 * (1 - sin2) + sin2) ** -gamma


def share_within(sin2, alpha, gamma, weight=lambda x: 1):
    """int_0^sin2 weight(x) D dx, which is that of D cos domega; x = sin^2 of a facet's angle."""
    knots = [x for x in alpha**2 * np.array([1, 10, 100, 1000]) if x < sin2]
    edges = [0, *knots, sin2]
    return sum(
        quad(lambda x: weight(x) * D(x, alpha, gamma), a, b, epsrel=1e-11)[0]
        for a, b in zip(edges, edges[1:])
    )


@pytest.mark.parametrize("alpha, gamma", LOBES)
def test_normalised_density(alpha, gamma):
    peak = distribution.peak(Float64(alpha), Float64(gamma))
    spread = distribution.spread(Float64(alpha))
    for sin2 in (0.0, alpha**2, 0.5, 1.0):
        expected = D(sin2, alpha, gamma) / (np.pi * share_within(1, alpha, gamma))
        value = distribution.density(Float64(sin2), peak, spread, Float64(gamma))
        assert value[0] == pytest.approx(expected, rel=1e-8)


@pytest.mark.parametrize("alpha, gamma", LOBES)
def test_mean_squared_sine(alpha, gamma):
    expected = share_within(1, alpha, gamma, lambda x: x) / share_within(1, alpha, gamma)
    mean = distribution.mean_sin2(Float64(alpha), Float64(gamma))[0]
    assert mean == pytest.approx(expected, rel=1e-8)


def test_facets_in_all_directions_have_a_mean_squared_sine_of_a_half():
    for alpha in (1.0, 1 - 1e-9):
        assert distribution.mean_sin2(Float64(alpha), Float64(2.0))[0] == 0.5


@pytest.mark.parametrize("alpha, gamma", LOBES)
def test_a_uniform_number_is_the_share_of_facets_within_the_angle(alpha, gamma):
    spread = distribution.spread(Float64(alpha))
    terms = distribution.quantile_terms(Float64(gamma), spread)
    u = np.array([1e-6, 0.1, 0.5, 0.9, 0.999])
    whole = share_within(1, alpha, gamma)
    for number, sin2 in zip(u, distribution.sample_sin2(Float64(u), spread, *terms).numpy()):
        assert share_within(sin2, alpha, gamma) / whole == pytest.approx(number, rel=2e-5)
    ends = distribution.sample_sin2(Float64(0, 1), spread, *terms).numpy()
    assert ends[0] == 0 and ends[1] == pytest.approx(1, rel=1e-6)


def test_width_is_where_the_distribution_has_fallen_to_a_quarter():
    for alpha, gamma in ((0.001, 1.0), (0.1, 2.0), (0.3, 3.5)):
        spread = distribution.spread(Float64(alpha))
        tan2 = distribution.width(Float64(gamma), spread)[0] ** 2
        sin2 = tan2 / (1 + tan2)
        assert D(sin2, alpha, gamma) == pytest.approx(0.25 * D(0, alpha, gamma), rel=1e-10)


def test_the_width_is_at_most_1():
    for alpha, gamma in ((1.0, 2.0), (0.3, 0.5), (0.9, 1.0)):
        assert distribution.width(Float64(gamma), distribution.spread(Float64(alpha)))[0] == 1
    # For gamma = 2, sin^2 = alpha^2 / (1 - alpha^2) is 0.4998 at alpha = 0.5773
    widths = distribution.width(Float64(2), distribution.spread(Float64(0.57, 0.58)))
    assert widths[0] < 0.98 and widths[1] == 1
    assert dr.all(widths > 0)

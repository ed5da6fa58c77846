"""HDR of the microfacet model against independent quadrature, closed forms and bounds."""

import dataclasses

import drjit as dr
import mpmath
import numpy as np
import pytest
from drjit.llvm.ad import Float, Float64
from scipy.integrate import dblquad, quad

from mi_lcair.physics.reflection import microfacet_equations
from mi_lcair.physics.reflection.microfacet import MODEL, facet_reflectance
from tests.matrix import some_of
from tests.physics.reflection import microfacet_equations as printed
from tests.physics.reflection.test_microfacet import random_parameters, surface

ANGLES = np.radians([0, 0.5, 17.9, 30, 44.9, 45.1, 60, 80, 88, 89.5, 89.99])


@pytest.mark.slow
@pytest.mark.parametrize(
    "parameters, theta_deg",
    [
        ((0.4, 1.64, 1.44, 0.21, 0.1), 30),
        ((0.3, 0.68, 2.1, 1.3, 0.64), 60),
        pytest.param((0.2, 2.5, 11, 0, 0.0), 75, marks=pytest.mark.study),
        ((0.9, 4, 50, 100, 1.0), 85),
    ],
)
def test_independent_quadrature(parameters, theta_deg):
    """HDR agrees with scipy's adaptive quadrature of the printed BRDF, whose error is 1e-7."""
    theta = np.radians(theta_deg)
    r = (np.sin(theta), 0.0, np.cos(theta))

    def integrand(phi, theta_i):
        sin, cos = np.sin(theta_i), np.cos(theta_i)
        i = (sin * np.cos(phi), sin * np.sin(phi), cos)
        return 2 * printed.brdf(np, i, r, *parameters).real * cos * sin

    exact = sum(
        dblquad(integrand, *ends, 0, np.pi, epsabs=1e-7, epsrel=1e-7)[0]
        for ends in ((0, theta), (theta, np.pi / 2))
    )
    assert MODEL.HDR(surface(*parameters), Float64(theta))[0] == pytest.approx(exact, abs=1e-6)


@pytest.mark.parametrize("n, k", [(1, 0), (1.0001, 0), (1.5, 0), (3, 30), (50, 0), (50, 100)])
def test_mean_transmittance(n, k):
    T = lambda c: 2 * c * (1 - printed.fresnel(np, c, n, k)) if (n, k) != (1, 0) else 2 * c
    exact = quad(T, 0, 1, points=[1e-3, 0.01, 0.1], epsabs=1e-12, limit=500)[0]
    S = surface(0.1, 2, n, k, 0)
    assert S.refracted[0] == pytest.approx(exact, abs=1e-9)


def test_limits():
    """F = 0 gives a perfect diffuse reflector or a blackbody; the narrowest lobe is a mirror."""
    HDR = lambda *parameters: MODEL.HDR(surface(*parameters), Float64(ANGLES)).numpy()
    np.testing.assert_allclose(HDR(0.3, 2, 1, 0, 1), 1, rtol=1e-12)
    np.testing.assert_allclose(HDR(0.3, 2, 1, 0, 0), 0, atol=1e-15)
    mirror = [printed.fresnel(np, np.cos(theta), 1.5, 0.3) for theta in ANGLES[:8]]
    np.testing.assert_allclose(HDR(1e-4, 4, 1.5, 0.3, 0)[:8], mirror, atol=1e-6)


def test_dhr_is_hdr():
    S = surface(0.19, 1.64, 1.44, 0.21, 0.3)
    np.testing.assert_array_equal(MODEL.DHR(S, Float64(ANGLES)), MODEL.HDR(S, Float64(ANGLES)))


@pytest.mark.slow
def test_more_nodes_change_nothing(monkeypatch):
    """2.5 times as many nodes change HDR by at most 1e-8, for all parameters."""
    surfaces = [surface(*parameters) for parameters in random_parameters(30, seed=4)]
    computed = [MODEL.HDR(S, Float64(ANGLES)).numpy() for S in surfaces]
    monkeypatch.setattr(microfacet_equations, "POLAR", (100, 40, 40, 100, 50, 50))
    monkeypatch.setattr(microfacet_equations, "AZIMUTHS", (30, 20, 50))
    for S, HDR in zip(surfaces, computed):
        np.testing.assert_allclose(MODEL.HDR(S, Float64(ANGLES)), HDR, rtol=0, atol=1e-8)


@pytest.mark.slow
def test_no_more_is_reflected_than_arrives():
    """HDR is at most 1 for 100 surfaces with a white floor at 28 angles up to 90 degrees.

    1e-9 is the error of the quadrature.
    """
    theta = Float64(np.radians([*np.linspace(0, 87.5, 22), 88, 89, 89.5, 89.9, 89.99, 90]))
    for parameters in random_parameters(100, seed=5):
        HDR = MODEL.HDR(surface(*parameters[:4], 1), theta).numpy()
        assert HDR.min() >= 0 and HDR.max() <= 1 + 1e-9, parameters


@pytest.mark.slow
def test_parts_are_the_whole():
    """HDR is the lobe times its scale plus the floor, also for many surfaces at once."""
    parameters = random_parameters(20, seed=6)
    cos, sin2 = Float64(np.cos(ANGLES)), Float64(np.sin(ANGLES) ** 2)
    for row in parameters:
        S = surface(*row)
        parts = MODEL.lobe_scale(S, cos, sin2) * MODEL.lobe_HDR(S, Float64(ANGLES))
        parts += MODEL.floor_HDR(S, cos, sin2)
        np.testing.assert_allclose(parts, MODEL.HDR(S, Float64(ANGLES)), rtol=1e-12, atol=1e-17)
    many = MODEL.surface(*(Float64(column) for column in parameters.T)).repeat(len(ANGLES))
    together = MODEL.HDR(many, Float64(np.tile(ANGLES, 20))).numpy().reshape(20, -1)
    alone = [MODEL.HDR(surface(*row), Float64(ANGLES)).numpy() for row in parameters]
    np.testing.assert_allclose(together, alone, rtol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("alpha", [1e-4, 0.01, 0.1])
@pytest.mark.parametrize("gamma", some_of([0.5, 1.2, 4, 2], 2))
@pytest.mark.parametrize("n, k", [(1.001, 0), (50, 0), (50, 100)])
def test_a_table_holds_1e_5(alpha, gamma, n, k):
    """A Float32 table at 1024 even values of sqrt(cos) interpolates HDR up to 89.5 degrees."""
    S, nodes = surface(alpha, gamma, n, k, 0), np.linspace(0, 1, 1024)
    table = MODEL.lobe_HDR(S, Float64(np.arccos(nodes**2))).numpy().astype(np.float32)
    assert np.all(np.isfinite(table))
    places = np.linspace(np.sqrt(np.cos(np.radians(89.5))), 1, 601)
    cos = Float64(places**2)
    scale = MODEL.lobe_scale(S, cos, 1 - dr.square(cos)).numpy()
    exact = microfacet_equations.lobe_reflectance(S, dr.acos(cos), facet_reflectance).numpy()
    assert np.abs(np.interp(places, nodes, table) * scale - exact).max() < 1e-5


@pytest.mark.slow
@pytest.mark.parametrize("held", range(5), ids=MODEL.names)
def test_derivatives_agree_with_central_differences(held):
    theta = Float64(np.radians([0, 30, 60, 80, 88, 89.5]))
    for parameters in (
        (0.19, 1.64, 1.44, 0.21, 0.1),
        (0.01, 0.9, 10, 20, 0.3),
        (0.5, 3, 1.2, 1, 0.9),
    ):
        numbers = [dr.opaque(Float64, value) for value in parameters]
        dr.enable_grad(numbers[held])
        value = MODEL.HDR(MODEL.surface(*numbers), theta)
        dr.set_grad(numbers[held], 1)
        dr.forward_to(value)
        computed = dr.grad(value).numpy()
        step = 1e-4 * parameters[held]
        at = lambda x: MODEL.HDR(
            surface(*parameters[:held], x, *parameters[held + 1 :]), theta
        ).numpy()
        expected = (at(parameters[held] + step) - at(parameters[held] - step)) / (2 * step)
        np.testing.assert_allclose(
            computed, expected, rtol=1e-5, atol=1e-6 * np.abs(expected).max()
        )


@pytest.mark.slow
@pytest.mark.parametrize(
    "alpha, gamma, lost",
    [(0.01, 1, 0.11), (0.1, 2, 0.06), (0.5, 2, 0.30), (0.3, 4, 0.07), (1, 1, 0.62)],
)
def test_losses_are_those_of_the_docstring(alpha, gamma, lost):
    theta = Float64(np.radians([*range(90), 89.5]))
    S = surface(alpha, gamma, 1.5, 0, 0)
    HDR = microfacet_equations.lobe_reflectance(S, theta, lambda S, p: Float64(1)).numpy()
    assert 1 - HDR.min() == pytest.approx(lost, abs=0.0051)


def test_surfaces_keep_their_digits():
    """`cast` converts every field to Float32 without loss of accuracy."""
    S = surface(1e-4, 4, 50, 100, 1).cast(Float)
    for field in dataclasses.fields(S):
        assert np.isfinite(getattr(S, field.name)[0]), field.name


# The distribution of facets, against mpmath and quadratures
# ----------------------------------------------------------

LOBES = [(1e-3, 0.5), (0.05, 1.0), (0.05, 1.7), (0.3, 2.0), (0.3, 1 - 1e-9), (0.9, 4.0)]


def test_bernoulli():
    x = [-30.0, -1.0, -0.1001, -0.0999, -0.03, -1e-9, 0.0, 1e-9, 0.03, 0.0999, 0.1001, 1.0, 30.0]
    with mpmath.workdps(40):
        exact = [1.0 if v == 0 else float(v / (1 - mpmath.exp(-mpmath.mpf(v)))) for v in x]
    np.testing.assert_allclose(microfacet_equations.bernoulli(Float64(x)), exact, rtol=2e-15)


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
    peak = microfacet_equations.peak(Float64(alpha), Float64(gamma))
    spread = microfacet_equations.spread(Float64(alpha))
    for sin2 in (0.0, alpha**2, 0.5, 1.0):
        expected = D(sin2, alpha, gamma) / (np.pi * share_within(1, alpha, gamma))
        value = microfacet_equations.density(Float64(sin2), peak, spread, Float64(gamma))
        assert value[0] == pytest.approx(expected, rel=1e-8)


@pytest.mark.parametrize("alpha, gamma", LOBES)
def test_mean_squared_sine(alpha, gamma):
    expected = share_within(1, alpha, gamma, lambda x: x) / share_within(1, alpha, gamma)
    mean = microfacet_equations.mean_sin2(Float64(alpha), Float64(gamma))[0]
    assert mean == pytest.approx(expected, rel=1e-8)


def test_facets_in_all_directions_have_a_mean_squared_sine_of_a_half():
    for alpha in (1.0, 1 - 1e-9):
        assert microfacet_equations.mean_sin2(Float64(alpha), Float64(2.0))[0] == 0.5


@pytest.mark.parametrize("alpha, gamma", LOBES)
def test_a_uniform_number_is_the_share_of_facets_within_the_angle(alpha, gamma):
    spread = microfacet_equations.spread(Float64(alpha))
    terms = microfacet_equations.quantile_terms(Float64(gamma), spread)
    u = np.array([1e-6, 0.1, 0.5, 0.9, 0.999])
    whole = share_within(1, alpha, gamma)
    for number, sin2 in zip(
        u, microfacet_equations.sample_sin2(Float64(u), spread, *terms).numpy()
    ):
        assert share_within(sin2, alpha, gamma) / whole == pytest.approx(number, rel=2e-5)
    ends = microfacet_equations.sample_sin2(Float64(0, 1), spread, *terms).numpy()
    assert ends[0] == 0 and ends[1] == pytest.approx(1, rel=1e-6)


def test_width_is_where_the_distribution_has_fallen_to_a_quarter():
    for alpha, gamma in ((0.001, 1.0), (0.1, 2.0), (0.3, 3.5)):
        spread = microfacet_equations.spread(Float64(alpha))
        tan2 = microfacet_equations.width(Float64(gamma), spread)[0] ** 2
        sin2 = tan2 / (1 + tan2)
        assert D(sin2, alpha, gamma) == pytest.approx(0.25 * D(0, alpha, gamma), rel=1e-10)


def test_the_width_is_at_most_1():
    for alpha, gamma in ((1.0, 2.0), (0.3, 0.5), (0.9, 1.0)):
        assert (
            microfacet_equations.width(Float64(gamma), microfacet_equations.spread(Float64(alpha)))[
                0
            ]
            == 1
        )
    # For gamma = 2, sin^2 = alpha^2 / (1 - alpha^2) is 0.4998 at alpha = 0.5773
    widths = microfacet_equations.width(
        Float64(2), microfacet_equations.spread(Float64(0.57, 0.58))
    )
    assert widths[0] < 0.98 and widths[1] == 1
    assert dr.all(widths > 0)

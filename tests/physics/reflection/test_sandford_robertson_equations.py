"""HDR and DHR against a reference table, quadrature of the printed BRDF, and closed forms."""

import json
from pathlib import Path

import drjit as dr
import numpy as np
import pytest
from drjit.llvm.ad import Float64

from mi_lcair.physics.reflection import sandford_robertson_equations
from mi_lcair.physics.reflection import sandford_robertson_equations as sr
from tests.physics import thesis
from tests.physics.reflection.surfaces import MATERIALS, random_parameters, surface

REFERENCE = json.loads(
    (Path(__file__).parents[2] / "data" / "hemispherical_reflectance.json").read_text()
)
BOTH = [sandford_robertson_equations.HDR, sandford_robertson_equations.DHR]


@pytest.mark.parametrize("key", REFERENCE)
def test_reference_table(key):
    entry = REFERENCE[key]
    theta_deg, HDR, DHR = np.array(entry["rows"]).T
    S = surface(**entry["parameters"], form=key.split("/")[-1])
    theta = Float64(np.radians(theta_deg))
    np.testing.assert_allclose(sandford_robertson_equations.HDR(S, theta), HDR, rtol=0, atol=1e-5)
    np.testing.assert_allclose(sandford_robertson_equations.DHR(S, theta), DHR, rtol=0, atol=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("form", sr.FORMS)
@pytest.mark.parametrize("e", [1, 0.6, 0.2, 0.05])
def test_two_dimensional_quadrature(e, form):
    """HDR and DHR agree with a quadrature of the printed equations.

    For these broad lobes the printed equations have an error of 1e-8 in Float64.
    """
    for epsilon, rho_d, b in ((0.4, 0.05, 0.1), (0.1, 0.3, 0.95)):
        S = surface(epsilon, rho_d, b, e, form)
        for fixed in np.radians([0, 30, 75, 88]):
            theta, phi, weight = thesis.hemisphere(fixed, 2 * e, nodes=64)
            f = lambda i, r: thesis.brdf(np, i, r, np.pi - phi, epsilon, rho_d, b, e, form)
            HDR, DHR = (
                np.sum(f(i, r) * np.cos(theta) * weight)
                for i, r in ((theta, fixed), (fixed, theta))
            )
            assert sandford_robertson_equations.HDR(S, dr.opaque(Float64, fixed))[
                0
            ] == pytest.approx(HDR, abs=1e-8)
            assert sandford_robertson_equations.DHR(S, dr.opaque(Float64, fixed))[
                0
            ] == pytest.approx(DHR, abs=1e-8)


def test_normalized_form_reflects_what_is_not_absorbed():
    """DHR = 1 - epsilon g / G exactly, for all parameters and up to 89.9 degrees."""
    theta = Float64(np.radians([0, 1, 30, 60, 80, 85, 88, 89, 89.5, 89.9]))
    sin, cos = dr.sincos(theta)
    for parameters in random_parameters(60):
        S = surface(*parameters, "normalized")
        np.testing.assert_allclose(
            sandford_robertson_equations.DHR(S, theta),
            1 - sr.emissivity(S, cos, dr.square(sin)),
            rtol=0,
            atol=1e-10,
        )


@pytest.mark.parametrize("quantity", BOTH)
def test_limits(quantity):
    """b = 0 gives a perfect diffuse reflector or a blackbody.

    With b = 1 the floor is proportional to cos^2 theta, and the lobe depends on epsilon + rho_d
    only.
    """
    theta = np.radians([0, 30, 60, 85, 89.9])
    HDR = lambda *parameters: quantity(surface(*parameters), Float64(theta)).numpy()
    np.testing.assert_allclose(HDR(0, 1, 0, 0.01), 1, rtol=1e-12)
    np.testing.assert_allclose(HDR(1, 0, 0, 0.01), 0, atol=1e-12)
    np.testing.assert_allclose(
        HDR(0, 0.5, 1, 0.01) - HDR(0.5, 0, 1, 0.01), np.cos(theta) ** 2, rtol=1e-9
    )


@pytest.mark.slow
@pytest.mark.parametrize("quantity", BOTH)
@pytest.mark.parametrize("form", sr.FORMS)
def test_more_nodes_change_nothing(monkeypatch, quantity, form):
    """The quadrature has converged to 1e-8.

    This holds for the narrowest lobes and the sharpest knees at the horizon.
    """
    theta = Float64(np.radians([0, 1, 30, 60, 80, 85, 88, 89, 89.5]))
    for parameters in random_parameters(12, seed=3):
        S = surface(*parameters, form)
        computed = quantity(S, theta).numpy()
        with monkeypatch.context() as patch:
            patch.setattr(sandford_robertson_equations, "NODES", 96)
            np.testing.assert_allclose(quantity(S, theta).numpy(), computed, rtol=0, atol=1e-8)


@pytest.mark.slow
@pytest.mark.parametrize("quantity", BOTH)
@pytest.mark.parametrize("form", sr.FORMS)
@pytest.mark.parametrize("parameters", [MATERIALS[0], MATERIALS[2], (0.2, 0.1, 0.5, 0.3)])
def test_derivatives_agree_with_central_differences(quantity, form, parameters):
    theta = Float64(np.radians([0, 30, 60, 80, 88, 89.5]))
    for k in range(4):
        numbers = [dr.opaque(Float64, number) for number in parameters]
        dr.enable_grad(numbers[k])
        value = quantity(sr.surface(*numbers, form=form), theta)
        dr.set_grad(numbers[k], 1)
        dr.forward_to(value)
        computed = dr.grad(value).numpy()
        step = 1e-4 * parameters[k]
        ends = [
            quantity(
                surface(*parameters[:k], parameters[k] + sign * step, *parameters[k + 1 :], form),
                theta,
            ).numpy()
            for sign in (1, -1)
        ]
        expected = (ends[0] - ends[1]) / (2 * step)
        np.testing.assert_allclose(
            computed, expected, rtol=1e-5, atol=1e-6 * np.abs(expected).max() + 2e-8
        )

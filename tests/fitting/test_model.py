"""Predicted readings against plain NumPy, and their derivatives against differences."""

import numpy as np
import pytest

from mi_lcair.fitting.model import Hemispherical, Scatterometer
from tests.fitting import numpy_model
from tests.fitting.synthetic import MODEL, ROUGH, THESIS_SETS, disc_average

FORMS = ("thesis", "normalized")
SURFACES = np.array([*THESIS_SETS.values(), ROUGH, (0.05, 0.4, 0.9, 0.7)])
THETA_I, THETA_R = (
    np.radians([0, 20, 20, 20, 60, 60, 75]),
    np.radians([0.5, 20, 23, -60, 60, 10, 74]),
)


@pytest.mark.parametrize("form", FORMS)
def test_readings_are_the_thesis_formulas(form):
    f, _ = Scatterometer(MODEL, form, THETA_I, THETA_R)(MODEL.to_cube(SURFACES))
    expected = [numpy_model.brdf(THETA_I, THETA_R, *surface, form=form) for surface in SURFACES]
    np.testing.assert_allclose(f, expected, rtol=1e-11)


def differences(model, u, step=1e-6):
    """Derivatives of model(u) with respect to u, by central differences."""
    ends = [[model(u + sign * step * axis)[0] for sign in (1, -1)] for axis in np.eye(4)]
    return np.stack([(high - low) / (2 * step) for high, low in ends], axis=-1)


@pytest.mark.parametrize(
    "model",
    [
        Scatterometer(MODEL, "thesis", THETA_I, THETA_R),
        Scatterometer(MODEL, "normalized", THETA_I, THETA_R),
        Hemispherical(MODEL, "thesis", np.radians([10, 70]), "emissivity"),
        Hemispherical(MODEL, "thesis", np.radians([10, 70]), "dhr"),
    ],
    ids=["thesis", "normalized", "emissivity", "dhr"],
)
def test_derivatives_are_those_of_the_readings(model):
    u = MODEL.to_cube(SURFACES[-2:])
    expected = differences(model, u)
    np.testing.assert_allclose(model(u)[1], expected, rtol=1e-6, atol=1e-7 * np.abs(expected).max())


def test_emissivity_and_dhr_are_hemispherical_integrals():
    """Emissivity and DHR agree with a product rule over the hemisphere, for broad lobes.

    The two differ from each other because the model is not reciprocal.
    """
    x, weights = np.polynomial.legendre.leggauss(200)
    theta, phi = np.pi / 4 * (x + 1), np.pi * (x + 1)
    T, P = np.meshgrid(theta, phi, indexing="ij")
    W = np.outer(np.pi / 4 * weights, np.pi * weights) * np.cos(T) * np.sin(T)
    angles = np.radians([20.0, 65.0])
    surfaces = SURFACES[-2:]
    for form in FORMS:
        for quantity, reverse in (("dhr", False), ("emissivity", True)):
            values, _ = Hemispherical(MODEL, form, angles, quantity)(MODEL.to_cube(surfaces))
            for row, surface in zip(values, surfaces):
                for value, angle in zip(row, angles):
                    pair = (T, angle) if reverse else (angle, T)
                    integral = np.sum(W * numpy_model.brdf(*pair, *surface, form=form, azimuth=P))
                    assert value == pytest.approx(1 - integral if reverse else integral, abs=2e-6)


@pytest.mark.slow
@pytest.mark.parametrize("e", [0.0005, 0.0042, 0.25])
def test_aperture_is_the_average_over_the_sources_disc(e):
    surface = (0.11, 0.02, 0.05, e)
    offsets = np.radians([0, 0.5, 0.85, 1.5, 3, -8, 14, -40])
    theta_i = np.radians(np.repeat([20.0, 55.0], len(offsets)))
    theta_r = theta_i + np.tile(offsets, 2)
    half_angle = np.radians(0.909)
    f, _ = Scatterometer(MODEL, "thesis", theta_i, theta_r, half_angle)(MODEL.to_cube([surface]))
    expected = disc_average(theta_i, theta_r, surface, half_angle)
    # Half of the tolerance is the error of the reference, whose square cells make a ragged rim.
    np.testing.assert_allclose(f[0], expected, rtol=4e-3)
    point = numpy_model.brdf(theta_i, theta_r, *surface)
    if e < 0.01:
        assert np.max(np.abs(expected / point - 1)) > 0.5  # the aperture changes the BRDF much


def test_an_aperture_of_nearly_nothing_changes_nothing():
    u = MODEL.to_cube(SURFACES)
    point, small = (
        Scatterometer(MODEL, "thesis", THETA_I, THETA_R, half_angle)(u)[0]
        for half_angle in (0.0, 1e-6)
    )
    np.testing.assert_allclose(small, point, rtol=1e-4)

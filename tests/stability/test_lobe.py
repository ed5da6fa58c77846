"""The Sandford-Robertson BSDF at the limits of its parameters and angles.

Lobe widths are 1e-5 to 1, angles up to 90 - 1e-6 degrees, b = 0 and 1, and epsilon + rho_d on its
bound. tests/plugins/bsdfs/test_precision.py covers e >= 0.0015 up to 89.5 degrees.
"""

import mitsuba as mi
import numpy as np
import pytest
from drjit.llvm.ad import Float64

from docs.studies.float32_map import errors, feasible, load
from mi_lcair.physics.reflection import sandford_robertson_equations
from mi_lcair.physics.reflection import sandford_robertson_equations as sr
from tests.physics.reflection.surfaces import direction, surface
from tests.plugins.bsdfs.test_precision import theta_of
from tests.plugins.reflection_models import exact_HDR, seen_at, uniform

WIDTHS = [1e-5, 1e-4, 1e-3, 4.2e-3, 0.1, 1]
ANGLES_DEG = np.array([0, 1e-3, 30, 60, 80, 85, 89, 89.9, 89.99, 89.999, 90 - 1e-6])
CORNERS = [  # epsilon / G(b), rho_d / G(b), b
    (0.3, 0.1, 0),
    (0.3, 0.1, 1e-4),
    (0.3, 0.1, 0.05),
    (0.3, 0.7, 0.05),
    (0.3, 0.7, 1),
    (0, 0, 1),
]
SAMPLES = 20_000  # number of samples per angle


@pytest.mark.slow
@pytest.mark.parametrize("form", sr.FORMS)
@pytest.mark.parametrize("e", WIDTHS)
def test_mean_weight_of_a_sample_is_HDR(e, form):
    """The mean weight is HDR within 5 standard errors and 2e-4 of HDR.

    The 2e-4 allow for the rounding of the half-vector's slope. Every weight is finite and at most
    10 for these surfaces.
    """
    for corner in CORNERS:
        bsdf = load(feasible(*corner, e), form)
        si = seen_at(np.repeat(np.radians(ANGLES_DEG), SAMPLES))
        _, weight = bsdf.sample(
            mi.BSDFContext(),
            si,
            *uniform(len(ANGLES_DEG) * SAMPLES, 1),
            mi.Point2f(*uniform(len(ANGLES_DEG) * SAMPLES, 2, seed=3)),
        )
        weight = weight[0].numpy().astype(float).reshape(-1, SAMPLES)
        HDR = np.minimum(exact_HDR(bsdf, theta_of(seen_at(np.radians(ANGLES_DEG)).wi)), 1)
        assert np.all((weight >= 0) & (weight <= 10))  # the comparison is false for NaN
        assert np.all(
            np.abs(weight.mean(axis=1) - HDR)
            <= 5 * weight.std(axis=1) / np.sqrt(SAMPLES) + 2e-4 * HDR + 1e-9
        )


@pytest.mark.parametrize(
    "parameters, bound",
    [
        ((0.11, 0.02, 0.05, 0.0042), 1),
        ((0.89, 0.001, 0.16, 0.005), 1),
        (feasible(0.3, 0.7, 0.001, 0.03), 250),
    ],
)
def test_largest_weight_of_a_sample(parameters, bound):
    """The largest weight is 1 for the thesis's materials, but 216 for an extreme surface.

    That surface has epsilon + rho_d on the bound G(b) and a small b. Its rho_s increases from
    almost 0 at the observer's angle to 1 at the horizon. The sampling of the lobe ignores this.
    """
    bsdf = load(parameters)
    theta = np.concatenate(
        [np.linspace(0, np.pi / 2, 360), np.pi / 2 - np.radians(np.geomspace(1e-4, 1, 60))]
    )
    theta, phi = (grid.ravel() for grid in np.meshgrid(theta, np.linspace(0, np.pi, 37)))
    largest = 0
    for view in np.radians([0, 30, 60, 80]):
        value, density = bsdf.eval_pdf(
            mi.BSDFContext(), seen_at(np.full(len(theta), view)), direction(theta, phi, mi.Vector3f)
        )
        weight = value[0].numpy() / np.maximum(density.numpy(), 1e-30)
        largest = max(largest, weight.max())
    assert bound / 4 <= largest <= bound


@pytest.mark.slow
@pytest.mark.parametrize("form", sr.FORMS)
@pytest.mark.parametrize(
    "quantity", [sandford_robertson_equations.HDR, sandford_robertson_equations.DHR]
)
def test_quadrature_to_the_horizon(monkeypatch, quantity, form):
    """The quadrature agrees with one of 400 nodes per panel.

    The error is below 1e-10 up to 89.9 degrees and 2e-6 beyond. It is relative where HDR exceeds 1.
    """
    theta = Float64(np.radians(ANGLES_DEG))
    for e in WIDTHS:
        for corner in CORNERS:
            S = surface(*feasible(*corner, e), form)
            value = quantity(S, theta).numpy()
            with monkeypatch.context() as patch:
                patch.setattr(sandford_robertson_equations, "NODES", 400)
                exact = quantity(S, theta).numpy()
            error = np.abs(value - exact) / np.maximum(exact, 1)
            assert error[ANGLES_DEG <= 89.9].max() <= 1e-10 and error.max() <= 2e-6, (e, corner)


@pytest.mark.slow
@pytest.mark.parametrize("form", sr.FORMS)
@pytest.mark.parametrize(
    "e, bound", [(1e-5, 5e-3), (1e-4, 1e-3), (1e-3, 1e-3), (4.2e-3, 2e-4), (0.1, 2e-5), (1, 2e-5)]
)
def test_tabulated_HDR_beyond_89_degrees(e, bound, form):
    """The absolute error of the table is below a bound that depends on e.

    The nodes are uniform in sqrt(cos theta). They do not resolve a sharp bend of HDR at
    cos theta < 1e-3.
    """
    theta = np.pi / 2 - np.radians(np.geomspace(1e-6, 1, 300))
    for corner in CORNERS:
        bsdf = load(feasible(*corner, e), form)
        wi = seen_at(theta).wi
        assert (
            np.max(np.abs(bsdf.HDR(wi).numpy() - np.minimum(exact_HDR(bsdf, theta_of(wi)), 1)))
            <= bound
        )


@pytest.mark.slow
@pytest.mark.parametrize("form", sr.FORMS)
@pytest.mark.parametrize("e", WIDTHS)
def test_float32_at_the_edges(e, form):
    """The value and the weight of a sample have an error of 1e-4 up to 89.9 degrees, 3e-3 beyond.

    This is a section of the map in docs/validation/stability.
    """
    from_horizon = 90 - ANGLES_DEG
    for corner in CORNERS:
        value, weight, _ = errors(feasible(*corner, e), from_horizon, form, 400)
        for error in (value, weight):
            assert error[ANGLES_DEG <= 89.9].max() <= 1e-4 and error.max() <= 3e-3, corner


# First angle in degrees at which HDR exceeds 1 for epsilon = rho_d = 0 (page `stability`)
# form -> b -> angle for each of SATURATED_WIDTHS, or None if HDR never exceeds 1
SATURATED = {
    "thesis": {
        0.0: (89.6, 87.4, 81.6, 69.3, 60.1),
        0.05: (None, None, None, 71.0, 60.4),
        0.16: (None, None, None, None, 62.9),
        0.3: (None,) * 5,
        1.0: (None,) * 5,
    },
    "normalized": dict.fromkeys((0.0, 0.05, 0.16, 0.3, 1.0), (89.6, 87.4, 81.6, 69.3, 60.1)),
}
SATURATED_WIDTHS = (0.0042, 0.03, 0.1, 0.3, 1.0)


@pytest.mark.slow
@pytest.mark.parametrize("form", sr.FORMS)
def test_where_HDR_exceeds_one(form):
    """The angle that the plugin reports agrees with Float64. Beyond it the emissivity is 0."""
    for b, row in SATURATED[form].items():
        for e, expected in zip(SATURATED_WIDTHS, row):
            bsdf = load((0, 0, b, e), form)
            angle = bsdf.first_saturated_angle_deg()
            if expected is None:
                assert angle is None, (b, e)
            else:
                assert angle == pytest.approx(expected, abs=0.1), (b, e)
                beyond = seen_at(np.radians(angle + 0.1))
                assert bsdf.eval_attribute_1("emissivity", beyond)[0] <= 1e-5

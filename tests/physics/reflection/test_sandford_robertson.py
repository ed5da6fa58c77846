"""The Sandford-Robertson functions against the printed equations and their definitions."""

from itertools import product

import drjit as dr
import mpmath
import numpy as np
import pytest
from drjit.llvm.ad import Array3f, Array3f64, Float, Float64
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import chi2

from mi_lcair.errors import InputError
from mi_lcair.fitting.model import parameters_at as values_and_derivatives
from mi_lcair.physics import reflection
from mi_lcair.physics.reflection import sandford_robertson_equations as sr
from mi_lcair.physics.reflection.models import MODELS
from mi_lcair.physics.reflection.sandford_robertson import E_MIN
from tests.fitting.numpy_model import G
from tests.physics import thesis
from tests.physics.reflection.surfaces import MATERIALS, direction, random_parameters, surface

SURFACES = [
    *MATERIALS,
    (0.2, 0.1, 0.5, 0.3),
    (0.0, 0.3, 0.9, 1.0),
    (0.3, 0.0, 0.01, 0.0015),
    (0.5, 0.4, 1e-3, 0.6),
]


@pytest.mark.slow
@pytest.mark.parametrize("form", sr.FORMS)
@pytest.mark.parametrize("parameters", SURFACES)
@thesis.EXACT
def test_brdf_is_the_printed_one(parameters, form):
    """The BRDF agrees with the printed equations, at the maximum of the lobe and on its flanks.

    The directions lie in and outside the plane of incidence, up to 89.9 degrees from the normal.
    """
    e = parameters[3]
    angles = [
        (i, r, np.pi - dphi)
        for i in np.radians([0, 20, 60, 85, 89.9])
        for dphi in (0, 0.3 * e, 3 * e, 1, 3)
        for r in (*np.radians([0, 45, 80, 89.9]), i + 0.5 * e, i - 2 * e)
        if 0 <= r < np.pi / 2
    ]
    theta_i, theta_r, dphi = np.array(angles).T
    computed = sr.f(
        surface(*parameters, form), direction(theta_i, dphi), direction(theta_r)
    ).numpy()
    exact = [thesis.brdf(mpmath, *map(mpmath.mpf, (*row, *parameters)), form) for row in angles]
    np.testing.assert_allclose(computed, np.array(exact, dtype=float), rtol=1e-11)


@thesis.EXACT
def test_emissivity_and_specular_reflectance_are_the_printed_ones():
    for epsilon, rho_d, b, e in SURFACES:
        for theta in np.radians([0, 30, 80, 89.9]):
            S, cos, sin2 = (
                surface(epsilon, rho_d, b, e),
                Float64(np.cos(theta)),
                Float64(np.sin(theta) ** 2),
            )
            exact = (
                mpmath.mpf(epsilon) * thesis.g(mpmath, theta, b) / thesis.G(mpmath, mpmath.mpf(b))
            )
            assert sr.emissivity(S, cos, sin2)[0] == pytest.approx(float(exact), rel=1e-12)
            exact = thesis.rho_s(mpmath, *map(mpmath.mpf, (theta, epsilon, rho_d, b)))
            assert sr.rho_s(S, cos, sin2)[0] == pytest.approx(float(exact), rel=1e-12)


@pytest.mark.parametrize(
    "b", [0, 1e-20, 1e-6, 1e-3, 0.05, 0.16, 0.5, 0.948, 0.949, 0.999, 1 - 1e-9, 1]
)
def test_G_is_the_integral_of_g(b):
    """G = 2 int g cos sin dtheta; between b = 0.948 and 0.949 the code switches to a series."""
    with mpmath.workdps(20):
        exact = 2 * mpmath.quad(
            lambda t: thesis.g(mpmath, t, b) * mpmath.cos(t) * mpmath.sin(t),
            [
                0,
                0.5,
                1.5,
                *(mpmath.pi / 2 - d for d in (1e-2, 1e-4, 1e-6) if b < 0.5),
                mpmath.pi / 2,
            ],
        )
    assert sr.G(Float64(b))[0] == pytest.approx(float(exact), rel=1e-14)


@pytest.mark.slow
@pytest.mark.parametrize("e", [0.0015, 0.0042, 0.05, 0.3, 1])
def test_H_is_the_hemispherical_integral_of_the_lobe(e):
    """H = (1 / 4 pi) int h(alpha) domega, with h computed from the directions.

    1e-9 is the error of the quadrature.
    """
    for theta_i in np.radians([0, 30, 70, 85, 89.5]):
        theta, phi, weight = thesis.hemisphere(theta_i, 2 * e)
        lobe = sr.h(
            sr.sin2_alpha(direction(theta_i), direction(theta.ravel(), np.pi - phi.ravel())),
            Float64(e),
        ).numpy()
        H = np.sum(lobe * weight.ravel()) / (4 * np.pi)
        assert sr.e2_H(Float64(np.cos(theta_i)), Float64(e))[0] == pytest.approx(e**2 * H, rel=1e-9)


def test_limits_of_b():
    """b = 0 gives g = G = 1, a blackbody or a perfect diffuse reflector; b = 1 gives G = 1/2."""
    theta = np.radians([0, 30, 60, 89, 90])
    cos, sin2 = Float64(np.cos(theta)), Float64(np.sin(theta) ** 2)
    np.testing.assert_allclose(sr.g(cos, sin2, Float64(1)), np.cos(theta) ** 2, atol=1e-15)
    np.testing.assert_allclose(sr.g(cos, sin2, Float64(0))[:4], 1, rtol=1e-15)
    i, r = direction(np.radians([0, 40, 85])), direction(np.radians([70, 20, 85]), 2.0)
    np.testing.assert_allclose(sr.f(surface(0, 1, 0, 0.01), i, r), 1 / np.pi, rtol=1e-14)
    np.testing.assert_array_equal(sr.f(surface(1, 0, 0, 0.01), i, r), 0)


def test_brdf_is_zero_from_below_and_at_the_horizon():
    up, level, down = (direction(np.radians(angle)) for angle in (40, 90, 130))
    level.z = 0
    for form in sr.FORMS:
        for i, r in ((up, level), (level, up), (up, down), (down, up), (down, down)):
            assert sr.f(surface(0.2, 0.1, 0.5, 0.3, form), i, r)[0] == 0


@pytest.mark.slow
@pytest.mark.parametrize("form", sr.FORMS)
@pytest.mark.parametrize("Type, Vector", [(Float, Array3f), (Float64, Array3f64)])
def test_values_and_gradients_are_finite_over_the_whole_box(Type, Vector, form):
    numbers = [Float64(column) for column in random_parameters(4000).T]
    dr.enable_grad(*numbers)
    rng = np.random.default_rng(1)
    theta_i, theta_r, phi = (
        Float64(
            np.radians(
                np.where(
                    rng.random(4000) < 0.2,
                    rng.choice([0, 89.9, 90, 91], 4000),
                    rng.uniform(0, 90, 4000),
                )
            )
        )
        for _ in range(3)
    )
    i, r = (
        Vector(Array3f64(dr.sin(t) * dr.cos(p), dr.sin(t) * dr.sin(p), dr.cos(t)))
        for t, p in ((theta_i, 4 * phi), (theta_r, Float64(0)))
    )
    value = sr.f(sr.surface(*numbers, form=form).cast(Type), i, r)
    dr.backward(value)
    assert np.all(np.isfinite(value.numpy())) and np.all(value.numpy() >= 0)
    for number in numbers:
        assert np.all(np.isfinite(dr.grad(number).numpy()))


@pytest.mark.slow
@thesis.EXACT
@pytest.mark.parametrize("k", range(4), ids=["epsilon", "rho_d", "b", "e"])
def test_gradients_of_the_brdf(k):
    """Derivatives agree with mpmath's differences of the equation, on the lobe's flank."""
    for parameters in SURFACES:
        e = parameters[3]
        angles = (0.7, 0.7 + 0.6 * e, np.pi - 0.5 * e)
        numbers = [dr.opaque(Float64, number) for number in parameters]
        dr.enable_grad(numbers[k])
        dr.backward(
            sr.f(sr.surface(*numbers), direction(angles[0], angles[2]), direction(angles[1]))
        )
        at = [mpmath.mpf(number) for number in parameters]
        exact = mpmath.diff(
            lambda x: thesis.brdf(mpmath, *map(mpmath.mpf, angles), *at[:k], x, *at[k + 1 :]), at[k]
        )
        assert dr.grad(numbers[k])[0] == pytest.approx(float(exact), rel=1e-9)


@pytest.mark.parametrize(
    "parameters, words",
    [
        ((-0.1, 0.1, 0.5, 0.3), ("epsilon = -0.1", "0 or more")),
        ((0.1, -0.1, 0.5, 0.3), ("rho_d = -0.1", "0 or more")),
        ((0.1, 0.1, -0.5, 0.3), ("b = -0.5", "0..1")),
        ((0.1, 0.1, 1.5, 0.3), ("b = 1.5", "0..1")),
        ((0.1, 0.1, 0.5, 0), ("e = 0", "positive and at most 1")),
        ((0.1, 0.1, 0.5, 1.5), ("e = 1.5", "positive and at most 1")),
        ((0.4, 0.2, 1, 0.3), ("epsilon + rho_d = 0.6", "at most G(b) = 0.5")),
        ((float("nan"), 0.1, 0.5, 0.3), ("epsilon = nan", "0 or more")),
        ((0.1, 0.1, float("nan"), 0.3), ("b = nan", "0..1")),
    ],
)
def test_infeasible_parameters_are_named_with_value_and_bound(parameters, words):
    with pytest.raises(InputError) as error:
        sr.check_feasible(*parameters)
    assert all(word in str(error.value) for word in words) and "\n" not in str(error.value)


def test_the_azimuth_alone_does_not_matter():
    """A surface that is turned about its normal reflects the same."""
    S = surface(0.2, 0.1, 0.3, 0.05)
    values = [
        sr.f(S, direction(0.5, 3.0 + turn), direction(0.52, turn))[0] for turn in (0, 1.1, 2.5, 4)
    ]
    assert values == pytest.approx([values[0]] * 4, rel=1e-12)


def test_the_bounds_themselves_are_feasible():
    for parameters in ((0, 0, 0, 1), (1, 0, 0, 1), (0, 1, 0, 1e-3), (0.25, 0.25, 1, 1)):
        sr.check_feasible(*parameters)


# ---------------------------------------------------------------- Half-vector sampling
# The tests below use the slopes s = (x/z, y/z) of the microfacet normal, stretched by 1/e. In these
# coordinates the Trowbridge-Reitz distribution is 1 / (pi (1 + s^2)^2) for every e, so that every
# lobe is resolved. By Smith's hypothesis, a microfacet is visible from w in proportion to
# max(0, w . normal) / (normal . z).


def visible_density(psi, phi, cos, sin, e):
    """Density of visible slopes over psi = atan |s| and the azimuth phi, not normalized.

    The slopes are seen from w = (sin, 0, cos).
    """
    return np.maximum(0, cos * np.cos(psi) + e * sin * np.sin(psi) * np.cos(phi)) * np.sin(psi)


def visible_cells(cells, nodes, cos, sin, e):
    """Integrals of `visible_density` over cells of psi and phi, (cells, cells).

    They are computed by the midpoint rule.
    """
    x = (np.arange(cells * nodes) + 0.5) / (cells * nodes)
    psi, phi = np.meshgrid(np.pi / 2 * x, 2 * np.pi * x, indexing="ij")
    density = visible_density(psi, phi, cos, sin, e).reshape(cells, nodes, cells, nodes)
    return density.sum(axis=(1, 3)) * np.pi**2 / (cells * nodes) ** 2


@pytest.mark.slow
@pytest.mark.parametrize("e", [0.0015, 0.0042, 0.1, 0.6, 1])
@pytest.mark.parametrize("theta_deg", [0, 45, 80, 89.5])
def test_half_vectors_have_the_distribution_of_visible_slopes(e, theta_deg):
    """Chi-square test over 16 x 16 cells of the stretched slopes.

    200,000 samples are tested at a significance of 1e-4.
    """
    rng = np.random.default_rng(5)
    count, theta = 200_000, np.radians(theta_deg)
    half = sr.sample_half_vector(
        direction(theta, Vector=Array3f), Float(e), *(Float(rng.random(count)) for _ in range(2))
    ).numpy()
    half = half.astype(float)
    np.testing.assert_allclose(np.linalg.norm(half, axis=0), 1, rtol=1e-6)
    s_x, s_y = half[0] / half[2] / e, half[1] / half[2] / e
    cells = [
        np.clip((x * 16).astype(int), 0, 15)
        for x in (
            np.arctan(np.hypot(s_x, s_y)) / (np.pi / 2),
            np.arctan2(s_y, s_x) / (2 * np.pi) % 1,
        )
    ]
    computed = np.bincount(cells[0] * 16 + cells[1], minlength=256)
    expected = visible_cells(16, 40, np.cos(theta), np.sin(theta), e).ravel()
    expected *= count / expected.sum()
    large = expected >= 10
    statistic = np.sum((computed[large] - expected[large]) ** 2 / expected[large])
    assert statistic < chi2.ppf(1 - 1e-4, large.sum() - 1)
    assert computed[~large].sum() <= expected[~large].sum() + 5 * np.sqrt(
        expected[~large].sum() + 1
    )


@pytest.mark.slow
@pytest.mark.parametrize("e", [0.0015, 0.0042, 0.1, 0.6, 1])
def test_lobe_pdf_is_the_density_of_visible_slopes_seen_as_directions(e):
    """`lobe_pdf` is the density of visible slopes, transformed to directions.

    domega_i = 4 (r . half) domega_half and domega_half = cos^3(alpha) d^2 slope. A numerical
    integral normalizes the density.
    """
    rng = np.random.default_rng(6)
    for theta in np.radians([0, 45, 80, 89.5]):
        cos, sin = np.cos(theta), np.sin(theta)
        psi, phi = np.pi / 2 * rng.random(100), 2 * np.pi * rng.random(100)
        density = visible_density(psi, phi, cos, sin, e) / visible_cells(1, 800, cos, sin, e).sum()
        half = np.array(
            [e * np.tan(psi) * np.cos(phi), e * np.tan(psi) * np.sin(phi), np.ones(100)]
        )
        half /= np.linalg.norm(half, axis=0)
        per_half = density / (e**2 * np.tan(psi) / np.cos(psi) ** 2) / half[2] ** 3
        r = np.array([sin, 0, cos])
        i = 2 * (r @ half) * half - r[:, None]
        above = (i[2] > 0) & (r @ half > 0)  # directions for which the density is used
        computed = sr.lobe_pdf(Array3f64(i), direction(theta), Float64(e)).numpy()
        np.testing.assert_allclose(computed[above], (per_half / (4 * (r @ half)))[above], rtol=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("e", [0.0042, 0.1, 0.6, 1])
def test_lobe_pdf_integrates_to_the_samples_above_the_horizon(e):
    """The integral of lobe_pdf over the hemisphere is the share of samples that point upward.

    The tolerance is 5 standard errors.
    """
    rng = np.random.default_rng(7)
    count = 200_000
    u1, u2 = (Float64(rng.random(count)) for _ in range(2))
    for theta_r in np.radians([0, 45, 85]):
        theta, phi, weight = thesis.hemisphere(theta_r, 2 * e)
        i = direction(theta.ravel(), np.pi + phi.ravel())
        integral = np.sum(sr.lobe_pdf(i, direction(theta_r), Float64(e)).numpy() * weight.ravel())
        r = direction(theta_r)
        half = sr.sample_half_vector(r, Float64(e), u1, u2)
        share = np.mean((2 * dr.dot(r, half) * half.z - r.z).numpy() > 0)
        assert abs(integral - share) < 5 * np.sqrt(integral * max(1 - integral, 1e-9) / count)


@pytest.mark.parametrize("form", sr.FORMS)
@pytest.mark.parametrize("parameters", [(0.1, 0.2), (0.0, 0.7), (0.4, 0.0)])
def test_b_of_0_is_a_mirror_with_a_diffuse_part(parameters, form):
    """Thesis 2.3.3.3: rho_d / pi in all directions, and the rest within 20 e of the mirror's."""
    epsilon, rho_d, e = *parameters, 1e-3
    model = reflection.model("sandford_robertson")
    S = model.surface(*map(Float64, (epsilon, rho_d, 0.0, e)), form=form)
    angles = Float64(np.radians([0, 30, 60, 80]))
    np.testing.assert_allclose(model.HDR(S, angles).numpy(), 1 - epsilon, atol=2e-6)
    np.testing.assert_allclose(model.DHR(S, angles).numpy(), 1 - epsilon, atol=2e-6)
    observer = direction(np.radians(30), 0)
    for theta, phi in ((30, 0), (0, 0), (60, 180), (35, 180), (30, 185)):
        f = model.f(S, direction(np.radians(theta), np.radians(phi)), observer)
        far = (1 - epsilon - rho_d) * e**2 / np.radians(2) ** 4  # the lobe falls as alpha^-4
        assert f.numpy()[0] == pytest.approx(rho_d / np.pi, abs=far)
    peak = model.f(S, direction(np.radians(30), np.pi), observer).numpy()[0]
    # The lobe at its maximum: D / (4 cos cos') with D = 1 / (pi e^2) (thesis Eq 2.18)
    lobe = (1 - epsilon - rho_d) / (4 * np.pi * e**2 * np.cos(np.radians(30)))
    assert peak - rho_d / np.pi == pytest.approx(lobe, rel=0.2)


# Every point of the cube is feasible, and every feasible surface is a point of the cube
# --------------------------------------------------------------------------------------

MODEL = MODELS["sandford_robertson"]

unit = st.floats(0, 1)


def parameters_at(u):
    return values_and_derivatives(MODEL, u)


def check_feasible(*values):
    MODEL.check_feasible(*values, form="thesis")


@pytest.mark.slow
@given(st.lists(st.tuples(unit, unit, unit, unit), min_size=1, max_size=4))
@settings(max_examples=60, deadline=None)
def test_every_point_is_feasible(u):
    for epsilon, rho_d, b, e in parameters_at(np.array(u))[0]:
        check_feasible(float(epsilon), float(rho_d), float(b), float(e))


def test_the_corners_are_the_bounds():
    for corner in product((0.0, 1.0), repeat=4):
        epsilon, rho_d, b, e = parameters_at(np.array([corner]))[0][0]
        check_feasible(epsilon, rho_d, b, e)
        assert b == corner[2] and np.isclose(e, 1 if corner[3] else E_MIN, rtol=1e-12)
        bound = 0.5 if b else 1.0  # G(1), G(0)
        assert np.isclose(epsilon, bound * corner[0]) and np.isclose(
            rho_d, bound * (1 - corner[0]) * corner[1]
        )


def test_there_and_back():
    u = np.random.default_rng(0).uniform(0.01, 0.99, (50, 4))
    parameters, _ = parameters_at(u)
    np.testing.assert_allclose(MODEL.to_cube(parameters), u, rtol=1e-12)
    epsilon, rho_d, b, e = parameters.T
    np.testing.assert_allclose(epsilon / G(b), u[:, 0], rtol=1e-12)
    np.testing.assert_allclose(np.log10(e), -5 * (1 - u[:, 3]), rtol=1e-12)


def test_derivatives():
    u, step = np.array([[0.3, 0.4, 0.2, 0.7], [0.9, 0.05, 0.01, 0.5]]), 1e-6
    expected = np.stack(
        [
            (parameters_at(u + step * axis)[0] - parameters_at(u - step * axis)[0]) / (2 * step)
            for axis in np.eye(4)
        ],
        axis=-1,
    )
    np.testing.assert_allclose(parameters_at(u)[1], expected, rtol=1e-7, atol=1e-9)


def test_bounds_follow_from_b():
    low, high = MODEL.feasible_range((0.1, 0.2, 0.4, 0.5))
    np.testing.assert_allclose(low, [0, 0, 0, E_MIN])
    np.testing.assert_allclose(high, [G(0.4), G(0.4), 1, 1])


def test_starts_are_spread_and_belong_to_their_seed():
    first, again, other = (
        MODEL.starting_points(64, 3),
        MODEL.starting_points(64, 3),
        MODEL.starting_points(64, 4),
    )
    assert np.array_equal(first, again) and not np.array_equal(first, other)
    assert np.all((first > 0) & (first < 1))
    e = parameters_at(first)[0][:, 3]
    # Each of the three decades holds about a third of the points.
    assert np.all(np.histogram(np.log10(e), bins=3, range=(-3, 0))[0] >= 20)


def test_starts_cover_what_real_surfaces_have():
    """Absorbed share 0.02..0.98, diffuse share 1e-4..0.98 and e 1e-3..1 in logarithms, b^2 = u^4"""
    u = MODEL.starting_points(4000, 1)
    e = parameters_at(u)[0][:, 3]
    for column, low, high, middle in (
        (u[:, 0], 0.02, 0.98, 0.5),
        (u[:, 1], 0.98e-4, 0.98, 0.98e-2),
        (u[:, 2], 0, 1, 0.25),
        (e, 1e-3, 1, np.sqrt(1e-3)),
    ):
        assert column.min() == pytest.approx(low, rel=0.02, abs=1e-5)
        assert column.max() == pytest.approx(high, rel=0.01)
        assert np.median(column) == pytest.approx(middle, rel=0.01)


@pytest.mark.parametrize(
    "values, held, expected",
    [
        ((0.2, 0.3, 0.5, 0.1), 0, (0.2, 0.3, 0.5, 0.1)),  # feasible
        ((0.2, 0.9, 1.0, 0.1), 0, (0.2, 0.3, 1.0, 0.1)),  # epsilon + rho_d <= G(1) = 1/2
        ((0.2, 0.9, 1.0, 0.1), 1, (0.0, 0.5, 1.0, 0.1)),  # 0.9 is not feasible
        ((0.2, 0.4, 1.0, 0.1), 1, (0.1, 0.4, 1.0, 0.1)),
        ((0.2, 0.6, 1.0, 0.1), 2, (0.125, 0.375, 1.0, 0.1)),
        ((0.2, 0.6, 1.0, 0.1), 3, (0.125, 0.375, 1.0, 0.1)),
        ((-1, 0.3, 2.0, 0), 2, (0.0, 0.3, 1.0, E_MIN)),
        ((2, -0.3, 0.0, 2), 2, (1.0, 0.0, 0.0, 1.0)),
    ],
)
def test_the_nearest_feasible_surface(values, held, expected):
    assert MODEL.nearest_feasible(np.array(values, dtype=float), held) == pytest.approx(expected)


def test_names_of_bounds():
    names = MODEL.bound_names
    assert names((0, 0, 0, 0)) == ["0", "0", "0", "1e-05"]
    assert names((0.5, 0.5, 0.5, 0.5)) == [None] * 4
    full = "epsilon + rho_d = G(b)"
    assert names((1, 0.5, 1, 1)) == [full, full, "1", "1"]
    assert names((0.5, 1, 0.5, 1)) == [full, full, None, "1"]
    assert names((0, 1, 0.5, 1))[:2] == ["0", full]


def test_an_edge_of_the_cube_has_no_division_by_zero():
    """epsilon = G(b) leaves nothing for rho_d, and e below E_MIN is E_MIN."""
    u = MODEL.to_cube(np.array([[1.0, 0.0, 0.0, 1e-9], [0.5, 0.0, 1.0, 1.0]]))
    np.testing.assert_allclose(u, [[1, 0, 0, 0], [1, 0, 1, 1]], rtol=1e-12, atol=1e-12)

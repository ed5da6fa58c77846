"""The microfacet model against its printed equations.

Further tests check reciprocity, finite derivatives, and the distribution of sampled normals.
"""

import drjit as dr
import mpmath
import numpy as np
import pytest
from drjit.llvm.ad import Array3f, Array3f64, Float, Float64
from scipy.integrate import quad
from scipy.stats import chi2

from mi_lcair.errors import InputError
from mi_lcair.physics.reflection import microfacet_equations
from mi_lcair.physics.reflection.microfacet import MODEL
from tests.physics.reflection import microfacet_equations as printed
from tests.physics.reflection.surfaces import direction

EXACT = mpmath.workdps(40)
# alpha, gamma, n, k, rho_d of paint, of sandblasted and polished metal, and of extreme surfaces.
SURFACES = [
    (0.19, 1.64, 1.44, 0.21, 0.01),
    (0.13, 0.68, 2.1, 1.3, 0.64),
    (0.0056, 1.21, 11, 0, 0.0),
    (1e-4, 3.9, 50, 100, 1.0),
    (0.9, 0.5, 1.001, 0, 0.5),
]
BOTH_TYPES = pytest.mark.parametrize("Type, Vector", [(Float64, Array3f64), (Float, Array3f)])


def surface(*values):
    numbers = [Float64(value) for value in values]
    dr.make_opaque(*numbers)
    return MODEL.surface(*numbers)


def random_parameters(count, seed=0):
    """Parameters (count, 5) over their whole range; a third of the coordinates lie on bounds."""
    rng = np.random.default_rng(seed)
    u = np.where(
        rng.random((count, 5)) < 0.33, rng.integers(0, 2, (count, 5)), rng.random((count, 5))
    )
    return np.array([MODEL.values_at(row) for row in u])


def angles_of(alpha):
    """theta_i, theta_r and phi in and outside the plane of incidence, up to 89.9 degrees."""
    return [
        (i, r, np.pi - phi)
        for i in np.radians([0, 20, 60, 85, 89.9])
        for phi in (0, 0.3 * alpha, 3 * alpha, 1, 3)
        for r in (*np.radians([0, 45, 80, 89.9]), i + 0.5 * alpha, i - 2 * alpha)
        if 0 <= r < np.pi / 2
    ]


def vector(theta, phi=0):
    sin, cos = mpmath.sin(theta), mpmath.cos(theta)
    return sin * mpmath.cos(phi), sin * mpmath.sin(phi), cos


# ------------------------------------------------------------------ Equations


@pytest.mark.slow
@pytest.mark.parametrize("parameters", SURFACES)
@EXACT
def test_brdf_is_the_printed_one(parameters):
    theta_i, theta_r, phi = np.array(angles_of(parameters[0])).T
    i, r = direction(theta_i, phi), direction(theta_r)
    at = [mpmath.mpf(value) for value in parameters]
    # Both use the same rounded directions: an error of 1e-16 in them changes such a lobe by 1e-9.
    pairs = zip(*(np.broadcast_to(w.numpy(), (3, len(phi))).T for w in (i, r)))
    exact = [printed.brdf(mpmath, *(list(map(mpmath.mpf, w)) for w in pair), *at) for pair in pairs]
    np.testing.assert_allclose(
        MODEL.f(surface(*parameters), i, r), np.array(exact, dtype=float), rtol=2e-11
    )


def test_brdf_and_density_of_a_broad_lobe():
    """The printed equations in NumPy, over the hemisphere; the density is G_1(r) D / (4 c_r)."""
    parameters = alpha, gamma, *_ = 0.4, 1.64, 1.44, 0.21, 0.4
    rng = np.random.default_rng(8)
    theta, phi = np.arccos(rng.uniform(0.05, 1, (2, 200))), rng.uniform(0, 2 * np.pi, (2, 200))
    i, r = map(direction, theta, phi)
    at_i, at_r = i.numpy(), r.numpy()
    S, exact = surface(*parameters), printed.brdf(np, at_i, at_r, *parameters)
    np.testing.assert_allclose(MODEL.f(S, i, r), exact, rtol=1e-9)

    half = (at_i + at_r) / np.linalg.norm(at_i + at_r, axis=0)
    masking = np.minimum(1, 2 * half[2] * at_r[2] / np.sum(at_r * half, axis=0))
    density = masking * printed.distribution(np, half[2] ** 2, alpha, gamma) / (4 * at_r[2])
    np.testing.assert_allclose(MODEL.lobe_pdf(S, i, r), density, rtol=1e-9)


def test_reflectances_of_a_broad_lobe():
    """HDR by a product rule over the hemisphere; its parts for the renderer add up to it."""
    S, angles = surface(0.6, 2, 1.6, 0.5, 0.3), np.radians([0.0, 40.0, 75.0])
    x, weights = np.polynomial.legendre.leggauss(60)
    theta, phi = (side.ravel() for side in np.meshgrid(np.pi / 4 * (x + 1), np.pi * (x + 1)))
    weight = np.outer(np.pi * weights, np.pi / 4 * weights).ravel() * np.cos(theta) * np.sin(theta)
    sources = direction(theta, phi)
    exact = [
        weight @ MODEL.f(S, sources, direction(np.full(len(theta), angle))).numpy()
        for angle in angles
    ]
    theta_r, cos, sin2 = map(Float64, (angles, np.cos(angles), np.sin(angles) ** 2))
    np.testing.assert_allclose(MODEL.HDR(S, theta_r), exact, rtol=1e-3)
    np.testing.assert_allclose(MODEL.DHR(S, theta_r), exact, rtol=1e-3)
    lobe = MODEL.lobe_HDR(S, theta_r) * MODEL.lobe_scale(S, cos, sin2)
    np.testing.assert_allclose(MODEL.floor_HDR(S, cos, sin2) + lobe, exact, rtol=1e-3)


@pytest.mark.parametrize("parameters", SURFACES)
def test_float32_keeps_its_digits(parameters):
    """The relative error in Float32 is 1e-5, also on the lobe's flank and for alpha = 1e-4."""
    theta_i, theta_r, phi = np.array(angles_of(parameters[0])).T
    i, r = direction(theta_i, phi, Array3f), direction(theta_r, 0.0, Array3f)
    S = surface(*parameters)
    exact = MODEL.f(S, Array3f64(i), Array3f64(r)).numpy()
    np.testing.assert_allclose(MODEL.f(S.cast(Float), i, r).numpy(), exact, rtol=1e-5)


@pytest.mark.parametrize("gamma", [0.5, 1 - 1e-9, 1, 1 + 1e-4, 1.5, 2, 4])
@pytest.mark.parametrize("alpha", [1e-4, 0.1, 0.9, 1 - 1e-9, 1])
@EXACT
def test_distribution_is_normalised(alpha, gamma):
    """D_0 agrees with the closed form in mpmath, which is exact except at removable limits."""
    at = [mpmath.mpf(x) if x != 1 else 1 - mpmath.mpf(10) ** -15 for x in (alpha, gamma)]
    exact = printed.distribution(mpmath, 1, *at)
    assert microfacet_equations.peak(Float64(alpha), Float64(gamma))[0] == pytest.approx(
        float(exact), rel=1e-13
    )


def test_gamma_2_is_trowbridge_reitz():
    alpha, sin2 = 0.3, np.linspace(0, 1, 9)
    S = surface(alpha, 2, 1.5, 0, 0)
    computed = microfacet_equations.density(Float64(sin2), S.peak, S.spread, S.gamma)
    exact = alpha**2 / (np.pi * (alpha**2 * (1 - sin2) + sin2) ** 2)
    np.testing.assert_allclose(computed, exact, rtol=1e-14)


@pytest.mark.parametrize(
    "n, k", [(1, 0), (1 + 1e-6, 0), (1.5, 0), (1.5, 1e-3), (1, 1), (3, 30), (50, 0), (50, 100)]
)
@pytest.mark.parametrize("Type, digits", [(Float64, 1e-13), (Float, 3e-6)])
def test_fresnel_is_the_complex_one(n, k, Type, digits):
    """F and 1 - F have small relative errors from normal incidence to 89.9999 degrees."""
    cos = Type(np.cos(np.radians([0, 30, 55, 80, 89, 89.9, 89.9999])))
    S = surface(0.1, 2, n, k, 0).cast(Type)
    F = microfacet_equations.reflectance(cos, S.contrast, S.nk).numpy()
    T = microfacet_equations.transmittance(cos, S.contrast, S.nk).numpy()
    with EXACT:
        exact = [printed.fresnel(mpmath, mpmath.mpf(c), mpmath.mpf(n), mpmath.mpf(k)) for c in cos]
        refracted = [1 - x for x in exact]
    np.testing.assert_allclose(F, np.array(exact, dtype=float), rtol=digits, atol=1e-30)
    np.testing.assert_allclose(T, np.array(refracted, dtype=float), rtol=digits)


# ------------------------------------------------------------------ Over the whole box


def many_directions(count, parameters, Vector, seed=1):
    """Pairs of directions over the sphere, some at 90 degrees, a third of them near the lobe."""
    rng = np.random.default_rng(seed)
    grazing = lambda: rng.choice([0, 89.9, 89.99999, 90, 91], count)
    theta_i, theta_r = (
        np.radians(np.where(rng.random(count) < 0.2, grazing(), rng.uniform(0, 90, count)))
        for _ in range(2)
    )
    phi = rng.uniform(0, 2 * np.pi, count)
    near = rng.random(count) < 0.33
    width = parameters[:, 0]
    theta_r = np.where(near, np.abs(theta_i + width * rng.normal(size=count)), theta_r)
    phi = np.where(near, np.pi + width * rng.normal(size=count), phi)
    return direction(theta_i, phi, Vector), direction(theta_r, 0.0, Vector)


@pytest.mark.slow
@BOTH_TYPES
def test_reciprocal_to_the_last_bit(Type, Vector):
    parameters = random_parameters(2000)
    S = MODEL.surface(*map(Float64, parameters.T)).cast(Type)
    i, r = many_directions(2000, parameters, Vector)
    np.testing.assert_array_equal(MODEL.f(S, i, r), MODEL.f(S, r, i))


@pytest.mark.slow
@BOTH_TYPES
def test_values_and_derivatives_are_finite(Type, Vector):
    parameters = random_parameters(2000, seed=2)
    numbers = [Float64(column) for column in parameters.T]
    dr.enable_grad(*numbers)
    value = MODEL.f(MODEL.surface(*numbers).cast(Type), *many_directions(2000, parameters, Vector))
    dr.backward(value)
    assert np.all(np.isfinite(value.numpy())) and np.all(value.numpy() >= 0)
    for number in numbers:
        assert np.all(np.isfinite(dr.grad(number).numpy()))


def test_at_the_horizon():
    """The BRDF is 0 at the horizon and below it, and finite above it."""
    cos = np.array([1, 0.5, 1e-3, 1e-7, 1e-20, 1e-38, 0, -1e-38, -1e-3, -1], dtype=np.float32)
    cos_i, cos_r = (grid.ravel() for grid in np.meshgrid(cos, cos))
    i, r = (
        Array3f(Float(sign * np.sqrt(1 - c * c)), Float(0), Float(c))
        for sign, c in ((-1, cos_i), (1, cos_r))
    )
    u = Float(np.random.default_rng(0).random(len(cos_i)))
    for parameters in random_parameters(20, seed=3):
        S = surface(*parameters).cast(Float)
        f, pdf = MODEL.f(S, i, r).numpy(), MODEL.lobe_pdf(S, i, r).numpy()
        drawn = MODEL.sample_lobe(S, Array3f(r.x, r.y, abs(r.z)), u, u, u).numpy()
        assert np.all(f[(cos_i <= 0) | (cos_r <= 0)] == 0)
        assert all(np.all(np.isfinite(x)) for x in (f, pdf, drawn, f * np.maximum(cos_i, 0)))


@pytest.mark.slow
@EXACT
@pytest.mark.parametrize("held", range(5), ids=MODEL.names)
def test_derivatives_of_the_brdf(held):
    """Derivatives agree with mpmath's differences of the equation, on the lobe's flank."""
    for parameters in SURFACES:
        alpha = parameters[0]
        theta_i, theta_r, phi = 0.7, 0.7 + 0.6 * alpha, np.pi - 0.5 * alpha
        numbers = [dr.opaque(Float64, value) for value in parameters]
        dr.enable_grad(numbers[held])
        dr.backward(MODEL.f(MODEL.surface(*numbers), direction(theta_i, phi), direction(theta_r)))
        at = [mpmath.mpf(value) for value in parameters]
        i, r = vector(mpmath.mpf(theta_i), mpmath.mpf(phi)), vector(mpmath.mpf(theta_r))
        exact = mpmath.diff(
            lambda x: printed.brdf(mpmath, i, r, *at[:held], x, *at[held + 1 :]), at[held]
        )
        if not (held == 3 and at[3] == 0):  # F is even in k
            assert dr.grad(numbers[held])[0] == pytest.approx(float(exact.real), rel=1e-8)
        else:
            assert dr.grad(numbers[held])[0] == 0


# ------------------------------------------------------------------ Drawing directions

LOBES = [(a, g) for a in (1e-4, 0.01, 0.3, 1) for g in (0.5, 1, 2, 4)]


@pytest.mark.parametrize("theta_deg", [0, 50, 80])
def test_drawn_directions_follow_the_density(theta_deg):
    """The moments of 20,000 drawn directions above the surface, to five standard errors."""
    S, rng = surface(0.5, 1.5, 2, 0, 0), np.random.default_rng(9)
    r = direction(np.radians(theta_deg), 0.4)
    i = MODEL.sample_lobe(S, r, *(Float64(rng.random(20_000)) for _ in range(3))).numpy()
    x, weights = np.polynomial.legendre.leggauss(120)
    theta, phi = (side.ravel() for side in np.meshgrid(np.pi / 4 * (x + 1), np.pi * (x + 1)))
    weight = np.outer(np.pi * weights, np.pi / 4 * weights).ravel() * np.sin(theta)
    sources = direction(theta, phi)
    density = weight * MODEL.lobe_pdf(S, sources, r).numpy()
    for moment in (lambda w: np.ones_like(w[2]), lambda w: w[2], lambda w: w[0], lambda w: w[1]):
        drawn = np.where(i[2] > 0, moment(i), 0)
        error = 5 * drawn.std() / np.sqrt(drawn.size) + 1e-3
        assert drawn.mean() == pytest.approx(density @ moment(sources.numpy()), abs=error)


@pytest.mark.parametrize("theta_deg", [0, 30, 60, 85, 89.99])
def test_the_side_that_is_seen_has_its_share_exactly(theta_deg):
    """Of u3 in 0..1 the share max(0, r.m) / (max(0, r.m) + max(0, r.m')) gives the facet m.

    The rest gives its mirror image m' across the normal. Held to 1e-9 at 400 facets.
    """
    rng = np.random.default_rng(7)
    S = surface(0.5, 2, 2, 0, 0)
    r = direction(np.full(400, np.radians(theta_deg)), 0.4)
    u1, u2 = (Float64(rng.random(400)) for _ in range(2))

    def facet(u3):
        half = (MODEL.sample_lobe(S, r, u1, u2, Float64(u3)) + r).numpy()
        norm = np.sign(half[2]) * np.linalg.norm(half, axis=0)
        return half / norm

    first = facet(np.full(400, -2.0))  # below what u3 may be: never the image
    image = first * np.array([-1, -1, 1])[:, None]
    projected = [np.maximum(np.sum(r.numpy() * m, axis=0), 0) for m in (first, image)]
    share = projected[0] / sum(projected)
    for u3, side in ((share - 1e-9, first), (share + 1e-9, image)):
        possible = (u3 > 0) & (u3 < 1)
        assert possible.any()
        np.testing.assert_allclose(facet(u3)[:, possible], side[:, possible], atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("theta_deg", [0, 45, 80, 89.5])
@pytest.mark.parametrize("alpha, gamma", LOBES)
def test_normals_have_the_distribution_of_visible_ones(alpha, gamma, theta_deg):
    """Chi-square over 16 x 16 cells, 200,000 samples, at a significance of 1e-4 each.

    The cells hold equal numbers of normals in theta_m, by the distribution function of D cos, and
    equal ranges of azimuth relative to the observer. A side m of a V-shaped cavity is visible in
    the share max(0, v.m) / (max(0, v.m) + max(0, v.m')), where m' is the other side.
    """
    rng = np.random.default_rng(5)
    count, cells, theta = 200_000, 16, np.radians(theta_deg)
    # For a lobe as narrow as 1e-4, i + r has too few digits in Float32 to show the distribution.
    Type, Vector = (Float, Array3f) if alpha > 1e-3 else (Float64, Array3f64)
    S, r = surface(alpha, gamma, 2, 0, 0).cast(Type), direction(theta, 0.0, Vector)
    i = MODEL.sample_lobe(S, r, *(Type(Float(rng.random(count))) for _ in range(3)))
    half = (i + r).numpy().astype(float)
    half *= np.where(half[2] > 0, 1, -1)
    sin2 = (half[0] ** 2 + half[1] ** 2) / np.sum(half**2, axis=0)

    def share_within(sin2):
        log = np.log1p((1 - alpha**2) / alpha**2 * sin2) if alpha < 1 else None
        if alpha == 1:
            return sin2
        if gamma == 1:
            return log / -np.log(alpha**2)
        return np.expm1((1 - gamma) * log) / np.expm1((gamma - 1) * np.log(alpha**2))

    place = [share_within(sin2), np.arctan2(half[1], half[0]) / (2 * np.pi) % 1]
    index = [np.clip((x * cells).astype(int), 0, cells - 1) for x in place]
    computed = np.bincount(index[0] * cells + index[1], minlength=cells**2)

    fine = 60
    share = (np.arange(cells * fine) + 0.5) / (cells * fine)
    tan2 = np.interp(share, share_within(t := np.geomspace(1e-18, 1, 400_000)), t)
    phi = 2 * np.pi * share
    k = np.tan(theta) * np.sqrt(tan2 / np.maximum(1 - tan2, 1e-12))[:, None] * np.cos(phi)
    sides = np.maximum(1 + k, 0), np.maximum(1 - k, 0)
    expected = (sides[0] / (sides[0] + sides[1])).reshape(cells, fine, cells, fine)
    expected = expected.mean(axis=(1, 3)).ravel() * 2 * count / cells**2
    assert expected.sum() == pytest.approx(count, rel=1e-3)
    large = expected >= 10
    statistic = np.sum((computed[large] - expected[large]) ** 2 / expected[large])
    assert statistic < chi2.ppf(1 - 1e-4, large.sum() - 1)
    assert computed[~large].sum() <= expected[~large].sum() + 5 * np.sqrt(
        expected[~large].sum() + 1
    )


@pytest.mark.slow
@pytest.mark.parametrize("alpha, gamma", LOBES)
def test_weights_are_bounded_and_average_to_the_reflectance(alpha, gamma):
    """The weights f cos / pdf = F G / G_1 are at most 1, and their mean is HDR."""
    rng = np.random.default_rng(6)
    count = 1 << 16
    u = [Float(rng.random(count)) for _ in range(3)]
    S = surface(alpha, gamma, 3, 5, 0)
    for theta in np.radians([0, 45, 80, 89]):
        r = direction(theta, 0.4, Array3f)
        i = MODEL.sample_lobe(S.cast(Float), r, *u)
        pdf = MODEL.lobe_pdf(S.cast(Float), i, r)
        weight = dr.select(i.z > 0, MODEL.f(S.cast(Float), i, r) * i.z / pdf, 0).numpy()
        weight = weight.astype(float)
        error = weight.std() / np.sqrt(count)
        assert weight.min() >= 0 and weight.max() <= 1 + 1e-5
        HDR = MODEL.HDR(S, Float64(theta))[0]
        assert abs(weight.mean() - HDR) < 5 * error + 2e-5


# ------------------------------------------------------------------ Remarks


def lost_at_normal_incidence(alpha):
    """For gamma = 2: 1 - int D cos min(1, 2 cos 2 theta) domega, over facets up to 45 degrees."""

    def kept(theta):
        sin2 = np.sin(theta) ** 2
        D = alpha**2 / (np.pi * (alpha**2 * (1 - sin2) + sin2) ** 2)
        G = min(1, 2 * np.cos(2 * theta))
        return 2 * np.pi * np.sin(theta) * np.cos(theta) * D * G

    return 1 - quad(kept, 0, np.pi / 4, points=[np.pi / 6, alpha / 2, alpha], epsabs=1e-10)[0]


def test_remark_on_what_is_lost_between_facets():
    for alpha in (0.5, 0.3):
        (remark,) = MODEL.remarks(alpha, 2, 1.5, 0, 0.4)
        assert remark.startswith(f"{lost_at_normal_incidence(alpha):.0%} of the radiation that")
    # 5 % are lost at alpha = 0.1727
    assert lost_at_normal_incidence(0.170) < 0.05 < lost_at_normal_incidence(0.175)
    assert MODEL.remarks(0.170, 2, 1.5, 0, 0.4) == [] != MODEL.remarks(0.175, 2, 1.5, 0, 0.4)
    assert MODEL.remarks(0.5, 2, 1, 0, 0.4) == []  # facets of n = 1 reflect nothing


def test_scale_of_the_lobe():
    """Fresnel reflectance at p = (cos + sqrt(cos^2 + t^2 sin^2)) / 2, t = alpha + mean sin^2."""
    alpha, n, k = 0.4, 3.0, 5.0

    def weight(theta, power):
        sin2 = np.sin(theta) ** 2
        D = alpha**2 / (np.pi * (alpha**2 * (1 - sin2) + sin2) ** 2)
        return 2 * np.pi * np.sin(theta) * np.cos(theta) * D * sin2**power

    t = alpha + quad(weight, 0, np.pi / 2, args=(1,), epsabs=1e-12)[0]
    for degrees in (0, 50, 85):
        cos, sin = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
        p = (cos + np.sqrt(cos**2 + t**2 * sin**2)) / 2
        index = n + 1j * k
        inside = np.sqrt(1 - (1 - p**2) / index**2)
        s = abs((p - index * inside) / (p + index * inside)) ** 2
        pp = abs((index * p - inside) / (index * p + inside)) ** 2
        scale = MODEL.lobe_scale(surface(alpha, 2, n, k, 0), Float64(cos), Float64(sin**2))
        assert scale[0] == pytest.approx((s + pp) / 2, rel=1e-9)


# Bounds and cube of the microfacet model
# ---------------------------------------


@pytest.mark.parametrize(
    "change, words",
    [
        ({0: 0.0}, ("alpha = 0; ", "0.0001..1")),
        ({0: 1.5}, ("alpha = 1.5; ", "0.0001..1")),
        ({1: 0.4}, ("gamma = 0.4; ", "0.5..4")),
        ({2: 0.9}, ("n = 0.9; ", "1..50")),
        ({3: -0.1}, ("k = -0.1; ", "0..100")),
        ({4: 1.1}, ("rho_d = 1.1; ", "0..1")),
        ({4: float("nan")}, ("rho_d = nan; ", "0..1")),
    ],
)
def test_infeasible_parameters_are_named_with_value_and_bound(change, words):
    values = [change.get(number, value) for number, value in enumerate((0.1, 2, 1.5, 0, 0.5))]
    with pytest.raises(InputError) as error:
        MODEL.check_feasible(*values)
    assert all(word in str(error.value) for word in words) and "\n" not in str(error.value)


def test_the_bounds_themselves_are_feasible_also_in_float32():
    for values in zip(*((p.lower, p.upper) for p in MODEL.parameters)):
        MODEL.check_feasible(*values)
        MODEL.check_feasible(*(float(np.float32(value)) for value in values))


def test_cube():
    """`from_cube` inverts `to_cube`, faces are bounds, and restrictions match their names."""
    u = np.random.default_rng(0).random((50, 5))
    values = np.array([MODEL.values_at(row) for row in u])
    np.testing.assert_allclose(MODEL.to_cube(values), u, atol=1e-12)
    lower, upper = MODEL.feasible_range(values[0])
    np.testing.assert_allclose(MODEL.values_at(np.zeros(5)), lower, rtol=1e-12, atol=1e-11)
    np.testing.assert_allclose(MODEL.values_at(np.ones(5)), upper, rtol=1e-12)
    assert MODEL.bound_names(np.array([0, 1, 0.5, 0, 1])) == ["0.0001", "4", None, "0", "1"]
    for restriction in MODEL.restrictions:
        held = u[0].copy()
        held[restriction.coordinate] = restriction.value
        name, value = restriction.name.split(" = ")
        assert MODEL.values_at(held)[MODEL.names.index(name)] == pytest.approx(
            float(value), abs=1e-11
        )


def test_k_0_is_no_stationary_face():
    """F depends on k^2. Its derivative along the cube's coordinate is not 0 at k = 0."""
    u = [dr.opaque(Float64, x) for x in (0.5, 0.5, 0.1, 0.0, 0.5)]
    dr.enable_grad(u[3])
    dr.backward(MODEL.f(MODEL.surface(*MODEL.from_cube(u)), direction(0.5, np.pi), direction(0.5)))
    assert abs(dr.grad(u[3])[0]) > 1e-3


def test_coordinates():
    """Logarithms of alpha, gamma and n; u of k by k^2 = 0.01 (exp(L u) - 1); rho_d itself."""
    L = np.log(100**2 / 0.01 + 1)
    u = np.array([0.25, 0.5, 0.75, 0.4, 0.3])
    expected = (
        1e-4**0.75,
        np.sqrt(0.5 * 4),
        50**0.75,
        np.sqrt(0.01 * (np.exp(0.4 * L) - 1)),
        0.3,
    )
    assert MODEL.values_at(u) == pytest.approx(expected, rel=1e-9)
    outside = MODEL.to_cube([[0, 9, 0.5, -1, 2], [2, 0.1, 99, 200, -1]])
    assert outside.tolist() == [[0, 1, 0, pytest.approx(0, abs=0.2), 1], [1, 0, 1, 1, 0]]


def test_starting_points():
    """Log-uniform over the ranges of real surfaces; half of k over 0.001..1, half over 1..50."""
    points = MODEL.starting_points(4000, seed=1)
    assert points.shape == (4000, 5) and np.all((points >= 0) & (points <= 1))
    np.testing.assert_array_equal(points, MODEL.starting_points(4000, seed=1))
    values = np.array([MODEL.values_at(row) for row in points])
    for row in values[:20]:
        MODEL.check_feasible(*row)
    alpha, gamma, n, k, rho_d = values.T
    for column, low, high in (
        (alpha, 1e-3, 1),
        (gamma, 0.7, 3),
        (n, 1.2, 12),
        (k[k < 1], 1e-3, 1),
        (k[k > 1], 1, 50),
        (rho_d, 1e-4, 1),
    ):
        # Of a Latin hypercube, each of n equal cells of the logarithm holds one value
        assert column.min() == pytest.approx(low, rel=0.01)
        assert column.max() == pytest.approx(high, rel=0.01)
        assert np.median(column) == pytest.approx(np.sqrt(low * high), rel=0.01)
    assert np.mean(k < 1) == 0.5
    assert abs(np.corrcoef(points.T) - np.eye(5)).max() < 0.08

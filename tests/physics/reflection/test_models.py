"""Tests that every registered reflection model must pass.

They check its cube, bounds, derivatives, integrals and reciprocity. A new model is tested
automatically.
"""

from itertools import product

import numpy as np
import pytest
from drjit.llvm.ad import Array3f64, Float64

from mi_lcair.errors import InputError
from mi_lcair.fitting.model import Hemispherical, Scatterometer, parameters_at
from mi_lcair.physics.reflection.models import MODELS

FORMS = [(model, form) for model in MODELS.values() for form in model.forms]
every_model = pytest.mark.parametrize("model", MODELS.values(), ids=MODELS)
every_form = pytest.mark.parametrize(
    "model, form", FORMS, ids=[f"{model.name}-{form}" for model, form in FORMS]
)


def random_points(model, count=40):
    """Random coordinates inside the cube."""
    return np.random.default_rng(1).uniform(0.01, 0.99, (count, len(model.parameters)))


def face_points(model):
    """One point on each face of the cube, and all corners."""
    size = len(model.parameters)
    faces = np.repeat(random_points(model, size), 2, axis=0)
    faces[np.arange(2 * size), np.arange(2 * size) // 2] = np.arange(2 * size) % 2
    return np.vstack([faces, list(product((0.0, 1.0), repeat=size))])


def directions(theta, phi):
    sin, cos = np.sin(theta), np.cos(theta)
    return Array3f64(Float64(sin * np.cos(phi)), Float64(sin * np.sin(phi)), Float64(cos))


# ------------------------------------------------------------------- the cube


@every_model
def test_parameters_are_described(model):
    assert MODELS[model.name] is model and model.title and model.forms
    assert len(set(model.names)) == len(model.names)
    for parameter in model.parameters:
        assert parameter.lower < parameter.upper and parameter.meaning and parameter.symbol
    for restriction in model.restrictions:
        assert restriction.coordinate in range(len(model.parameters))
        assert 0 <= restriction.value <= 1


@every_form
def test_every_point_of_the_cube_is_feasible(model, form):
    u = np.vstack([random_points(model), face_points(model)])
    values, _ = parameters_at(model, u)
    for row, coordinates in zip(values, u):
        model.check_feasible(*map(float, row), form=form)
        lower, upper = model.feasible_range(row)
        margin = 1e-9 * (upper - lower)
        assert np.all((row >= lower - margin) & (row <= upper + margin))
        np.testing.assert_allclose(model.values_at(coordinates), row, rtol=1e-12, atol=1e-15)


@every_model
def test_there_and_back(model):
    u = random_points(model)
    np.testing.assert_allclose(model.to_cube(parameters_at(model, u)[0]), u, rtol=1e-9)


@every_model
def test_parameters_outside_are_clipped_to_the_cube(model):
    for end in ("lower", "upper"):
        beyond = [2 * getattr(one, end) + (1 if end == "upper" else -1) for one in model.parameters]
        u = model.to_cube([beyond])
        assert np.all((u >= 0) & (u <= 1))


@every_model
def test_faces_of_the_cube_are_bounds(model):
    """On a face of the cube a parameter lies on a named bound; inside, none does."""
    for u in face_points(model):
        assert any(model.bound_names(u))
    for u in random_points(model):
        assert not any(model.bound_names(u))


@every_model
def test_derivatives_of_the_parameters(model):
    u, step = random_points(model, 6), 1e-6
    expected = np.stack(
        [
            (parameters_at(model, u + by)[0] - parameters_at(model, u - by)[0]) / (2 * step)
            for by in step * np.eye(u.shape[1])
        ],
        axis=-1,
    )
    slopes = parameters_at(model, u)[1]
    np.testing.assert_allclose(slopes, expected, rtol=1e-6, atol=1e-8 * np.abs(expected).max())
    assert np.all(np.isfinite(parameters_at(model, face_points(model))[1]))


@every_model
def test_the_nearest_feasible_point_keeps_what_is_held(model):
    rng = np.random.default_rng(2)
    lower, upper = np.array([(one.lower, one.upper) for one in model.parameters]).T
    for held in range(len(lower)):
        values = parameters_at(model, random_points(model, 1))[0][0]
        asked = values + rng.uniform(-1, 1, len(lower)) * (upper - lower)
        asked[held] = values[held]
        near = model.nearest_feasible(asked, held)
        model.check_feasible(*map(float, near), form=model.forms[0])
        assert near[held] == pytest.approx(values[held])


@every_model
def test_starts_are_inside_and_belong_to_their_seed(model):
    first, again, other = (model.starting_points(64, seed) for seed in (3, 3, 4))
    assert first.shape == (64, len(model.parameters))
    assert np.array_equal(first, again) and not np.array_equal(first, other)
    assert np.all((first > 0) & (first < 1))


@every_form
def test_numbers_that_no_surface_has_are_refused(model, form):
    good = [float(value) for value in parameters_at(model, random_points(model, 1))[0][0]]
    model.check_feasible(*good, form=form)
    for k, name in enumerate(model.names):
        for bad in (-1.0, np.nan):
            values = [*good[:k], bad, *good[k + 1 :]]
            with pytest.raises(InputError, match=f"{model.name}.*{name}"):
                model.check_feasible(*values, form=form)
    with pytest.raises(InputError, match="form 'phong'"):
        model.check_form("phong")


# ------------------------------------------------------------------- reflectance


@pytest.mark.slow
@every_form
def test_readings_and_their_derivatives_are_finite(model, form):
    """Readings and derivatives are finite in the cube and on its faces, up to grazing angles."""
    u = np.vstack([random_points(model), face_points(model)])
    angles = np.radians([0, 20, 45, 70, 85, 89.5])
    theta_i, theta_r = (one.ravel() for one in np.meshgrid(angles, np.append(angles, -angles)))
    readings = Scatterometer(model, form, theta_i, theta_r)
    integrals = [Hemispherical(model, form, angles, quantity) for quantity in ("emissivity", "dhr")]
    for instrument in (readings, *integrals):
        values, slopes = instrument(u)
        assert np.all(np.isfinite(values)) and np.all(np.isfinite(slopes))
    assert np.all(readings(u)[0] >= 0)


@pytest.mark.slow
@every_form
def test_derivatives_are_those_of_the_readings(model, form):
    u, step = random_points(model, 4), 1e-6
    theta_i, theta_r = np.radians([[10, 30, 60], [12, -20, 50]])
    for instrument in (
        Scatterometer(model, form, theta_i, theta_r),
        Hemispherical(model, form, theta_i, "emissivity"),
        Hemispherical(model, form, theta_i, "dhr"),
    ):
        expected = np.stack(
            [
                (instrument(u + by)[0] - instrument(u - by)[0]) / (2 * step)
                for by in step * np.eye(u.shape[1])
            ],
            axis=-1,
        )
        np.testing.assert_allclose(
            instrument(u)[1], expected, rtol=1e-4, atol=1e-6 * np.abs(expected).max()
        )


@pytest.mark.slow
@every_form
def test_reciprocity_is_as_claimed(model, form):
    rng = np.random.default_rng(3)
    a, b = (directions(np.arccos(rng.random(50)), rng.uniform(0, 6.28, 50)) for _ in range(2))
    asymmetry = []
    for values in parameters_at(model, random_points(model))[0]:
        S = model.surface_of(values, form)
        there, back = np.array(model.f(S, a, b)), np.array(model.f(S, b, a))
        asymmetry.append(np.max(np.abs(there - back) / np.maximum(there, back)))
    assert max(asymmetry) < 1e-10 if model.reciprocal else max(asymmetry) > 0.01


@every_form
def test_nothing_is_reflected_from_or_to_below(model, form):
    S = model.surface(*map(Float64, parameters_at(model, random_points(model, 1))[0][0]), form=form)
    above, below = directions(np.array([0.5]), np.array([0.0])), Array3f64(0.6, 0, -0.8)
    for pair in ((above, below), (below, above), (below, below)):
        assert np.array(model.f(S, *pair)).max() == 0


@pytest.mark.slow
@every_form
def test_hemispherical_reflectances_are_integrals_of_f(model, form):
    """HDR and DHR agree with a product rule over the hemisphere, for surfaces with broad lobes."""
    x, weights = np.polynomial.legendre.leggauss(160)
    theta, phi = (side.ravel() for side in np.meshgrid(np.pi / 4 * (x + 1), np.pi * (x + 1)))
    weight = np.outer(np.pi * weights, np.pi / 4 * weights).ravel() * np.cos(theta) * np.sin(theta)
    hemisphere, angles = directions(theta, phi), np.radians([5.0, 40.0, 70.0])
    checked = 0
    for values in parameters_at(model, random_points(model, 200))[0]:
        S = model.surface_of(values, form)
        if model.lobe_width(S)[0] < 0.2 or checked == 5:
            continue
        checked += 1
        HDR, DHR = (np.array(of(S, Float64(angles))) for of in (model.HDR, model.DHR))
        for k, angle in enumerate(angles):
            one = directions(np.full(len(theta), angle), np.zeros(len(theta)))
            f_to, f_from = (
                np.array(model.f(S, *pair)) for pair in ((hemisphere, one), (one, hemisphere))
            )
            assert HDR[k] == pytest.approx(np.sum(weight * f_to), rel=2e-4)
            assert DHR[k] == pytest.approx(np.sum(weight * f_from), rel=2e-4)
    assert checked == 5


@pytest.mark.slow
@every_form
def test_the_floor_and_the_lobe_make_up_HDR(model, form):
    theta = np.radians([0.0, 30.0, 60.0, 80.0])
    cos, sin2 = Float64(np.cos(theta)), Float64(np.sin(theta) ** 2)
    for values in parameters_at(model, random_points(model, 8))[0]:
        S = model.surface_of(values, form)
        lobe = model.lobe_HDR(S, Float64(theta)) * model.lobe_scale(S, cos, sin2)
        parts = np.array(model.floor_HDR(S, cos, sin2) + lobe)
        np.testing.assert_allclose(parts, np.array(model.HDR(S, Float64(theta))), rtol=1e-9)


@pytest.mark.slow
@every_form
def test_drawn_directions_have_their_density(model, form):
    """The share of samples in the upper part of the hemisphere is the integral of the density."""
    rng, r = np.random.default_rng(4), directions(np.array([0.6]), np.array([0.4]))
    x, weights = np.polynomial.legendre.leggauss(400)
    theta, phi = (side.ravel() for side in np.meshgrid(np.pi / 4 * (x + 1), np.pi * (x + 1)))
    weight = np.outer(np.pi * weights, np.pi / 4 * weights).ravel() * np.sin(theta)
    count, checked = 200_000, 0
    for values in parameters_at(model, random_points(model, 200))[0]:
        S = model.surface_of(values, form)
        if model.lobe_width(S)[0] < 0.2 or checked == 3:
            continue
        checked += 1
        i = model.sample_lobe(S, r, *(Float64(rng.random(count)) for _ in range(3)))
        z, x_drawn = np.array(i.z), np.array(i.x)
        density = np.array(model.lobe_pdf(S, directions(theta, phi), r))
        for drawn, inside in (
            (z > 0.5, np.cos(theta) > 0.5),
            ((z > 0) & (x_drawn < 0), np.sin(theta) * np.cos(phi) < 0),
        ):
            expected = np.sum(weight * density * inside)
            assert np.mean(drawn) == pytest.approx(expected, abs=0.006)
    assert checked == 3


@pytest.mark.slow
@every_form
def test_values_and_derivatives_agree_in_both_float_types(model, form):
    """A surface cast to Float32 has the same BRDF, to Float32's rounding."""
    from drjit.llvm.ad import Array3f, Float

    theta = np.radians([10.0, 40.0, 70.0])
    i, r = directions(theta, np.zeros(3)), directions(0.9 * theta, np.full(3, np.pi))
    for values in parameters_at(model, random_points(model, 8))[0]:
        S = model.surface_of(values, form)
        narrow = np.array(model.f(S.cast(Float), Array3f(i), Array3f(r)))
        np.testing.assert_allclose(narrow, np.array(model.f(S, i, r)), rtol=2e-3)

"""Which points are fitted, and with which standard deviations."""

from dataclasses import replace

import numpy as np
import pytest

from mi_lcair.errors import InputError
from mi_lcair.fitting.data import (
    SCALES,
    Cauchy,
    FittedVariant,
    Residuals,
    Variant,
    choose,
    criterion,
    select,
    variants,
    with_std,
)
from mi_lcair.fitting.scatterometer.reading import DirectionalData, Measurements
from tests.fitting.synthetic import MODEL

F = np.array([[1e-4, 0.02, 3.0], [2e-4, 0.5, 80.0]])  # two surfaces, three points
DF = np.arange(12.0).reshape(2, 3, 2) + 1
BRDF, SPREAD = np.array([2e-4, 0.03, 4.0]), np.array([0.1, 0.2, 0.5])
WHOLE = Variant(MODEL, "thesis")
SIMPLE = Variant(MODEL, "thesis", MODEL.restrictions[0])


def instrument(u):
    return F, DF


@pytest.mark.parametrize(
    ("scale", "function", "slope"),
    [
        ("log", np.log10, lambda f: 0.4342944819 / f),
        ("cube_root", lambda f: f ** (1 / 3), lambda f: f ** (-2 / 3) / 3),
        ("linear", lambda f: f, lambda f: 1 + 0 * f),
    ],
)
def test_residuals_on_each_scale(scale, function, slope):
    """(s(f) - s(measured)) / spread, and its derivative by the chain rule."""
    values, slopes = SCALES[scale](F)
    np.testing.assert_allclose(values, function(F))
    np.testing.assert_allclose(slopes, slope(F))
    residuals = Residuals(instrument, BRDF, scale, SPREAD)
    rows, derivatives = residuals(np.zeros((2, 2)))
    np.testing.assert_allclose(rows, (function(F) - function(BRDF)) / SPREAD)
    np.testing.assert_allclose(derivatives, DF * (slope(F) / SPREAD)[..., None])
    # A decade changes a point f by f ln 10 to first order
    decade = slope(BRDF) * BRDF * np.log(10) / SPREAD
    assert residuals.unit == pytest.approx(np.sqrt(np.mean(decade**2)))


def test_directional_tables_follow_the_points():
    values, slopes = np.array([[0.5, 0.6], [0.7, 0.8]]), np.ones((2, 2, 2))
    measured, std = np.array([0.4, 0.9]), np.array([0.1, 0.05])
    table = ((lambda u: (values, slopes)), measured, std)
    rows, derivatives = Residuals(instrument, BRDF, "log", SPREAD, [table])(np.zeros((2, 2)))
    assert rows.shape == (2, 5) and derivatives.shape == (2, 5, 2)
    np.testing.assert_allclose(rows[:, 3:], (values - measured) / std)
    np.testing.assert_allclose(derivatives[:, 3:], (1 / std)[None, :, None] * slopes)


@pytest.mark.parametrize("scale", SCALES)
def test_dark_points_stay_finite(scale):
    values, slopes = SCALES[scale](np.array([0.0, -1.0]))
    assert np.isfinite(values).all() and np.isfinite(slopes).all()


def test_cauchy_loss():
    """Half the square of a row is the loss c^2/2 log(1 + (r/c)^2), with its sign and derivative."""
    r, c = np.array([[-9.0, -1.0, 0.0, 1e-12, 0.5, 3.0]]), 2.0

    class Plain:
        unit = 7.0

        def __call__(self, u, lanes=None):
            return r + u, np.ones((1, 6, 1))

    robust = Cauchy(Plain(), c)
    rows, slopes = robust(np.zeros(1))
    np.testing.assert_allclose(rows**2 / 2, c**2 / 2 * np.log(1 + (r / c) ** 2), atol=1e-15)
    np.testing.assert_array_equal(np.sign(rows), np.sign(r))
    step = 1e-6
    ends = [robust(np.array([sign * step]))[0] for sign in (1, -1)]
    np.testing.assert_allclose(slopes[..., 0], (ends[0] - ends[1]) / (2 * step), rtol=1e-4)
    assert robust.unit == 7


def fitted(variant, cost):
    return FittedVariant(variant, None, np.zeros(4), cost, 0.0, 1.0)


def test_variants_of_a_model():
    """Whole ones first; restrictions only if the form is open."""
    found = variants(MODEL.name, "auto")
    whole = len(MODEL.forms)
    assert [variant.restriction for variant in found[:whole]] == [None] * whole
    assert len(found) == whole * (1 + len(MODEL.restrictions))
    assert variants(MODEL.name, "thesis") == [WHOLE]
    assert {variant.model.name for variant in variants("auto", "auto")} > {MODEL.name}
    with pytest.raises(InputError, match="form 'thesi' is unknown; .* has thesis"):
        variants(MODEL.name, "thesi")


def test_restricted_coordinates():
    restriction = MODEL.restrictions[0]
    assert WHOLE.free.all() and SIMPLE.whole == WHOLE
    assert SIMPLE.free.tolist() == [k != restriction.coordinate for k in range(4)]
    u = np.full((2, 4), 0.3)
    expected = u.copy()
    expected[:, restriction.coordinate] = restriction.value
    np.testing.assert_array_equal(SIMPLE.restrict(u), expected)
    np.testing.assert_array_equal(WHOLE.restrict(u), u)
    assert (fitted(WHOLE, 1.0).size, fitted(SIMPLE, 1.0).size) == (4, 3)


def test_bayesian_information_criterion():
    """n ln(sum of squares / rows) + k ln n."""
    assert criterion(fitted(WHOLE, 25.0), 100, 40.0) == pytest.approx(
        40 * np.log(0.5) + 4 * np.log(40)
    )
    assert criterion(fitted(SIMPLE, 0.0), 100, 40.0) == pytest.approx(
        40 * np.log(1e-24) + 3 * np.log(40)
    )


def test_the_simplest_that_is_not_worse():
    """Within 2 of the best the fewest parameters count, then the criterion."""
    candidates = [fitted(WHOLE, 1.0), fitted(SIMPLE, 1.0), replace(fitted(SIMPLE, 1.0), cost=2.0)]
    assert choose(candidates, [10.0, 12.0, 12.5]) == 1
    assert choose(candidates, [10.0, 12.1, 12.5]) == 0
    assert choose(candidates, [10.0, 11.9, 11.5]) == 2


def measurements(brdf, theta_i=0.3, theta_r=0.2, **more):
    brdf = np.asarray(brdf, dtype=float)
    full = lambda angle: np.broadcast_to(np.asarray(angle, float), brdf.shape)
    return Measurements(full(theta_i), full(theta_r), brdf, name="scan", **more)


def test_points_that_are_left_out():
    """Not a number, beyond 80 degrees, not above the limit; the reasons are counted."""
    data, used, dropped = select(
        measurements(
            [1.0, np.nan, 2.0, 3.0, 1e-4, 4.0],
            theta_r=np.radians([80, 0, -80.1, 0, 0, 0]),
            theta_i=np.radians([10, 10, 10, 80.1, 10, np.nan]),
        ),
        *("log", 0.0, 80, 1e-4, 1),
    )
    assert used.tolist() == [True, False, False, False, False, False]
    assert dropped == {
        "not a number": 2,
        "theta_i or theta_r beyond 80 degrees": 2,
        "brdf not above 0.0001 1/sr": 1,
    }
    assert data.points == data.rows == 1 and data.spread.tolist() == [1]


def test_a_saturated_detector():
    """Three points or more at the largest value, if they are less than a fifth."""
    for count, total, dropped in ((3, 16, 3), (2, 16, 0), (3, 15, 0)):
        brdf = np.append(np.linspace(0.1, 0.9, total - count), np.full(count, 2.0))
        data, _, reasons = select(measurements(brdf), "log", 0.0, 80, 0, 1)
        assert data.points == total - dropped
        assert reasons.get("at one largest value, as if the detector saturated", 0) == dropped


def test_standard_deviations_on_the_scale():
    """sigma / (f ln 10), at least 1 % of f."""
    brdf, sigma = np.array([2.0, 4.0, 8.0]), np.array([0.2, 0.001, np.nan])
    data, _, _ = select(measurements(brdf, sigma=sigma), "log", 0.0, 80, 0, 1)
    np.testing.assert_allclose(data.spread, [0.1 / np.log(10), *2 * [0.01 / np.log(10)]])
    assert data.has_sigma
    cube, _, _ = select(measurements(brdf, sigma=sigma), "cube_root", 0.0, 80, 0, 1)
    np.testing.assert_allclose(cube.spread[0], 0.2 * 2 ** (-2 / 3) / 3)
    # A decade of every BRDF, to first order f ln 10, in standard deviations
    np.testing.assert_allclose(data.per_decade(2 * brdf), 1 / data.spread)
    table = DirectionalData(np.zeros(2), np.full(2, 0.5), np.full(2, 0.1))
    joint = data.jointly(4.0, [table])
    np.testing.assert_allclose(joint.spread, 2 * data.spread)
    assert joint.rows == 5 and joint.per_decade(brdf)[3:].tolist() == [0, 0]
    assert joint.with_std_factor(3.0).std_factor == 3 and joint.std_factor == 1


def test_a_source_taken_as_a_point():
    data, _, _ = select(measurements([1.0, 2.0]), "log", 0.02, 80, 0, 1)
    variant = Variant(MODEL, "thesis")
    assert data.residuals(variant).instrument.disc.half_angle == 0.02
    assert data.residuals(variant, aperture=False).instrument.disc is None


def test_too_few_points():
    select(measurements([1.0, 2.0, 3.0]), "log", 0.0, 80, 0, 3)
    with pytest.raises(InputError, match="scan: 3 points to fit, fewer than the 4 parameters$"):
        select(measurements([1.0, 2.0, 3.0]), "log", 0.0, 80, 0, 4)
    with pytest.raises(InputError, match="2 points .* 4 parameters; 1 dropped: not a number"):
        select(measurements([1.0, 2.0, np.nan]), "log", 0.0, 80, 0, 4)


def test_tables_of_emissivities():
    """A standard deviation of 0.02 if none is stated, and 0.002 at least."""
    table = DirectionalData(np.array([0.0, 1.5]), np.array([0.0, 1.0]))
    assert with_std(table, "dhr").std.tolist() == [0.02, 0.02]
    assert with_std(table, "dhr").quantity == "dhr"
    table.std = np.array([0.001, 0.003])
    assert with_std(table, "emissivity").std.tolist() == [0.002, 0.003]
    for theta, value in ((0.5, 1.01), (0.5, -0.01), (np.pi / 2, 0.5), (-0.1, 0.5)):
        message = "dhr: (value = .* in 0..1|angle .degrees. = .* in 0..90, 90 excluded)"
        with pytest.raises(InputError, match=message):
            with_std(DirectionalData(np.array([theta]), np.array([value])), "dhr")

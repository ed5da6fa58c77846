"""Predicted readings against plain NumPy, and their derivatives against differences."""

import drjit as dr
import numpy as np
import pytest
from drjit.llvm.ad import Float64, UInt32

from mi_lcair.fitting.model import (
    INCIDENCES,
    MOST_SCANS,
    POINTS,
    RULES,
    Disc,
    Hemispherical,
    Scatterometer,
    graded,
    panel,
    parameters_at,
    predicted,
    scans_of,
    with_tangents,
)
from mi_lcair.physics.reflection.interface import unit_rule
from tests.fitting import numpy_model
from tests.fitting.results import fit_of, measurements
from tests.fitting.synthetic import MODEL, ROUGH, THESIS_SETS, disc_average

FORMS = ("thesis", "normalized")
SURFACES = np.array([*THESIS_SETS.values(), ROUGH, (0.05, 0.4, 0.9, 0.7)])
THETA_I, THETA_R = (
    np.radians([0, 20, 20, 20, 60, 60, 75]),
    np.radians([0.5, 20, 23, -60, 60, 10, 74]),
)


def test_a_coordinate_that_is_a_result_and_enters_another_keeps_its_derivative():
    u = np.array([[0.3, 0.4]])
    values, slopes = with_tangents(lambda a, b: (a, (1 - a) * b), u)
    np.testing.assert_allclose(values, [[0.3, 0.28]])
    np.testing.assert_allclose(slopes, [[[1, 0], [-0.4, 0.7]]])


def test_one_result_in_more_lanes():
    """Coordinates that are spread over lanes: a^2 b for each of two sets, twice."""
    u = np.array([[0.3, 0.4], [0.5, 0.6]])
    spread = lambda coordinate: dr.gather(Float64, coordinate, UInt32([0, 0, 1, 1]))
    values, slopes = with_tangents(lambda a, b: a * a * b, u, spread)
    np.testing.assert_allclose(values, [0.036, 0.036, 0.15, 0.15])
    np.testing.assert_allclose(slopes, [[0.24, 0.09]] * 2 + [[0.6, 0.25]] * 2)


def test_parameters_and_their_derivatives():
    """Against differences of the model's own values."""
    u, step = np.array([[0.3, 0.4, 0.6, 0.5], [0.7, 0.2, 0.1, 0.9]]), 1e-6
    values, slopes = parameters_at(MODEL, u)
    for k in (0, 1):
        np.testing.assert_allclose(values[k], MODEL.values_at(u[k]), rtol=1e-12)
        ends = [
            np.array([MODEL.values_at(u[k] + sign * step * axis) for axis in np.eye(4)])
            for sign in (1, -1)
        ]
        np.testing.assert_allclose(slopes[k], (ends[0] - ends[1]).T / (2 * step), atol=1e-6)
    np.testing.assert_allclose(parameters_at(MODEL, u[0])[0], values[:1])


def test_gauss_nodes():
    """n nodes on 0..1 integrate x^(2n - 1) exactly, and not x^(2n)."""
    x, weights = unit_rule(3)
    for power, exact in ((0, True), (5, True), (6, False)):
        assert np.isclose(weights @ x**power, 1 / (power + 1), rtol=1e-12) is np.bool_(exact)


@pytest.mark.parametrize("counts", [(9, 7), (5, 3), (3, 2)])
def test_a_panel_is_the_unit_square(counts):
    t, s, weight = panel(*counts)
    assert len(t) == counts[0] * counts[1]
    assert weight.sum() == pytest.approx(1) and weight @ (t * s) == pytest.approx(0.25)
    assert weight @ t**2 == pytest.approx(1 / 3, rel=1e-3)
    if counts[0] > 3:  # denser at the rim: a square root is integrated well
        assert weight @ np.sqrt(1 - t) == pytest.approx(2 / 3, rel=1e-4)


def test_grading():
    """From 0 to the length, fine at 0, with its derivative."""
    from drjit.llvm.ad import Float64

    length, width = 3.0, 0.1
    x, slope = graded(Float64([0.0, 0.5, 1.0]), Float64(length), Float64(width))
    end = np.arcsinh(length / width)
    np.testing.assert_allclose(x.numpy(), width * np.sinh(end * np.array([0, 0.5, 1])))
    assert x.numpy()[2] == pytest.approx(length)
    step = 1e-6
    ends = [
        graded(Float64([0.5 + d]), Float64(length), Float64(width))[0][0] for d in (step, -step)
    ]
    assert slope.numpy()[1] == pytest.approx((ends[0] - ends[1]) / (2 * step), rel=1e-6)


def test_nodes_of_points():
    """Near the mirror direction both panels with many nodes; far away one with few."""
    half_angle = 0.01
    sizes = [2 * 9 * 7, 9 * 7, 5 * 3, 3 * 2]  # each panel inside, one panel beyond the rim
    offsets = half_angle * np.array([0.5, 3.9, -11.9, 12.1])
    disc = Disc(np.full(4, 0.5), 0.5 + offsets, half_angle)
    assert np.bincount(disc.point).tolist() == sizes
    assert disc.first.tolist() == np.cumsum([0, *sizes[:-1]]).tolist()
    assert [reach for reach, _ in RULES] == [4, 12, np.inf]


def test_averages_of_points():
    """Sums of f w and of its derivatives, divided by the sums of w."""
    disc = Disc(np.full(2, 0.5), np.array([0.7, 0.8]), 0.01)
    count = len(disc.point)
    random = np.random.default_rng(0)
    f, w, df = random.random((3, 1, count))
    mean, slope = disc.average(np.stack([f * w, w], axis=-1), (df * w)[..., None])
    for k in (0, 1):
        own = disc.point == k
        total = w[0, own].sum()
        assert mean[0, k] == pytest.approx((f * w)[0, own].sum() / total)
        assert slope[0, k, 0] == pytest.approx((df * w)[0, own].sum() / total)


def test_directions_over_a_wide_disc():
    """A disc of 17 degrees, so that solid angles show: means against a sum over small cells."""
    from drjit.llvm.ad import Float64, UInt32

    theta_i, R = 0.6, 0.3
    disc = Disc(np.array([theta_i]), np.array([0.7]), R)
    node = UInt32(np.arange(len(disc.point)))
    angles = Float64(theta_i), Float64(0.7)
    at, weight = disc.direction(*angles, Float64(0.1), node)
    x, y, z, weight = *at.numpy(), weight.numpy()

    side = (np.arange(800) + 0.5) / 400 - 1
    a, b = (R * grid.ravel() for grid in np.meshgrid(side, side))
    a, b = a[np.hypot(a, b) < R], b[np.hypot(a, b) < R]
    X, Y, Z = np.sin(theta_i + a) * np.cos(b), np.sin(b), np.cos(theta_i + a) * np.cos(b)
    cells = np.cos(b) * Z
    for f in (lambda x, y, z: x, lambda x, y, z: y**2, lambda x, y, z: z**3):
        expected = np.average(f(X, Y, Z), weights=cells)
        assert np.average(f(x, y, z), weights=weight) == pytest.approx(expected, rel=1e-3)


def test_a_broad_lobe_and_a_narrow_one():
    """The average over the disc, weighted by the cosine."""
    half_angle = np.radians(0.909)
    theta_i = np.radians([20.0, 20, 55])
    theta_r = theta_i + np.radians([0.0, 0.85, -3])
    for e in (0.0042, 0.25):
        surface = (0.11, 0.02, 0.05, e)
        f, _ = Scatterometer(MODEL, "thesis", theta_i, theta_r, half_angle)(
            MODEL.to_cube([surface])
        )
        expected = disc_average(theta_i, theta_r, surface, half_angle, cells=301)
        np.testing.assert_allclose(f[0], expected, rtol=6e-3)


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


# Curves and points of a fit, which pictures and pages draw
# ---------------------------------------------------------


def test_each_point_stands_in_the_scan_of_its_incidence():
    data = measurements(theta_i=(20, 50))
    fit = fit_of(data)
    swept, fixed, scans = scans_of(fit, data)
    assert (swept, fixed) == ("theta_r", "theta_i")
    assert [scan.setting for scan in scans] == pytest.approx([20, 50])
    for scan in scans:
        angles = np.concatenate([scan.fitted[0], scan.left_out[0]])
        assert sorted(angles) == pytest.approx(np.arange(-80, 86, 5))
        assert scan.left_out[0] == pytest.approx([85])  # beyond 80 degrees
        expected = 0.01 + np.exp(-np.abs(scan.fitted[0] - scan.setting))
        assert scan.fitted[1] == pytest.approx(expected)


def test_residuals_are_decades_from_the_fitted_curve():
    data = measurements(theta_i=(20,))
    fit = fit_of(data)
    (scan,) = scans_of(fit, data)[2]
    angles, curve = scan.curve
    assert (len(angles), angles[0], angles[-1]) == (POINTS, -80, 85)
    at_points = np.exp(np.interp(scan.fitted[0], angles, np.log(curve)))
    assert scan.residuals == pytest.approx(np.log10(scan.fitted[1] / at_points), abs=0.02)
    direct = predicted(fit, np.radians([20.0]), np.radians([30.0]))
    assert np.exp(np.interp(30.0, angles, np.log(curve))) == pytest.approx(direct[0], rel=0.01)


def test_the_angle_with_more_values_is_swept():
    data = measurements(theta_i=range(0, 81, 2), theta_r=(10, 40))
    swept, fixed, scans = scans_of(fit_of(data), data)
    assert (swept, fixed) == ("theta_i", "theta_r")
    assert [scan.setting for scan in scans] == pytest.approx([10, 40])


def test_of_many_scans_some_are_taken_evenly():
    data = measurements(theta_i=np.linspace(0, 60, 25), theta_r=range(-80, 86, 2))
    scans = scans_of(fit_of(data), data)[2]
    settings = [scan.setting for scan in scans]
    assert len(settings) == MOST_SCANS and settings[0] == 0 and settings[-1] == pytest.approx(60)
    assert np.ptp(np.diff(settings)) <= 2.5 + 1e-9


def test_points_that_are_not_positive_have_no_place():
    data = measurements(theta_i=(20,))
    data.brdf[:2] = 0, -1
    fit = fit_of(data)
    fit.used_points[:2] = False
    fit.brdf_interval = fit.brdf_interval[2:]
    (scan,) = scans_of(fit, data)[2]
    assert len(scan.left_out[0]) == 1 and len(scan.fitted[0]) + 1 == len(data.brdf) - 2


def test_without_measurements_there_are_curves_alone():
    fit = fit_of(measurements())
    _, _, scans = scans_of(fit)
    assert [scan.setting for scan in scans] == list(INCIDENCES)
    assert all(len(scan.fitted[0]) == 0 and (scan.curve[1] > 0).all() for scan in scans)

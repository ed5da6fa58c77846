"""Error bars against scipy and against repeated fits, also for correlated residuals."""

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from drjit.llvm.ad import Array3f64, Float64
from scipy import optimize, stats
from scipy.optimize import curve_fit

from mi_lcair import fitting
from mi_lcair.fitting.model import Scatterometer, parameters_at
from mi_lcair.fitting.scatterometer.reading import DirectionalData
from mi_lcair.fitting.uncertainty import LEVEL as IF_CALIBRATED
from mi_lcair.fitting.uncertainty import (
    Doubt,
    Linearized,
    neighbour,
    profile_intervals,
    standard_errors,
    verdict,
)
from mi_lcair.physics.reflection.models import MODELS
from tests.fitting.numpy_model import brdf
from tests.fitting.synthetic import (
    MODEL,
    NAMES,
    ROUGH,
    THESIS_SETS,
    disc_average,
    fit,
    relative_errors,
    scan,
    scan_of,
    without,
)

ALUMINUM = THESIS_SETS["bare aluminum MWIR"]


def test_standard_errors_and_correlation_are_those_of_scipy():
    data = scan(ROUGH, step=1)
    data = without(data, data.brdf < 0.12)  # so bright that no reading is left out
    data.sigma = np.full(data.brdf.size, 0.011 * np.max(data.brdf))
    data.brdf += data.sigma * np.random.default_rng(5).standard_normal(data.brdf.size)
    model = lambda angles, *parameters: brdf(*angles, *parameters)
    angles = data.theta_i, data.theta_r
    expected, covariance = curve_fit(model, angles, data.brdf, ROUGH, data.sigma, True)
    chi = np.sqrt(np.mean(((model(angles, *expected) - data.brdf) / data.sigma) ** 2))
    errors = np.sqrt(np.diag(covariance)) * max(chi, 1)
    result = fit(data, form="thesis", starts=4)
    np.testing.assert_allclose([result.parameters[name] for name in NAMES], expected, rtol=1e-5)
    np.testing.assert_allclose([result.standard_error[name] for name in NAMES], errors, rtol=0.02)
    np.testing.assert_allclose(result.correlation, covariance / np.outer(errors, errors), atol=0.02)


@pytest.mark.slow
def test_intervals_of_a_nearly_linear_problem_are_two_standard_errors_wide():
    result = fit(scan(ROUGH, step=1, noise=0.05, seed=5), form="thesis", starts=4)
    for name in NAMES:
        low, high = result.interval[name]
        # The factor is Student's t.
        assert (high - low) / 2 == pytest.approx(1.97 * result.standard_error[name], rel=0.05)


@pytest.mark.slow
def test_true_values_lie_inside_two_standard_errors():
    """About 95 % of 80 true values (20 repetitions, 4 parameters) lie inside two standard errors.

    A binomial distribution gives 69 or more with a probability of 99.9 %.
    """
    inside = 0
    for seed in range(20):
        result = fit(scan(ROUGH, step=4, noise=0.05, seed=seed), form="thesis", starts=2, seed=seed)
        assert verdicts(result, *NAMES) == ["determined"] * 4
        inside += sum(
            abs(result.parameters[name] - true) <= 2 * result.standard_error[name]
            for name, true in zip(NAMES, ROUGH)
        )
    assert 69 <= inside <= 79


U = np.array([0.3, 0.4, 0.6, 0.5])
SLOPES = np.random.default_rng(0).normal(size=(30, 4))
LEVEL = np.random.default_rng(1).normal(size=30)
NEAR = Linearized(MODEL, U, SLOPES, 0.25, LEVEL)


def jacobian(step=1e-6):
    """Derivatives of the parameters with respect to the coordinates."""
    ends = [parameters_at(MODEL, U + sign * step * np.eye(4))[0] for sign in (1, -1)]
    return ((ends[0] - ends[1]) / (2 * step)).T


def test_covariance_of_a_linearized_fit():
    """(J^T J / variance + 12)^-1 of the coordinates, carried to the parameters."""
    inverse, D = np.linalg.inv(SLOPES.T @ SLOPES / 0.25 + 12 * np.eye(4)), jacobian()
    np.testing.assert_allclose(NEAR.cube_covariance, inverse)
    np.testing.assert_allclose(NEAR.covariance(with_level=False), D @ inverse @ D.T, rtol=1e-5)
    shift = inverse @ (SLOPES.T @ LEVEL) / 0.25
    np.testing.assert_allclose(NEAR.shift, shift)
    both = inverse + np.outer(shift, shift)
    np.testing.assert_allclose(NEAR.covariance(), D @ both @ D.T, rtol=1e-5)
    np.testing.assert_allclose(NEAR.parameters, MODEL.values_at(U))


def test_shift_of_the_common_scale():
    """The larger change of either sign, within the cube."""
    expected = [
        np.abs(MODEL.values_at(np.clip(U + sign * NEAR.shift, 0, 1)) - MODEL.values_at(U))
        for sign in (1, -1)
    ]
    np.testing.assert_allclose(NEAR.level_shift(), np.max(expected, axis=0), rtol=1e-9)


def test_standard_errors_are_at_most_the_range():
    ranges = [parameter.upper - parameter.lower for parameter in MODEL.parameters]
    found = standard_errors(MODEL, np.diag([1e-4, 1e9, -1e-20, 0.04]))
    np.testing.assert_allclose(found, [0.01, ranges[1], 0, 0.2])


def test_start_of_a_profile():
    """The others follow as their covariance says, if that changes them by half at most."""
    best = np.array([0.3, 0.2, 0.4, 0.25])
    matrix = np.diag([1e-4] * 4)
    matrix[0, 1] = matrix[1, 0] = 5e-5
    matrix[0, 2] = matrix[2, 0] = -1.9e-4
    near = neighbour(MODEL, best, matrix, 0, 0.4)
    np.testing.assert_allclose(near, [0.4, 0.25, 0.21, 0.25])
    far = neighbour(MODEL, best, matrix, 0, 0.41)
    np.testing.assert_allclose(far, [0.41, 0.255, 0.4, 0.25])  # 0.209 is more than half of 0.4
    held = neighbour(MODEL, best, 0 * matrix, 0, 0.35)
    np.testing.assert_allclose(held, [0.35, 0.2, 0.4, 0.25])


class LinearInParameters:
    """Rows A (p - best), whose profiles are known; `unit` is the change for one decade."""

    unit = 50.0

    def __init__(self, A, best):
        self.A, self.best = A, best

    def __call__(self, u, lanes=None):
        values, slopes = parameters_at(MODEL, u)
        return (values - self.best) @ self.A.T, self.A @ slopes


@pytest.mark.parametrize("level, curvature", [(0.0, 0.8), (0.003, 0.8), (0.0, 0.02)])
def test_profiles_of_linear_rows(level, curvature):
    """t standard errors with the others refitted; the common scale is added in squares.

    The rise of the cost by variance t^2 / 2 is that of a parabola. With the smallest curvature the
    end lies between the minimum and the first point of the profile.
    """
    A = 200 * np.random.default_rng(3).normal(size=(40, 4))
    best = MODEL.values_at(U)
    rows = LinearInParameters(A, best)
    slopes = rows(U[None])[1][0]
    variance, dof = 0.5, 30
    near = Linearized(MODEL, U, slopes, variance, level * slopes.sum(axis=1))
    found = profile_intervals(near, rows, 0.0, curvature, dof)
    errors = np.sqrt(np.diag(np.linalg.inv(A.T @ A / (variance * curvature))))
    t = stats.t.ppf(0.975, dof)
    expected = np.hypot(t * errors, t * near.level_shift())
    np.testing.assert_allclose(best - found[:, 0], expected, rtol=5e-3)
    np.testing.assert_allclose(found[:, 1] - best, expected, rtol=5e-3)


@pytest.mark.parametrize("form", ["standard", "auto"])
def test_interval_of_an_absorption_at_its_bound(form):
    """The chi-square at its end, with the others refitted by SciPy, is t^2 larger.

    The BRDF depends on k^2, so that k has no standard error at 0. "auto" holds k there.
    """
    microfacet = MODELS["microfacet"]
    data = scan_of(microfacet, (0.2, 2.3, 1.6, 0.0, 0.1), step=4, noise=0.01, seed=1)
    fit = fitting.fit(data, model="microfacet", form=form, starts=4)
    assert fit.parameters["k"] == 0 and (fit.restriction is None) == (form == "standard")
    source, observer = (
        Array3f64(Float64(sign * np.sin(angle)), 0, Float64(np.cos(angle)))
        for sign, angle in ((1, data.theta_i), (-1, data.theta_r))
    )
    best, free = np.array([fit.parameters[name] for name in microfacet.names]), [0, 1, 2, 4]

    def rows(others):
        surface = microfacet.surface_of(np.insert(others, 3, fit.interval["k"][1]), "standard")
        return np.log10(np.array(microfacet.f(surface, source, observer)) / data.brdf)

    refitted = optimize.least_squares(rows, best[free], x_scale=0.01)
    rise = 2 * refitted.cost / (data.brdf.size * fit.rms_dex**2) - 1
    dof = data.brdf.size - 5
    assert np.sqrt(rise * dof) == pytest.approx(stats.t.ppf(0.975, dof), rel=0.15)


class CubicInParameters(LinearInParameters):
    """Rows A (x + c x^3) with x = p - best, and one row that does not change."""

    def __call__(self, u, lanes=None):
        values, slopes = parameters_at(MODEL, u)
        x = values - self.best
        inner = (1 + 3 * CUBIC * x**2)[..., None] * slopes
        rows = (x + CUBIC * x**3) @ self.A.T
        rows = np.concatenate([rows, np.full((len(u), 1), 5.0)], axis=1)
        return rows, np.concatenate([self.A @ inner, np.zeros((len(u), 1, 4))], axis=1)


CUBIC = 3e3


def test_profiles_of_curved_rows():
    """The end is where a (x + c x^3) = t, between the points of a profile."""
    A, best = np.diag([200.0, 300, 150, 250]), MODEL.values_at(U)
    rows = CubicInParameters(A, best)
    near = Linearized(MODEL, U, rows(U[None])[1][0], 1.0, np.zeros(5))
    found = profile_intervals(near, rows, 0.5 * 5.0**2, 1.0, 30)
    lower, upper = MODEL.feasible_range(best)
    for k, slope in enumerate(np.diag(A)):
        roots = np.roots([CUBIC, 0, 1, -stats.t.ppf(0.975, 30) / slope])
        expected = roots[np.isreal(roots)].real[0]
        ends = np.clip(best[k] + [-expected, expected], lower[k], upper[k])
        np.testing.assert_allclose(found[k] - best[k], ends - best[k], rtol=0.02)
        assert expected < 0.95 * stats.t.ppf(0.975, 30) / slope


def test_intervals_end_at_the_feasible_range():
    """Data that say nothing about the parameters."""
    best = MODEL.values_at(U)
    rows = LinearInParameters(1e-6 * np.eye(4), best)
    near = Linearized(MODEL, U, rows(U[None])[1][0], 1.0, np.zeros(4))
    found = profile_intervals(near, rows, 0.0, 1.0, 30)
    np.testing.assert_allclose(found.T, MODEL.feasible_range(best))


def test_a_parameter_that_is_held_can_move_when_others_are_judged():
    """Without k the data are described as well, with another n. The interval of n knows it."""
    true = (0.2, 2.5, 2.5, 1.0, 0.1)
    data = scan_of(MODELS["microfacet"], true, step=5, noise=0.05, seed=0)
    result = fitting.fit(data, model="microfacet", starts=4)
    assert result.restriction == "k = 0" and abs(result.parameters["n"] - 2.5) > 0.4
    assert inside(result, "n", 2.5) and result.standard_error["n"] > 0.2


@pytest.mark.slow
def test_an_interval_goes_round_a_bound():
    """Of a bright metal the data know the reflectance R, thus a circle in the plane of n and k.

    (n - 1)^2 + k^2 = R ((n + 1)^2 + k^2). The estimate ends at the largest n, where a smaller k
    needs a much smaller n.
    """
    microfacet, random = MODELS["microfacet"], np.random.default_rng((16, 20))
    first = random.uniform(10, 30)
    true = microfacet.values_at(microfacet.starting_points(24, seed=12)[16])
    data = scan_of(microfacet, true, incidence=(first, first + 20, first + 40))
    sigma = 0.02 * data.brdf
    data = replace(data, brdf=data.brdf + sigma * random.standard_normal(sigma.size), sigma=sigma)
    result = fitting.fit(data, model="microfacet", starts=6, seed=16, source_half_angle_deg=0)
    lossy = complex(true[2], true[3]), complex(result.parameters["n"], result.parameters["k"])
    R = [abs((index - 1) / (index + 1)) ** 2 for index in lossy]
    assert R[0] == pytest.approx(R[1], rel=2e-3) and result.parameters["n"] == 50
    assert inside(result, "k", true[3]) and not result.verdict["k"].startswith("determined")


def test_a_common_factor_of_all_readings():
    """Stated, it widens the interval of a level; not stated, the verdict says "if"."""
    data = scan(ROUGH, step=4, noise=0.02)
    data.brdf *= 1.06
    settings = {"form": "thesis", "starts": 2}
    unstated = fit(data, **settings)
    assert unstated.verdict["rho_d"] == "determined, if the level is calibrated"
    assert not inside(unstated, "rho_d", ROUGH[1])
    stated = fit(data, calibration="5 %", **settings)
    assert stated.settings["calibration"] == 0.05 and "calibrated" not in str(stated.verdict)
    assert inside(stated, "rho_d", ROUGH[1]) and inside(stated, "epsilon", ROUGH[0])
    assert stated.standard_error["rho_d"] == pytest.approx(0.05 * ROUGH[1] * 1.06, rel=0.3)
    assert stated.parameters == unstated.parameters
    of_data = fit(replace(data, calibration=0.05), **settings)
    assert of_data.interval == stated.interval


def inside(result, name, true):
    low, high = result.interval[name]
    return low <= true <= high


def verdicts(result, *names):
    return [re.split("[:;,]", result.verdict[name])[0] for name in names]


@pytest.mark.slow
def test_good_data_determine_everything():
    result = fit(scan(ROUGH, noise=0.05), starts=8)
    assert verdicts(result, *NAMES) == ["determined"] * 4


@pytest.mark.slow
def test_starts_far_away_are_brought_home():
    """The best minimum is found even if its lobe differs by a factor of 10 from most starts.

    The fit reports the share of starts that found it.
    """
    for parameters in (
        (0.1, 0.02, 0.05, 0.0008),
        (0.02, 0.9, 0.1, 0.9),
        (0.97, 0.0001, 0.02, 0.02),
    ):
        result = fit(scan(parameters), form="thesis", starts=32, seed=2)
        assert relative_errors(result, parameters).max() < 1e-6 and result.starts_in_basin > 0.5


def test_one_incidence_leaves_a_metals_emissivity_weak():
    result = fit(scan(ALUMINUM, incidence=(40,), noise=0.05), form="thesis", starts=8)
    assert verdicts(result, *NAMES) == [
        "weakly determined",
        "determined",
        "determined",
        "determined",
    ]
    assert "give it to the fit" in result.verdict["epsilon"] and inside(
        result, "epsilon", ALUMINUM[0]
    )


@pytest.mark.slow
def test_without_the_peak_emissivity_is_not_known():
    """Without points near the peak, epsilon is not determined.

    The detector blocks the source within 4 degrees. The wings of the lobe determine only a
    combination of epsilon and e.
    """
    data = scan(ALUMINUM, noise=0.05)
    result = fit(
        without(data, np.abs(data.theta_r - data.theta_i) < np.radians(4)), form="thesis", starts=8
    )
    assert "give it to the fit" in result.verdict["epsilon"]
    assert verdicts(result, "epsilon")[0] in (
        "at its bound 0",
        "weakly determined",
        "not determined by these data",
    )
    low, high = result.interval["epsilon"]
    assert (
        high - low > 0.2
        and inside(result, "epsilon", ALUMINUM[0])
        and inside(result, "e", ALUMINUM[3])
    )
    assert result.standard_error["epsilon"] > 0.1


@pytest.mark.slow
def test_a_measured_emissivity_replaces_the_peak():
    data = scan(ALUMINUM, noise=0.05)
    table = DirectionalData(
        np.radians([20.0, 40.0]), np.array([0.112, 0.114]), np.array([0.005, 0.005])
    )
    result = fit(
        without(data, np.abs(data.theta_r - data.theta_i) < np.radians(4)),
        emissivity=table,
        form="thesis",
        starts=4,
    )
    assert verdicts(result, "epsilon") == ["determined"] and inside(result, "epsilon", ALUMINUM[0])


@pytest.mark.slow
def test_a_saturated_peak_is_left_out_and_emissivity_is_weak():
    data = scan(ALUMINUM, noise=0.05)
    data.brdf = np.minimum(data.brdf, 50.0)
    result = fit(data, form="thesis", starts=8)
    assert result.dropped == {"at one largest value, as if the detector saturated": 19}
    assert verdicts(result, "epsilon") == ["weakly determined"] and inside(
        result, "epsilon", ALUMINUM[0]
    )
    assert inside(result, "e", ALUMINUM[3])


def test_a_flat_surface_is_not_saturated():
    """A perfectly diffuse surface has the same BRDF everywhere. No point is dropped."""
    data = scan(ROUGH, step=4)
    data.brdf[:] = 0.5 / np.pi
    result = fit(data, starts=8)
    assert (
        not result.dropped
        and result.restriction == "b = 0"
        and result.verdict["b"].startswith("at its bound 0")
    )
    assert result.parameters["rho_d"] == pytest.approx(0.5, abs=0.01)


def test_zeros_and_negative_values_are_dropped_and_do_no_harm():
    data = scan(ROUGH, noise=0.05)
    spoilt = np.random.default_rng(3).choice(len(data.brdf), 60, replace=False)
    data.brdf[spoilt[:30]], data.brdf[spoilt[30:]] = 0, -data.brdf[spoilt[30:]]
    result = fit(data, form="thesis", starts=8)
    assert result.dropped == {"brdf not above 0.0001 1/sr": 60}
    assert verdicts(result, *NAMES) == ["determined"] * 4


def with_outliers():
    data = scan(ROUGH, noise=0.05)
    data.brdf[
        np.random.default_rng(3).choice(len(data.brdf), len(data.brdf) // 10, replace=False)
    ] *= 10
    return data


def test_outliers_are_named_and_take_determined_away():
    result = fit(with_outliers(), form="thesis", starts=8)
    for name in NAMES:
        assert (
            result.verdict[name].startswith("weakly determined")
            and "outliers; try robust=True" in result.verdict[name]
        )


@pytest.mark.slow
def test_robust_makes_outliers_harmless():
    result = fit(with_outliers(), form="thesis", starts=8, robust=True)
    assert verdicts(result, *NAMES) == ["determined"] * 4 and result.outliers == pytest.approx(
        96, abs=3
    )
    for name, true in zip(NAMES, ROUGH):
        assert abs(result.parameters[name] - true) < 3 * result.standard_error[name]


@pytest.mark.slow
def test_robust_costs_little_on_clean_data():
    """The Cauchy loss is 95 % efficient: error bars grow by 2.6 % only."""
    data = scan(ROUGH, noise=0.05)
    plain, robust = (fit(data, form="thesis", starts=4, robust=robust) for robust in (False, True))
    ratio = np.array([robust.standard_error[name] / plain.standard_error[name] for name in NAMES])
    np.testing.assert_allclose(ratio, 1.026, atol=0.06)


@pytest.mark.slow
def test_twenty_points():
    """20 points determine the rough surface, and floor and lobe of the metal.

    For the metal's emissivity and b they give intervals only.
    """
    chosen = np.ones(len(scan(ROUGH).brdf), bool)
    chosen[np.random.default_rng(0).choice(len(chosen), 20, replace=False)] = False
    rough, metal = (
        fit(without(scan(surface, noise=0.05), chosen), form="thesis", starts=8)
        for surface in (ROUGH, ALUMINUM)
    )
    assert rough.used == metal.used == 20
    for name, true in zip(NAMES, ROUGH):
        assert inside(rough, name, true)
    assert (
        "weakly determined" in metal.verdict["epsilon"]
        or "not determined" in metal.verdict["epsilon"]
    )
    assert "give it to the fit" in metal.verdict["epsilon"] and inside(
        metal, "epsilon", ALUMINUM[0]
    )


@pytest.mark.slow
def test_a_lobe_far_below_the_instruments_resolution():
    """The fit of a lobe much narrower than the source gives an upper limit of e.

    The lobe is weak, the floor is strong, and the source has an angular radius of 0.9 degrees. No
    grid of cells resolves this lobe. The data are therefore computed with the fit's own average
    over the source, which has its own test.
    """
    surface, half_angle = (0.1, 0.6, 0.3, 5e-5), np.radians(0.909)
    data = scan(surface, step=2)
    instrument = Scatterometer(MODEL, "thesis", data.theta_i, data.theta_r, half_angle)
    data.brdf = instrument(MODEL.to_cube([surface]))[0][0]
    data.brdf *= 1 + 0.05 * np.random.default_rng(0).standard_normal(len(data.brdf))
    data.source_half_angle = half_angle
    result = fit(data, form="thesis", starts=8)
    assert result.verdict["e"].startswith("not determined by these data: any lobe narrower than")
    assert result.interval["e"][1] < 0.01 and inside(result, "e", surface[3])
    assert verdicts(result, "rho_d") == ["determined"]


@pytest.mark.slow
def test_a_peak_as_wide_as_the_source_is_deconvolved():
    """With the size of the source, the fit finds e.

    With a point source, its e is too large by a third.
    """
    half_angle = np.radians(0.909)
    data = scan(ALUMINUM, incidence=(30,), step=1)
    data.brdf = disc_average(data.theta_i, data.theta_r, ALUMINUM, half_angle, cells=301)
    data.source_half_angle = half_angle
    result = fit(data, form="thesis", starts=8)
    assert result.parameters["e"] == pytest.approx(ALUMINUM[3], rel=0.01)
    assert (
        fit(data, form="thesis", starts=8, source_half_angle_deg=0).parameters["e"]
        > 1.2 * ALUMINUM[3]
    )


@pytest.mark.slow
def test_a_material_that_the_model_misses():
    """For data with ripples and a Gaussian lobe, the fit calls no parameter determined. At b = 0
    both forms are the same, and rounding decides whether b is at its bound or beside it.
    """
    data = scan(ROUGH, noise=0.05)
    data.brdf = 0.3 * np.exp(-(((data.theta_r - data.theta_i) / 0.3) ** 2)) + 0.01 * (
        1 + 0.8 * np.sin(8 * data.theta_r)
    )
    result = fit(data, starts=8)
    words = result.verdict.values()
    assert all(
        word.startswith(("not determined by these data: ", "at its bound")) for word in words
    )
    assert sum("the model misses the measured values by about" in word for word in words) >= 2
    assert all(np.isfinite(value) for value in result.standard_error.values())


@pytest.mark.slow
def test_nothing_but_a_floor():
    """Without a lobe, e has no effect and is not determined. Standard errors stay finite."""
    data = scan((0.5, 0.4999, 0.0001, 0.5), step=4, noise=0.05)
    result = fit(data, form="thesis", starts=8)
    assert result.verdict["e"].startswith("not determined by these data")
    assert all(np.isfinite(value) and value <= 1 for value in result.standard_error.values())


def parameter(**changes):
    plain = {"advice": "", "at_lower": "", "precision": 0.1, "absolute_precision": 0.01}
    return SimpleNamespace(**plain | changes)


def words(interval, value=0.5, at_bound=None, bounds=(0.0, 1.0), doubt=("", False, 0), **of):
    return verdict(parameter(**of), value, interval, bounds, at_bound, Doubt(*doubt))


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        ({"interval": (0.451, 0.549)}, "determined"),  # a tenth of the value
        ({"interval": (0.449, 0.551)}, "weakly determined: interval 0.449..0.551"),
        ({"interval": (0.0501, 0.0699), "value": 0.06}, "determined"),  # 0.01
        (
            {"interval": (0.0499, 0.0701), "value": 0.06},
            "weakly determined: interval 0.0499..0.0701",
        ),
        ({"interval": (0.2, 0.699)}, "weakly determined: interval 0.2..0.699"),
        ({"interval": (0.2, 0.71)}, "not determined by these data: any value in 0.2..0.71 fits"),
        (
            {"interval": (0.4, 0.61), "bounds": (0.3, 0.7)},
            "not determined by these data: any value in 0.4..0.61 fits",
        ),
        ({"interval": (0.9, 1), "at_bound": "b = 1"}, "at its bound b = 1: interval 0.9..1"),
        (
            {"interval": (0.5, 0.51), "doubt": ("the measured values", False, 0)},
            "not determined by these data: the model misses the measured values",
        ),
        (
            {"interval": (0.5, 0.51), "doubt": ("", False, 3)},
            "weakly determined: interval 0.5..0.51, drawn by 3 outliers; try robust=True",
        ),
        (
            {"interval": (0.3, 0.6), "advice": "give more"},
            "weakly determined: interval 0.3..0.6; give more",
        ),
        (
            {"interval": (0.3, 0.6), "advice": "give more", "doubt": ("", True, 0)},
            "weakly determined: interval 0.3..0.6",
        ),
        (
            {"interval": (0.3, 0.31), "advice": "give more", "doubt": ("all", False, 0)},
            "not determined by these data: the model misses all; give more",
        ),
        (
            {"interval": (0.5, 0.51), "advice": "give more", "doubt": ("all", True, 0)},
            "not determined by these data: the model misses all",
        ),
        ({"interval": (0.5, 0.51), "doubt": ("", 0, 0, True)}, f"determined{IF_CALIBRATED}"),
        (
            {"interval": (0.3, 0.6), "advice": "give more", "doubt": ("", 0, 0, True)},
            f"weakly determined: interval 0.3..0.6{IF_CALIBRATED}; give more",
        ),
        (
            {"interval": (0.2, 0.71), "doubt": ("", 0, 0, True)},
            "not determined by these data: any value in 0.2..0.71 fits",
        ),
        (
            {"interval": (0.015, 0.02), "bounds": (0.01, 1), "at_lower": "below {high:.2g}"},
            "not determined by these data: below 0.02",
        ),
        (
            {"interval": (0.016, 0.02), "bounds": (0.01, 1), "at_lower": "below {high:.2g}"},
            "determined",
        ),
    ],
)
def test_words(arguments, expected):
    assert words(**arguments) == expected

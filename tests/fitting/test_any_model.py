"""Fits of every reflection model: known parameters, error bars, and the choice among models."""

import numpy as np
import pytest
from drjit.llvm.ad import Array3f64, Float64

from docs.studies.fit import intervals_hold
from mi_lcair.errors import InputError
from mi_lcair.fitting import fit
from mi_lcair.fitting.data import COMPARED, variants
from mi_lcair.fitting.model import Scatterometer, directional
from mi_lcair.fitting.scatterometer.reading import DirectionalData
from mi_lcair.physics.reflection.models import MODELS
from tests.fitting.results import fit_of, measurements
from tests.fitting.synthetic import ROUGH, relative_errors, scan_of
from tests.matrix import some_of

# Surfaces of each model for which an in-plane scan determines every parameter.
KNOWN = {
    "sandford_robertson": {"rough": ROUGH},
    "microfacet": {
        "paint": (0.2, 1.7, 1.5, 0.4, 0.1),
        "metal": (0.1, 1.3, 2.5, 3.0, 0.3),
    },
}
SURFACES = [(name, surface) for name, surfaces in KNOWN.items() for surface in surfaces]


@pytest.mark.slow
@pytest.mark.parametrize("name, surface", SURFACES)
def test_noise_free_data_give_the_parameters_back(name, surface):
    parameters = KNOWN[name][surface]
    result = fit(scan_of(MODELS[name], parameters), model=name, starts=16)
    assert relative_errors(result, parameters).max() < 1e-6
    assert result.converged and result.rms_dex < 1e-9 and result.model == name


@pytest.mark.study
@pytest.mark.parametrize("name, surface", SURFACES)
def test_intervals_hold_the_true_values(name, surface):
    """Most 95 % intervals contain the true value, in 8 repetitions with 5 % noise.

    A longer version of this test is `python -m docs.studies.fit coverage`.
    """
    parameters, inside = KNOWN[name][surface], []
    for seed in range(8):
        data = scan_of(MODELS[name], parameters, step=4, noise=0.05, seed=seed)
        result = fit(data, model=name, form=MODELS[name].forms[0], starts=4, seed=seed)
        inside += [
            low <= true <= high for (low, high), true in zip(result.interval.values(), parameters)
        ]
    assert np.mean(inside) > 0.87


@pytest.mark.slow
@pytest.mark.parametrize("name", some_of(COMPARED, 2))
def test_intervals_of_emissivity_and_brdf_hold_the_true_ones(name):
    """On random surfaces, also with parameters at their bounds.

    A longer version of this test is `python -m docs.studies.fit emissivity`.
    """
    model = MODELS[name]
    starts = model.starting_points(12, seed=3)
    inside = [intervals_hold(model, model.values_at(u), k) for k, u in enumerate(starts)]
    for held in zip(*inside):
        assert np.mean([np.mean(of_surface) for of_surface in held]) > 0.8


def test_a_parameter_at_its_bound_widens_the_interval():
    """k = 0 has no slope there, but the emissivity of larger k in its interval is lower."""
    data = scan_of(MODELS["microfacet"], (0.2, 2.0, 1.5, 0.0, 0.05), step=8, noise=0.05)
    result = fit(data, model="microfacet", form="standard", starts=4)
    theta, predicted = result.emissivity
    low, high = result.emissivity_interval.T
    assert np.all(low < predicted) and np.all(predicted < high)
    if result.parameters["k"] == 0:
        assert np.all((predicted - low)[:10] > (high - predicted)[:10])


@pytest.mark.slow
@pytest.mark.parametrize("name, surface", SURFACES)
def test_auto_takes_the_model_that_made_the_data(name, surface):
    data = scan_of(MODELS[name], KNOWN[name][surface], noise=0.05)
    result = fit(data, starts=8)
    assert result.model == name
    assert {row["model"] for row in result.candidates} == set(COMPARED)
    [chosen] = [row for row in result.candidates if row["chosen"]]
    assert chosen["model"] == name and chosen["criterion"] <= 2
    assert chosen["parameters"] == result.parameters and list(result.verdict) == list(
        MODELS[name].names
    )


@pytest.mark.slow
def test_auto_takes_a_restriction_of_the_model_that_made_the_data():
    """Data of a dielectric lead to the restriction k = 0."""
    data = scan_of(MODELS["microfacet"], (0.2, 1.6, 1.5, 0.0, 0.05), noise=0.05)
    result = fit(data, starts=8)
    assert result.model == "microfacet" and result.parameters["k"] == 0
    assert result.restriction == "k = 0" and "at its bound 0" in result.verdict["k"]


@pytest.mark.slow
def test_a_parameter_that_a_restriction_holds_has_an_error_all_the_same():
    """gamma = 2 lies inside gamma's range. The interval is the range that the data allow."""
    data = scan_of(MODELS["microfacet"], (0.2, 2.0, 1.5, 0.4, 0.05), noise=0.05)
    result = fit(data, starts=8)
    assert result.restriction == "gamma = 2" and result.parameters["gamma"] == pytest.approx(2)
    low, high = result.interval["gamma"]
    t = 1.97  # Student's factor
    assert low < 2 < high
    assert result.standard_error["gamma"] == pytest.approx((high - low) / 2 / t, rel=0.1)


@pytest.mark.slow
def test_a_lobe_below_the_resolution_has_an_upper_limit_in_any_model():
    """A weak narrow lobe is measured with a source of 0.9 degrees angular radius."""
    model, half_angle = MODELS["microfacet"], np.radians(0.909)
    data = scan_of(model, (0.2, 2.0, 1.5, 0.0, 0.6))
    instrument = Scatterometer(model, "standard", data.theta_i, data.theta_r, half_angle)
    data.brdf = instrument(model.to_cube([(3e-4, 2.0, 1.5, 0.0, 0.6)]))[0][0]
    data.brdf *= 1 + 0.05 * np.random.default_rng(0).standard_normal(len(data.brdf))
    data.source_half_angle = half_angle
    result = fit(data, model="microfacet", form="standard", starts=8)
    assert result.verdict["alpha"].startswith("not determined by these data: any lobe narrower")


@pytest.mark.slow
def test_a_measured_emissivity_is_followed_by_any_model():
    """One angle of incidence does not determine n and k. A fit with the emissivity describes it."""
    model, parameters = MODELS["microfacet"], (0.1, 1.5, 3.0, 5.0, 0.05)
    data = scan_of(model, parameters, incidence=(30,), step=4, noise=0.05)
    theta = np.radians([15.0, 45.0, 70.0])
    truth = fit_of(measurements(), model="microfacet")
    truth.parameters = dict(zip(model.names, parameters))
    table = DirectionalData(theta, directional(truth, "emissivity", theta), np.full(3, 0.01))
    result = fit(data, model="microfacet", form="standard", emissivity=table, starts=4)
    assert result.emissivity_rms < 0.01 and result.rms_dex < 0.03


def test_a_form_narrows_auto_to_the_models_that_have_it():
    assert {one.model.name for one in variants("auto", "thesis")} == {"sandford_robertson"}
    assert [one.restriction for one in variants("auto", "thesis")] == [None]
    assert {one.model.name for one in variants("auto", "auto")} == set(COMPARED)
    names = [one.restriction and one.restriction.name for one in variants("microfacet", "auto")]
    assert names == [None, *(one.name for one in MODELS["microfacet"].restrictions)]


@pytest.mark.parametrize(
    "model, form, words",
    [
        ("phong", "auto", "unknown reflection model 'phong'; known: .*microfacet"),
        ("microfacet", "thesis", "form 'thesis' is unknown; microfacet has standard"),
        ("auto", "lambert", "sandford_robertson has thesis, normalized; microfacet has standard"),
    ],
)
def test_unknown_names_are_refused_with_the_known_ones(model, form, words):
    with pytest.raises(InputError, match=words):
        fit(scan_of(MODELS["sandford_robertson"], ROUGH, step=20), model=model, form=form)


def test_models_with_more_parameters_than_points_are_left_out():
    data = scan_of(MODELS["sandford_robertson"], ROUGH, incidence=(30,), step=40)
    data.theta_i, data.theta_r, data.brdf = data.theta_i[:4], data.theta_r[:4], data.brdf[:4]
    assert {row["model"] for row in fit(data, starts=2).candidates} == {"sandford_robertson"}
    with pytest.raises(InputError, match="4 points to fit, fewer than the 5 parameters"):
        fit(data, starts=2, model="microfacet")


@pytest.mark.slow
@pytest.mark.parametrize("width", [0.0005, 0.25])
def test_aperture_is_the_average_over_the_sources_disc(width):
    model, half_angle, cells = MODELS["microfacet"], np.radians(0.909), 501
    parameters = (width, 1.5, 2.0, 3.0, 0.1)
    offsets = np.radians([0, 0.5, 0.85, 1.5, 3, -8, 14, -40])
    theta_i = np.radians(np.repeat([20.0, 55.0], len(offsets)))
    theta_r = theta_i + np.tile(offsets, 2)
    instrument = Scatterometer(model, "standard", theta_i, theta_r, half_angle)
    surface = model.surface(*map(Float64, parameters), form="standard")
    edge = half_angle * (2 * (np.arange(cells) + 0.5) / cells - 1)
    x, y = (side.ravel() for side in np.meshgrid(edge, edge))
    x, y = x[np.hypot(x, y) < half_angle], y[np.hypot(x, y) < half_angle]
    expected = []
    for i, r in zip(theta_i, theta_r):
        cosine = np.cos(i + x) * np.cos(y)
        direction = Array3f64(
            Float64(np.sin(i + x) * np.cos(y)), Float64(np.sin(y)), Float64(cosine)
        )
        f = np.array(model.f(surface, direction, Array3f64(-float(np.sin(r)), 0, float(np.cos(r)))))
        expected.append(np.sum(f * cosine * np.cos(y)) / np.sum(cosine * np.cos(y)))
    averages = instrument(model.to_cube([parameters]))[0][0]
    np.testing.assert_allclose(averages, expected, rtol=6e-3)

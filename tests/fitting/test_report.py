"""The report of a fit: a JSON file that is a material, and a picture."""

import json
from dataclasses import asdict

import numpy as np
import pytest
from matplotlib.figure import Figure

from mi_lcair.errors import InputError
from mi_lcair.fitting.report import as_dict, bands, check_bands, emissivities, to_json
from mi_lcair.fitting.scatterometer.reading import DirectionalData
from mi_lcair.fitting.uncertainty import LEVEL
from mi_lcair.physics.bands import band
from mi_lcair.physics.materials import material
from mi_lcair.show.pictures.fit import draw_brdf, draw_directional, draw_fit, draw_table, save_plot
from tests.fitting.numpy_model import brdf as numpy_brdf
from tests.fitting.results import PARAMETERS, QUALITY, emissivity, fit_of, measurements


def written(path, *results):
    path.write_text(to_json(as_dict([fit for _, fit, _ in results])), encoding="utf-8")
    return json.loads(path.read_text(encoding="utf-8"))


def result(data, **directional):
    return data, fit_of(data, **directional), directional


# ------------------------------------------------------------------- JSON


def test_a_report_holds_what_is_known(tmp_path):
    report = written(tmp_path / "fit.json", result(measurements(), emissivity=emissivity()))
    assert report["parameters"] == PARAMETERS  # exactly
    assert (report["form"], report["restriction"], report["band"], report["name"]) == (
        "normalized",
        "b = 0",
        "3-5",
        "a plate",
    )
    for key in ("standard_error", "verdict", "interval"):
        assert list(report[key]) == ["epsilon", "rho_d", "b", "e"]
    assert report["correlation"] == np.eye(4).tolist()
    assert report["rms_dex"] == 0.1234 and report["used"] == 66
    assert report["dropped"] == {
        "off the plane of incidence": 2,
        "theta_i or theta_r beyond 80 degrees": 2,
    }
    assert report["emissivity"] == {
        "theta_deg": pytest.approx([15, 60]),
        "predicted": [0.55, 0.55],
        "standard_error": [0.02] * 2,
        "interval": [[0.51, 0.59]] * 2,
        "measured": [0.6, 0.5],
        "rms_error": 0.05,
    }
    assert report["source"] == [
        {"file": "scan.csv", "sha256": "00"},
        {"file": "emissivity.csv", "sha256": "11"},
    ]
    assert report["settings"]["source_half_angle_deg"] == 0 and report["reading"] == {
        "quantity": "brdf"
    }


def test_a_report_says_what_it_is_and_in_which_bands(tmp_path):
    report = written(tmp_path / "fit.json", result(measurements()))
    assert (report["kind"], report["band_um"], bands(report)) == ("fit", [3, 5], ["3-5"])
    assert report["quality"] == asdict(QUALITY)
    assert bands(written(tmp_path / "none.json", result(measurements(band_um=None)))) == []
    assert bands({"kind": "signature"}) == bands({"materials": {"a": 1}}) == []


def test_without_emissivity(tmp_path):
    report = written(tmp_path / "fit.json", result(measurements()))
    assert report["emissivity"] == {
        "theta_deg": pytest.approx([0, 30, 60]),
        "predicted": [0.55] * 3,
        "standard_error": [0.02] * 3,
        "interval": [[0.51, 0.59]] * 3,
        "measured": None,
        "rms_error": None,
    }


def test_a_report_is_a_material(tmp_path):
    path = tmp_path / "fit.json"
    written(path, result(measurements()))
    computed = material(str(path), band("MWIR"))
    assert computed.values == tuple(PARAMETERS.values())
    assert (computed.form, computed.band) == ("normalized", "3-5")


def test_several_bands_are_one_material(tmp_path):
    path = tmp_path / "fit.json"
    report = written(
        path, result(measurements()), result(measurements(band_um=(8.0, 12.0), file="other.csv"))
    )
    assert list(report) == ["kind", "materials"] and report["kind"] == "fit"
    assert list(report["materials"]) == ["3-5", "8-12"] == bands(report)
    assert (
        material(str(path), band("LWIR")).band == "8-12"
        and material(str(path), band("MWIR")).band == "3-5"
    )


def test_an_unknown_band_is_said_where_the_material_is_used(tmp_path):
    path = tmp_path / "fit.json"
    assert written(path, result(measurements(band_um=None)))["band"] is None
    with pytest.raises(InputError, match="had no band; add '# band_um: 3 5'"):
        material(str(path), band("MWIR"))


def test_several_files_must_have_bands_of_their_own():
    check_bands([measurements(band_um=None)])
    check_bands([measurements(), measurements(band_um=(8.0, 12.0))])
    with pytest.raises(InputError, match="a.csv: which band is it?"):
        check_bands([measurements(), measurements(band_um=None, file="a.csv")])
    with pytest.raises(InputError, match="scan.csv and b.csv have the same band, 3-5 um"):
        check_bands([measurements(), measurements(file="b.csv")])


def test_the_same_fit_gives_the_same_report():
    data = measurements()
    assert to_json(as_dict([fit_of(data)])) == to_json(as_dict([fit_of(data, seconds=9.0)]))


# ------------------------------------------------------------------- picture


@pytest.fixture
def axes():
    return Figure().subplots(2, 1)


def test_lines_are_the_model_and_points_the_data(axes):
    """Lines pass through the values of an independent model; points left out are hollow."""
    data = measurements()
    draw_brdf(*axes, data, fit_of(data))
    lines = {line.get_label(): line for line in axes[0].lines}
    r, f = lines["50°"].get_data()
    assert (r.min(), r.max(), axes[0].get_yscale()) == (
        pytest.approx(-80),
        pytest.approx(85),
        "log",
    )
    expected = numpy_brdf(np.radians(50), np.radians(r), **PARAMETERS, form="normalized")
    np.testing.assert_allclose(f, expected, rtol=1e-9)
    solid, hollow = (
        [
            line
            for line in axes[0].lines
            if line.get_marker() == "o" and (str(line.get_markerfacecolor()) == "none") == is_hollow
        ]
        for is_hollow in (False, True)
    )
    assert [len(line.get_xdata()) for line in solid] == [33, 33] and [
        len(line.get_xdata()) for line in hollow
    ] == [1, 1]
    np.testing.assert_allclose(
        np.concatenate([line.get_ydata() for line in solid]), data.brdf[fit_of(data).used_points]
    )


def test_residuals_are_decades_of_the_points_used(axes):
    data = measurements()
    draw_brdf(*axes, data, fit_of(data))
    shown = [line for line in axes[1].lines if line.get_marker() == "o"]
    model = numpy_brdf(data.theta_i, data.theta_r, **PARAMETERS, form="normalized")
    used = fit_of(data).used_points
    np.testing.assert_allclose(
        np.concatenate([line.get_ydata() for line in shown]),
        np.log10(data.brdf / model)[used],
        atol=1e-9,
    )


def test_the_angle_that_was_swept_is_the_axis(axes):
    """With a fixed detector and a moving source, the axis is theta_i and each theta_r is a line."""
    data = measurements(theta_i=range(1, 80, 2), theta_r=(15, 45))
    draw_brdf(*axes, data, fit_of(data))
    assert {"15°", "45°"} <= {line.get_label() for line in axes[0].lines}
    assert "theta_i" in axes[1].get_xlabel()


def test_many_settings_are_thinned(axes):
    data = measurements(theta_i=range(1, 41), theta_r=range(40))
    draw_brdf(*axes, data, fit_of(data))
    assert len(axes[0].get_legend().get_texts()) == 12


def test_measured_emissivity_has_its_error_bars(axes):
    draw_directional(axes[0], fit_of(measurements()), "emissivity", emissivity())
    bars = axes[0].containers[0]
    np.testing.assert_allclose(bars.lines[0].get_data(), [[15, 60], [0.6, 0.5]])
    assert "emissivity" in axes[0].get_ylabel() and "theta_r" in axes[0].get_xlabel()


def test_without_a_measured_emissivity_the_predicted_one_is_shown():
    figure = Figure()
    draw_fit(figure, *result(measurements()))
    (panel,) = (axes for axes in figure.axes if axes.get_ylabel() == "emissivity")
    theta, value = panel.lines[0].get_data()
    assert len(panel.lines) == 1 and (theta[0], theta[-1]) == (0, 89) and 0.2 < value[0] < 0.4


def test_the_table_says_what_the_fit_says(axes):
    draw_table(axes[0], fit_of(measurements(), emissivity=emissivity()))
    text = " ".join(text.get_text() for text in axes[0].texts)
    for words in (
        "0.3333",
        "± 0.01",
        "at its bound 0",
        "0.1234 decades",
        "66 used, 4 left out",
        "0.050 in emissivity",
    ):
        assert words in text


@pytest.mark.slow
@pytest.mark.parametrize(
    "results",
    [
        [result(measurements())],
        [result(measurements(theta_i=(30,)), emissivity=emissivity())],
        [
            result(
                measurements(),
                emissivity=emissivity(),
                dhr=DirectionalData(np.radians([20.0]), np.array([0.3]), None, "dhr"),
            ),
            result(measurements(band_um=None)),
        ],
    ],
    ids=["BRDF alone", "one incidence, emissivity", "two files, emissivity and DHR"],
)
def test_a_picture_is_written(tmp_path, results):
    save_plot(tmp_path / "fit.png", results)
    assert (tmp_path / "fit.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.slow
def test_zeros_and_negative_values_do_not_spoil_it(tmp_path):
    data = measurements()
    data.brdf[:3] = 0, -1, 1e-300
    fit = fit_of(data)
    fit.used_points[:3] = False
    fit.brdf_interval = fit.brdf_interval[3:]
    save_plot(tmp_path / "fit.png", [(data, fit, {})])


def test_a_fit_is_a_result(tmp_path):
    """It is short in a notebook's cell, and becomes a table, a picture and files."""
    fitted = fit_of(measurements(), emissivity=emissivity())
    assert repr(fitted) == (
        "fit of sandford_robertson to a plate: epsilon 0.3 +- 0.01, rho_d 0.3333 +- 0.01, b 0.05 "
        "+- 0.01, e 0.1 +- 0.01; rms 0.123 decades; LACK OF FIT"
    )
    assert "<img" in fitted._repr_html_()
    columns = fitted.columns()
    assert columns["parameter"].tolist() == ["epsilon", "rho_d", "b", "e"]
    assert {len(column) for column in columns.values()} == {4}
    for name in ("fit.json", "fit.csv", "fit.svg"):
        fitted.save(tmp_path / name)
    saved = json.loads((tmp_path / "fit.json").read_text())
    assert saved == written(
        tmp_path / "other.json", (fitted.measurements, fitted, fitted.directional)
    )
    assert material(str(tmp_path / "fit.json"), band("MWIR")).values == tuple(PARAMETERS.values())


@pytest.mark.parametrize("words", ["determined", "determined" + LEVEL])
def test_emissivities_state_the_condition_of_the_verdicts(words):
    table = {"theta_deg": [0.0], "predicted": [0.9], "standard_error": [0.01]}
    report = {"emissivity": table | {"interval": [(0.88, 0.92)]}, "verdict": {"b": words}}
    (shown,) = emissivities(report)
    assert str(shown.columns[-1]) == words.replace("determined", "95 % interval")

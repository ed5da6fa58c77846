"""Reading of uncertainties: forms that are understood, and one line for each that is not."""

import json

import numpy as np
import pytest

from mi_lcair.errors import InputError
from mi_lcair.sensitivity.entries import Parameter
from mi_lcair.uncertainty.inputs import Inputs
from mi_lcair.uncertainty.uncertainties import Uncertainties

KNOWN = {
    name: Parameter(name, kind, value, "1", -1e9, 1e9)
    for name, kind, value in (
        ("self.temperature", "temperature", 300.0),
        ("walls.temperature", "temperature", 260.0),
        ("sky.radiance", "radiance", 20.0),
        ("paint.a", "material", 0.25),
        ("paint.b", "material", 0.5),
        ("other.a", "material", 0.0),
    )
}
REPORT = {
    "model": "some",
    "parameters": {"a": 0.25, "b": 0.5},
    "standard_error": {"a": 0.02, "b": 0.01},
    "correlation": [[1, -0.5], [-0.5, 1]],
}


def inputs(tree) -> Inputs:
    return Inputs.of(Uncertainties.read(tree), KNOWN, "the scene")


def test_numbers_and_percentages(tmp_path):
    path = tmp_path / "sigma.toml"
    path.write_text('[sigma]\n"self.temperature" = 2\n"sky.radiance" = "5 %"\n')
    found = inputs(path)
    assert found.names == ["self.temperature", "sky.radiance"]
    np.testing.assert_allclose(found.sigma, [2, 1])
    np.testing.assert_array_equal(found.values, [300, 20])
    assert [list(group.index) for group in found.groups] == [[0], [1]]


def test_keys_without_quotes(tmp_path):
    path = tmp_path / "sigma.toml"
    path.write_text("[sigma]\nself.temperature = 2\npaint.a = 0.1\n[sigma.paint2]\n")
    assert inputs(path).names == ["self.temperature", "paint.a"]


def test_correlations_and_covariances():
    tree = {
        "sigma": {"self.temperature": 2.0, "sky.radiance": "10 %"},
        "correlated": [
            {"names": ["self.temperature", "sky.radiance"], "correlation": 0.5},
            {"names": ["paint.a", "paint.b"], "covariance": [[4e-4, 1e-4], [1e-4, 1e-4]]},
        ],
    }
    found = inputs(tree)
    expected = np.zeros((4, 4))
    expected[:2, :2] = [[4, 2], [2, 4]]
    expected[2:, 2:] = [[4e-4, 1e-4], [1e-4, 1e-4]]
    np.testing.assert_allclose(found.covariance, expected)
    assert [group.label for group in found.groups] == [
        "self.temperature & sky.radiance",
        "paint.a & paint.b",
    ]


@pytest.mark.parametrize("several", [False, True])
def test_covariance_of_a_fit(tmp_path, several):
    """Also of a report with one fit for each band: the one with the scene's parameters counts."""
    other = REPORT | {"parameters": {"a": 0.9, "b": 0.1}}
    report = {"materials": {"3-5": other, "8-12": REPORT}} if several else REPORT
    (tmp_path / "paint.json").write_text(json.dumps(report))
    (tmp_path / "u.toml").write_text('[fits]\npaint = "paint.json"\n')
    found = inputs(tmp_path / "u.toml")
    assert found.names == ["paint.a", "paint.b"] and found.groups[0].label == "paint (fit)"
    np.testing.assert_allclose(found.covariance, [[4e-4, -1e-4], [-1e-4, 1e-4]])


def test_a_parameter_that_a_fit_held_has_no_error(tmp_path):
    held = REPORT | {"standard_error": {"a": 0.02, "b": 0.0}, "correlation": [[1, 0], [0, 1]]}
    (tmp_path / "paint.json").write_text(json.dumps(held))
    found = inputs({"fits": {"paint": str(tmp_path / "paint.json")}})
    assert found.names == ["paint.a"]


PAIR = ["self.temperature", "sky.radiance"]


@pytest.mark.parametrize(
    "tree, message",
    [
        ({}, "holds no uncertainties"),
        ({"sigmas": {}}, "unknown table 'sigmas'; known: sigma"),
        (
            {"sigma": {"self.temperatur": 1}},
            "unknown quantity of the scene 'self.temperatur'; known: self.temperature",
        ),
        (
            {"sigma": {"self.temperature": 0}},
            "'self.temperature' = 0; must be positive",
        ),
        (
            {"sigma": {"self.temperature": "two"}},
            "must be a standard deviation in the quantity's unit",
        ),
        (
            {"sigma": {"self.temperature": True}},
            "must be a standard deviation in the quantity's unit",
        ),
        ({"sigma": {"self.temperature": "-5 %"}}, "must be positive and finite"),
        ({"sigma": {"other.a": "5 %"}}, "relative to a value of 0; give a number"),
        ({"scenario": {"range_m": 5}}, "quantity of a contrast scenario, and the scene is a scene"),
        (
            {"sigma": {"paint.a": 1}, "correlated": [{"names": ["paint.a"], "correlation": 1}]},
            "two or more different",
        ),
        (
            {"sigma": {"paint.a": 1}, "correlated": [{"names": PAIR, "correlation": 0.5}]},
            "'self.temperature' has no standard deviation",
        ),
        (
            {"sigma": dict.fromkeys(PAIR, 1), "correlated": [{"names": PAIR, "correlation": 1.5}]},
            "no negative eigenvalue",
        ),
        (
            {
                "sigma": dict.fromkeys(PAIR, 1),
                "correlated": [{"names": PAIR, "correlation": [1, 2]}],
            },
            "must be a matrix of 2 x 2",
        ),
        (
            {
                "sigma": dict.fromkeys(PAIR, 1),
                "correlated": [{"names": PAIR, "covariance": [[1, 0], [0, 1]]}],
            },
            "has a covariance and a standard deviation",
        ),
        (
            {"correlated": [{"names": PAIR, "covariance": [[1, 2], [2, 1]]}]},
            "no negative eigenvalue",
        ),
        ({"fits": {"paint": "no.json"}}, "fit 'no.json': cannot be read"),
        ({"fits": {"paint": 3}}, "must be the name of a fit's JSON file"),
    ],
)
def test_what_cannot_be_used(tree, message):
    with pytest.raises(InputError) as error:
        inputs(tree)
    assert message in str(error.value) and str(error.value).startswith("uncertainties: ")


@pytest.mark.parametrize(
    "report, message",
    [
        (
            REPORT | {"parameters": {"a": 0.3, "b": 0.5}},
            "is of another material: it has a = 0.3, b = 0.5, and paint",
        ),
        (
            REPORT | {"parameters": {"c": 0.25, "d": 0.5}, "standard_error": {"c": 1, "d": 1}},
            "is of another material",
        ),
        ({"model": "some"}, "is not the JSON report of a fit"),
        ([1, 2], "is not the JSON report of a fit"),
    ],
)
def test_reports_that_cannot_be_used(tmp_path, report, message):
    (tmp_path / "paint.json").write_text(json.dumps(report))
    with pytest.raises(InputError, match=message):
        inputs({"fits": {"paint": str(tmp_path / "paint.json")}})


def test_two_statements_on_one_quantity(tmp_path):
    (tmp_path / "paint.json").write_text(json.dumps(REPORT))
    tree = {"fits": {"paint": str(tmp_path / "paint.json")}, "sigma": {"paint.a": 0.1}}
    with pytest.raises(InputError, match="'paint.a' has more than one uncertainty"):
        inputs(tree)
    with pytest.raises(InputError, match="unknown material of the scene 'pain'; known: paint"):
        inputs({"fits": {"pain": str(tmp_path / "paint.json")}})

"""Reading of uncertainties: forms that are understood, and one line for each that is not."""

import json

import numpy as np
import pytest

from mi_lcair.errors import InputError
from mi_lcair.estimate import relative
from mi_lcair.knowing.budgets.uncertainties import FittedMaterial, Uncertainties, of_material
from mi_lcair.toml_table import dotted
from tests.knowing.budgets.statements import REPORT, inputs


def test_keys_without_quotes(tmp_path):
    path = tmp_path / "sigma.toml"
    path.write_text("[sigma]\nself.temperature = 2\npaint.a = 0.1\n")
    assert inputs(path).names == ["self.temperature", "paint.a"]


PAIR = ["self.temperature", "sky.radiance"]


@pytest.mark.parametrize(
    "tree, message",
    [
        ({}, "contains no uncertainties"),
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
        ({"sigma": {"self.temperature": "-5 %"}}, "must be positive and at most"),
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
            {"sigma": dict.fromkeys(PAIR, 1), "correlated": [{"names": PAIR, "covariance": []}]},
            "give names and correlation, nothing else",
        ),
        *(
            (
                {
                    "sigma": dict.fromkeys(PAIR, 1),
                    "correlated": [{"names": PAIR, "correlation": value}],
                },
                "must be a matrix of 2 x 2",
            )
            for value in (True, [[1, True], [True, 1]])
        ),
        ({"sigma": {"self.temperature": 1, "paint.a": {}}}, "'paint.a' = {}: must have one of"),
        ({"sigma": {"self.temperature": 1e30}}, "= 1e+30; must be positive and at most 1e+12"),
        ({"sigma": {"self.temperature": "1e30 %"}}, "= 1e+28; must be positive and at most"),
        ({"sigma": {"paint.a": {"uniform": 1e30}}}, "= 1e+30; must be positive and at most"),
        ({"facets": {"walls": {"uniform": 2}}}, "walls = {'uniform': 2}; must be kelvin, or a CSV"),
        ({"correlated": 3}, "correlated must be tables, [[correlated]]"),
        ({"correlated": [3]}, "correlated must be tables, [[correlated]]"),
        ({"sigma": [3]}, "[sigma] must be a table"),
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


def test_files_beside_the_statement(tmp_path):
    """A table of facets, and the fits of one material in the solution of an inversion."""
    path, stated = tmp_path / "u.toml", '[facets]\nwing = "sigma.csv"\n[fits]\npaint = "fit.json"\n'
    path.write_text(stated)
    solution = {"kind": "invert", "unknowns": [], "materials": {"paint": {"MWIR": REPORT}}}
    (tmp_path / "fit.json").write_text(json.dumps(solution))
    read = Uncertainties.read(path)
    assert read.facets == {"wing": tmp_path / "sigma.csv"}
    assert [fit.values for fit in read.fits["paint"]] == [REPORT["parameters"]]
    del solution["materials"]["paint"]
    (tmp_path / "fit.json").write_text(json.dumps(solution))
    with pytest.raises(InputError, match="unknown material of 'fit.json' 'paint'"):
        Uncertainties.read(path)
    # A fit in several bands has the same word without being a solution
    (tmp_path / "fit.json").write_text(
        json.dumps({"kind": "fit", "materials": {"MWIR": REPORT, "LWIR": REPORT}})
    )
    assert len(Uncertainties.read(path).fits["paint"]) == 2


def test_fractions():
    assert relative("5 %") == 0.05 and relative("1e-1%") == pytest.approx(1e-3)
    assert relative("5") is None and relative("five %") is None and relative("1.2.3 %") is None


def test_nested_keys():
    assert dotted({"a": {"b": 1, "c": {"d": 2}}, "e.f": 3, "g": {}}) == {
        "a.b": 1,
        "a.c.d": 2,
        "e.f": 3,
    }


def test_matrices():
    """A correlation of three quantities; an asymmetric one is refused."""
    names = ["a", "b", "c"]
    matrix = [[1, 0.5, 0], [0.5, 1, 0.2], [0, 0.2, 1]]
    stated = {"sigma": dict.fromkeys(names, 1.0)}
    (group,) = Uncertainties.read(
        stated | {"correlated": [{"names": names, "correlation": matrix}]}
    ).correlated
    assert group.names == ("a", "b", "c")
    np.testing.assert_array_equal(group.correlation, matrix)
    for wrong, message in (
        ([[1, 0.5, 0], [0.4, 1, 0.2], [0, 0.2, 1]], "must be symmetric"),
        ([[1, 0.9, -0.9], [0.9, 1, 0.9], [-0.9, 0.9, 1]], "no negative eigenvalue"),
        ([[1, 0.5, 0], [0.5, 2, 0.2], [0, 0.2, 1]], "the diagonal of a correlation matrix is 1"),
    ):
        with pytest.raises(InputError, match=message):
            Uncertainties.read(stated | {"correlated": [{"names": names, "correlation": wrong}]})


def test_the_fit_of_a_material():
    """Its parameters are those of the scene to Float32."""
    fits = [FittedMaterial("f.json", "some", {"a": 0.25}, np.eye(1)) for _ in range(2)]
    fits[1].values["a"] = 0.5
    assert of_material(fits, "paint", {"a": 0.5 * (1 + 0.9e-4)}) is fits[1]
    for present in ({"a": 0.5 * (1 + 1.1e-4)}, {"a": 0.25, "b": 1.0}, {"b": 0.25}):
        with pytest.raises(
            InputError, match="fit 'f.json' is of another material: it has a = 0.25"
        ):
            of_material(fits, "paint", present)

"""Values and covariance of uncertain quantities, from what is stated about them."""

import json

import numpy as np
import pytest

from mi_lcair.errors import InputError
from mi_lcair.estimate import deviation
from mi_lcair.knowing.budgets.inputs import deviation
from tests.knowing.budgets.statements import REPORT, inputs


def test_numbers_and_percentages(tmp_path):
    path = tmp_path / "sigma.toml"
    path.write_text('[sigma]\n"self.temperature" = 2\n"sky.radiance" = "5 %"\n')
    found = inputs(path)
    assert found.names == ["self.temperature", "sky.radiance"]
    np.testing.assert_allclose(found.sigma, [2, 1])
    np.testing.assert_array_equal(found.values, [300, 20])
    assert [list(group.index) for group in found.groups] == [[0], [1]]


def test_correlations():
    tree = {
        "sigma": {
            "self.temperature": 2.0,
            "sky.radiance": "10 %",
            "paint.a": 0.02,
            "paint.b": 0.01,
        },
        "correlated": [
            {"names": ["self.temperature", "sky.radiance"], "correlation": 0.5},
            {"names": ["paint.a", "paint.b"], "correlation": 0.5},
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


def test_two_statements_on_one_quantity(tmp_path):
    (tmp_path / "paint.json").write_text(json.dumps(REPORT))
    tree = {"fits": {"paint": str(tmp_path / "paint.json")}, "sigma": {"paint.a": 0.1}}
    with pytest.raises(InputError, match="'paint.a' has more than one uncertainty"):
        inputs(tree)
    with pytest.raises(InputError, match="unknown material of the scene 'pain'; known: paint"):
        inputs({"fits": {"pain": str(tmp_path / "paint.json")}})


def test_deviations():
    """A number in the unit of the quantity, or a fraction of its magnitude."""
    assert deviation("a", 3, -20.0) == 3 and deviation("a", "5 %", -20.0) == 1
    assert deviation("a", " 0.5e1% ", -20.0) == 1

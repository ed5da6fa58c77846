"""Tables of a data set: views from files, and one line about what cannot be used."""

import numpy as np
import pytest

from mi_lcair.detection.datasets.description import DatasetDescription
from mi_lcair.errors import InputError
from mi_lcair.toml_table import text_of
from tests.detection.datasets.box_set import DESCRIPTION

BASE = {"base": {"scenario": "scenario.toml"}}


def views(folder, text, **more):
    (folder / "views.csv").write_text(text)
    tree = BASE | {"views": {"file": str(folder / "views.csv"), **more}}
    return DatasetDescription.read(tree).views.views(0)


def test_rows_of_a_file_are_views(tmp_path):
    made = views(tmp_path, "azimuth_deg,elevation_deg,range_m,roll_deg\n10,20,50,3\n-30,5,70,0\n")
    assert made == [
        {"right_deg": 0, "up_deg": 0, "roll_deg": 3}
        | {"azimuth_deg": 10, "elevation_deg": 20, "range_m": 50},
        {"right_deg": 0, "up_deg": 0, "roll_deg": 0}
        | {"azimuth_deg": -30, "elevation_deg": 5, "range_m": 70},
    ]
    (made,) = views(tmp_path, "x_m,y_m,z_m\n0,3,4\n")
    assert [made[name] for name in ("azimuth_deg", "elevation_deg", "range_m")] == pytest.approx(
        [90, np.degrees(np.arctan2(4, 3)), 5]
    )


def test_views_in_even_steps_along_a_line(tmp_path):
    """A corner of 3 m and 6 m has four views every 3 m."""
    made = views(tmp_path, "x_m,y_m,z_m,roll_deg\n10,0,2,0\n10,3,2,6\n16,3,2,0\n", count=4)
    azimuth, elevation = (
        np.radians([view[name] for view in made]) for name in ("azimuth_deg", "elevation_deg")
    )
    level = np.array([view["range_m"] for view in made]) * np.cos(elevation)
    places = level * [np.cos(azimuth), np.sin(azimuth), np.tan(elevation)]
    np.testing.assert_allclose(places.T, [[10, 0, 2], [10, 3, 2], [13, 3, 2], [16, 3, 2]])
    assert [view["roll_deg"] for view in made] == pytest.approx([0, 6, 3, 0])


def test_positions_that_are_the_same_are_no_line(tmp_path):
    with pytest.raises(InputError, match="views.csv: its positions are all the same"):
        views(tmp_path, "azimuth_deg,elevation_deg,range_m\n10,0,20\n10,0,20\n", count=3)


def test_bands_are_changes_of_the_scenario(tmp_path):
    """The name is the sensor's band unless the changes state one; files are beside the file."""
    assert DatasetDescription.read(DESCRIPTION).bands == {"": {}}
    (tmp_path / "filter.csv").write_text("wavelength_um,response\n")
    (tmp_path / "dataset.toml").write_text(
        text_of(DESCRIPTION)
        + '\n[bands]\nMWIR = {"camera.integration_time_ms" = 5}\n'
        + 'cold = {"sensor.band" = "LWIR", "sensor.response" = "filter.csv"}\n'
    )
    assert DatasetDescription.read(tmp_path / "dataset.toml").bands == {
        "MWIR": {"sensor.band": "MWIR", "camera.integration_time_ms": 5},
        "cold": {"sensor.band": "LWIR", "sensor.response": str(tmp_path / "filter.csv")},
    }


@pytest.mark.parametrize(
    "tables, message",
    [
        ({"views": {}}, r"\[views\]: sphere, random and file are missing; give one of them"),
        ({"views": {"sphere": 3, "random": 2, "range_m": 9}}, "has sphere and random; give one"),
        ({"views": {"sphere": 3}}, "range_m is missing"),
        ({"views": {"sphere": 3, "range_m": [9, 8]}}, "range_m = .9.0, 8.0.; give one number"),
        ({"views": {"sphere": 0, "range_m": 9}}, "sphere = 0; must lie in"),
        ({"views": {"sphere": 3, "range_m": 9, "count": 4}}, "count needs file"),
        ({"views": {"file": "views.csv", "range_m": 9}}, "leave range_m out"),
        ({"views": {"sphere": 3, "range_m": 9, "elevation_deg": [0, 95]}}, "must lie in -90..90"),
        ({"splits": {"train": 0.8, "val": 0.3}}, "train, val and test are 0.8, 0.3 and 0.1; they"),
        ({"frames": {"cases": 0}}, "cases = 0"),
        ({"draws": {"hour": {"uniform": [0, 24]}}}, "hour needs heat"),
        ({"base": {"scenario": "a.toml", "heat": "heat.toml"}}, "hour needs heat"),
        ({"draws": {"lid.temperature": "warm"}}, "lid.temperature = 'warm'; give a number"),
        ({"draws": {"lid.temperature": {"uniform": [3, 2]}}}, "two rising numbers"),
        ({"draws": {"lid.temperature": {"choice": []}}}, "choice must be a list"),
        ({"draws": {"lid.temperature": -3}}, "must be positive"),
        ({"draws": {"observer.range_m": 3}}, r"observer.range_m belongs to \[views\]"),
        ({"bands": {"a/b": {}}}, "'a/b' is the name of a folder"),
        ({"conditions": {}}, r"unknown table 'conditions'.*is a table of a sweep"),
        ({"base": {}}, "scenario is missing"),
    ],
)
def test_one_line_about_what_cannot_be_used(tables, message):
    with pytest.raises(InputError, match=message) as error:
        DatasetDescription.read(DESCRIPTION | tables)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    "text, message",
    [
        ("azimuth_deg,elevation_deg,range_m,tilt_deg\n1,2,3,4\n", "unknown column of .*'tilt_deg'"),
        ("azimuth_deg,elevation_deg\n1,2\n", "the header must name"),
        ("azimuth_deg,elevation_deg,range_m\n1,2,-3\n", "line 2: range_m"),
        ("azimuth_deg,elevation_deg,range_m\n1,100,3\n", "line 2: elevation_deg"),
        ("x_m,y_m,z_m\n1,a,3\n", "'a' in column 'y_m' is not a number"),
    ],
)
def test_one_line_about_a_file_of_views(tmp_path, text, message):
    with pytest.raises(InputError, match=message):
        views(tmp_path, text)

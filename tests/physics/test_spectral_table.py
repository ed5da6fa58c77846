"""Measured tables over the hemisphere: values between and outside the measured angles."""

import warnings

import numpy as np
import pytest

from mi_lcair.errors import InputError
from mi_lcair.physics.spectral_table import over_the_hemisphere, read_directional_table

NODES = np.radians([0, 10, 20, 50, 80, 90])


def test_linear_between_the_angles_and_constant_outside():
    theta, values = np.radians([10, 30, 80]), np.array([0.9, 0.8, 0.5])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        on_nodes = over_the_hemisphere("table", theta, values, NODES)
    assert on_nodes == pytest.approx([0.9, 0.9, 0.85, 0.68, 0.5, 0.5])


@pytest.mark.parametrize(
    "degrees, words",
    [
        ((15.1, 80), "table: measured at 15.1..80 degrees; the nearest value"),
        ((10, 74.9), "measured at 10..74.9 degrees"),
        ((40,), "measured at 40 degrees alone"),
    ],
)
def test_a_table_that_ends_early_is_remarked(degrees, words):
    with pytest.warns(UserWarning, match=words):
        over_the_hemisphere("table", np.radians(degrees), np.full(len(degrees), 0.9), NODES)


def test_a_table_that_reaches_far_enough_is_not():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        over_the_hemisphere("table", np.radians([15, 75]), np.array([0.9, 0.8]), NODES)


def test_columns_in_the_order_of_the_angles(tmp_path):
    path = tmp_path / "dhr.csv"
    path.write_text("# made by hand\ndhr,theta_deg,dhr_std\n0.3,60,0.01\n0.1,15,0.02\n")
    theta, values, deviations = read_directional_table(path, "dhr")
    assert np.degrees(theta) == pytest.approx([15, 60])
    assert values.tolist() == [0.1, 0.3] and deviations.tolist() == [0.02, 0.01]
    path.write_text("theta_deg,emissivity\n0,1\n90,0\n")
    theta, values, deviations = read_directional_table(path)
    assert theta[-1] == pytest.approx(np.pi / 2) and values.tolist() == [1, 0]
    assert deviations is None


@pytest.mark.parametrize(
    "row, words",
    [
        ("90.1,0.5,0.1", "line 3: theta_deg = 90.1; must lie in 0..90"),
        ("-0.1,0.5,0.1", "line 3: theta_deg = -0.1; must"),
        ("50,1.01,0.1", "line 3: emissivity = 1.01; must lie in 0..1"),
        ("50,-0.01,0.1", "line 3: emissivity = -0.01; must"),
        ("50,0.5,0.9e-6", "line 3: emissivity_std = 9e-07; must lie in 1e-06..1"),
        ("50,0.5,1.1", "line 3: emissivity_std = 1.1; must"),
        ("10,0.5,0.1", "line 3: theta_deg 10 appears twice"),
    ],
)
def test_rows_that_cannot_be(tmp_path, row, words):
    path = tmp_path / "bad.csv"
    path.write_text(f"theta_deg,emissivity,emissivity_std\n10,0.9,0.1\n{row}\n")
    with pytest.raises(InputError, match=words):
        read_directional_table(path)

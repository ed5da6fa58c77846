"""Tests of the channels of radiance images."""

import numpy as np
import pytest

from mi_lcair.formats.channels import column_of, has_value, quantity_of


@pytest.mark.parametrize(
    "channel, column, unit",
    [
        ("Y", "radiance_W_m2_sr", "W m-2 sr-1"),
        ("group.range.Y", "group.range_W_m2_sr", "W m-2 sr-1"),
        ("stderr.Y", "standard_error_W_m2_sr", "W m-2 sr-1"),
        ("temperature.Y", "temperature_K", "K"),
        ("range.Y", "range_m", "m"),
        ("stderr_K.Y", "standard_error_K", "K"),
        ("noise_K.Y", "noise_K", "K"),
        ("counts.Y", "counts", ""),
        ("d.plate.temperature.Y", "d.plate.temperature", "W m-2 sr-1 per unit"),
        (
            "stderr.d.plate.temperature.Y",
            "standard_error.d.plate.temperature",
            "W m-2 sr-1 per unit",
        ),
    ],
)
def test_columns_and_units(channel, column, unit):
    assert column_of(channel) == column
    assert quantity_of(channel)[1] == unit


def test_a_temperature_of_0_is_no_value():
    values = np.array([0, 1, np.nan, np.inf])
    assert has_value("temperature.Y", values).tolist() == [False, True, False, False]
    assert has_value("Y", values).tolist() == [True, True, False, False]

"""Cells as text: digits, errors, units and the signs of print."""

import numpy as np
import pytest

from mi_lcair.results import cells


@pytest.mark.parametrize(
    "value, error, text",
    [
        (12.3456789, 0.0123, "12.346 +- 0.012"),
        (-0.00123456, 2.1e-6, "-0.0012346 +- 2.1e-06"),
        (5.0, 40.0, "5 +- 40"),
        (0.0, 0.1, "0 +- 0.1"),
        (22.07554321, 0.0, "22.0755 +- 0"),
        (1.0, np.nan, "1 +- no value"),
        (1.23456789123, 1e-15, "1.23456789 +- 1e-15"),
    ],
)
def test_a_value_ends_at_the_second_digit_of_its_error(value, error, text):
    assert cells.cell_text((value, error)) == text


@pytest.mark.parametrize(
    "value, text",
    [
        (None, "no value"),
        (np.nan, "no value"),
        (-np.inf, "no value"),
        (True, "yes"),
        (np.False_, "no"),
        (7, "7"),
        (np.int64(7), "7"),
        (0.1234567, "0.123457"),
        (np.float32(0.5), "0.5"),
        ("  a text", "  a text"),
    ],
)
def test_cells(value, text):
    assert cells.cell_text(value) == text


@pytest.mark.parametrize(
    "unit, plain, printed",
    [
        ("W sr-1", "W/sr", "W sr⁻¹"),
        ("W m-2", "W/m^2", "W m⁻²"),
        ("W m-2 sr-1", "W m^-2 sr^-1", "W m⁻² sr⁻¹"),
        ("W sr-1 um-1", "W sr^-1 um^-1", "W sr⁻¹ µm⁻¹"),
        ("m2", "m^2", "m²"),
        ("sr-1", "sr^-1", "sr⁻¹"),
        ("degree", "degree", "°"),
        ("K", "K", "K"),
        ("", "", ""),
    ],
)
def test_units_of_the_console_and_of_pages(unit, plain, printed):
    assert cells.plain_unit(unit) == plain
    assert cells.typeset_unit(unit) == printed


def test_headings_come_from_names():
    assert cells.heading("standard_error_W_sr") == ("standard error", "W sr-1")
    assert cells.words_of("wavelengths_um") == "wavelengths (µm)"
    assert cells.words_of("spp") == "spp"


def test_signs_of_print():
    assert cells.typeset("5 +- 2 W m^-2 at 3 m^2") == "5 ± 2 W m⁻² at 3 m²"


def test_entries_in_json_become_pairs():
    assert cells.unpacked('{"a": 1, "b": "x"}') == "a=1, b=x"
    assert cells.unpacked({}) == "none given"
    assert cells.unpacked("{no json") == "{no json"
    assert cells.unpacked("{" * 100_000) == "{" * 100_000


@pytest.mark.parametrize("text", ["1", "-1.5e-3", "1 +- 0.2", "no value", ""])
def test_numbers_are_known(text):
    assert cells.is_number(text)
    assert not cells.is_number(f"about {text}")

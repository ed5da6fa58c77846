"""The same sections as text and as HTML."""

import numpy as np
import pytest

from mi_lcair import sections
from mi_lcair.sections import Drawing, Facts, Lines, LongTable, Remarks, Section, Table


def undrawn():
    raise AssertionError("only a page draws")


SECTIONS = [
    Section(
        "first",
        [
            "A paragraph.",
            Facts([("a", 1.5), ("b", (2.0, 0.1))]),
            Drawing(undrawn),
            Remarks(["take care"]),
            LongTable({"x_m": np.arange(30)}),
        ],
    ),
    Section("second", [Table(["n", ("I", "W sr-1")], [[1, None]]), Lines("why", ["so", "<b>"])]),
    Section("third", [Facts([("c", 2)]), Remarks(["and here"])], is_detail=True),
]


def test_the_console_prints_facts_tables_and_lists():
    """Further facts follow the first ones. Paragraphs, drawings and details are for pages."""
    assert list(sections.blocks(SECTIONS, [("time", "1 s")])) == [
        [["a", "1.5"], ["b", "2 +- 0.1"], ["time", "1 s"]],
        [["n", "I W/sr"], ["1", "no value"]],
        [["why:"], ["  so"], ["  <b>"]],
    ]


def test_all_remarks_are_collected():
    assert sections.remarks(SECTIONS) == ["take care", "and here"]


@pytest.mark.parametrize(
    "part, content",
    [
        ("a < b, 3 +- 1", "<p>a &lt; b, 3 ± 1</p>"),
        (
            Facts([("a", (2.0, 0.1))]),
            '<div class="wide"><table class="facts"><tr><th scope="row">a</th><td>2 ± 0.1</td></tr>'
            "</table></div>",
        ),
        (
            Table(["n", ("I", "W sr-1")], [["<x>", 5.0]]),
            '<div class="wide"><table class="sortable"><thead><tr><th scope=col>n</th>'
            '<th scope=col class=number>I <span class="unit">W sr⁻¹</span></th></tr></thead>'
            "<tbody><tr><td>&lt;x&gt;</td><td class=number>5</td></tr></tbody></table></div>",
        ),
        (Table(["n"], []), '<div class="wide"><table class="sortable"><thead><tr>'
            "<th scope=col>n</th></tr></thead><tbody></tbody></table></div>"),
        (Lines("why", ["<so>"]), "<p>why</p><ul><li>&lt;so&gt;</li></ul>"),
        (Remarks([]), ""),
    ],
)  # fmt: skip
def test_html(part, content):
    assert sections.part_html(part) == content


def test_a_long_table_without_a_script_says_how_many_rows_follow():
    content = sections.part_html(LongTable({"x_m": np.arange(30)}))
    assert content.count("<tr>") == 1 + sections.MOST_ROWS
    assert content.endswith("<p>... and 18 more rows</p>")
    assert "more rows" not in sections.part_html(LongTable({"x_m": np.arange(12)}))


def test_lines_have_at_most_2000_characters():
    assert [len(sections.text_html("x" * length)) for length in (2000, 2001)] == [2000, 2000]


def test_a_drawing_needs_a_page():
    with pytest.raises(TypeError, match="a Drawing needs a page"):
        sections.part_html(Drawing(undrawn))


# Cells as text: digits, errors, units and the signs of print
# -----------------------------------------------------------


@pytest.mark.parametrize(
    "value, error, text",
    [
        (12.3456789, 0.0123, "12.346 +- 0.012"),
        (-0.00123456, 2.1e-6, "-0.0012346 +- 2.1e-06"),
        (5.0, 40.0, "5 +- 40"),
        (0.0, 0.1, "0 +- 0.1"),
        (22.07554321, 0.0, "22.0755 +- 0"),
        (1.0, np.nan, "1 +- no value"),
        (np.nan, 0.123456, "no value +- 0.12"),
        (1.23456789123, 1e-15, "1.23456789 +- 1e-15"),
    ],
)
def test_a_value_ends_at_the_second_digit_of_its_error(value, error, text):
    assert sections.cell_text((value, error)) == text


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
    assert sections.cell_text(value) == text


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
    assert sections.plain_unit(unit) == plain
    assert sections.typeset_unit(unit) == printed


def test_headings_come_from_names():
    assert sections.heading("standard_error_W_sr") == ("standard error", "W sr-1")
    assert sections.words_of("wavelengths_um") == "wavelengths (µm)"
    assert sections.words_of("spp") == "spp"


def test_signs_of_print():
    assert sections.typeset("5 +- 2 W m^-2 at 3 m^2") == "5 ± 2 W m⁻² at 3 m²"


def test_entries_in_json_become_pairs():
    assert sections.unpacked('{"a": 1, "b": "x"}') == "a=1, b=x"
    assert sections.unpacked({}) == "none given"
    assert sections.unpacked("{no json") == "{no json"
    assert sections.unpacked("{" * 100_000) == "{" * 100_000


@pytest.mark.parametrize("text", ["1", "-1.5e-3", "1 +- 0.2", "no value", ""])
def test_numbers_are_known(text):
    assert sections.is_number(text)
    assert not sections.is_number(f"about {text}")


def test_a_part_below_its_error_is_the_end_of_its_interval():
    assert sections.part_cell(3.0, 1.0) == (3.0, 1.0) and sections.part_cell(0.0, 0.0) == (0, 0)
    assert sections.part_cell(3.2e-7, 0.0083) == "< 0.016" and sections.is_number("< 0.016")
    assert sections.part_cell(1.0, 2.0, most=1.5) == "< 1.5"


def test_an_interval_far_wider_than_its_standard_errors_has_a_reason():
    assert sections.interval_rows(3.9, 1.0) == []
    ((label, reason),) = sections.interval_rows(37.0, 0.65)
    assert label == "interval" and "no path has hit" in reason

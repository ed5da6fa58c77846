"""The same sections as text and as HTML."""

import numpy as np
import pytest

from mi_lcair.results import cells, html
from mi_lcair.results.sections import (
    Drawing,
    Facts,
    Lines,
    LongTable,
    Remarks,
    Section,
    Table,
)


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
    assert list(cells.blocks(SECTIONS, [("time", "1 s")])) == [
        [["a", "1.5"], ["b", "2 +- 0.1"], ["time", "1 s"]],
        [["n", "I W/sr"], ["1", "no value"]],
        [["why:"], ["  so"], ["  <b>"]],
    ]


def test_all_remarks_are_collected():
    assert cells.remarks(SECTIONS) == ["take care", "and here"]


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
    assert html.part_html(part) == content


def test_a_long_table_without_a_script_says_how_many_rows_follow():
    content = html.part_html(LongTable({"x_m": np.arange(30)}))
    assert content.count("<tr>") == 1 + html.MOST_ROWS
    assert content.endswith("<p>... and 18 more rows</p>")
    assert "more rows" not in html.part_html(LongTable({"x_m": np.arange(12)}))


def test_a_drawing_needs_a_page():
    with pytest.raises(TypeError, match="a Drawing needs a page"):
        html.part_html(Drawing(undrawn))

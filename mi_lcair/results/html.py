"""Parts of sections as HTML, in which every text is escaped."""

from base64 import b64encode
from html import escape

import numpy as np

from mi_lcair.drawing import file_content
from mi_lcair.errors import printable
from mi_lcair.results.cells import cell_text, heading, is_number, typeset, typeset_unit
from mi_lcair.results.sections import Facts, Lines, LongTable, Part, Picture, Remarks, Table

LONGEST = 2000  # characters of a line
MOST_ROWS = 12  # rows that are shown of a long table without a script


def part_html(part: Part) -> str:
    """The HTML of a part of a section. It does not need a script."""
    match part:
        case str():
            return f"<p>{text_html(part)}</p>"
        case Facts(rows):
            return _wide("facts", "".join(map(_fact, rows)))
        case Table(columns, rows):
            return table(columns, rows)
        case Lines(title, lines):
            return (f"<p>{text_html(title)}</p>" if title else "") + _list(lines)
        case Remarks(lines):
            return _list(lines)
        case LongTable(columns):
            return first_rows(columns)
        case Picture():
            data = b64encode(file_content(part.draw(), ".svg")).decode()
            return f'<img alt="{text_html(part.title)}" src="data:image/svg+xml;base64,{data}">'
    raise TypeError(f"a {type(part).__name__} needs a page")


def text_html(text: object) -> str:
    """A text for HTML: one line, with the signs of print and no markup of its own."""
    return escape(typeset(printable(text, LONGEST)))


def table(columns, rows) -> str:
    """A table that a click on a heading sorts. Columns of numbers are aligned on the right."""
    cells = [[cell_text(value) for value in row] for row in rows]
    right = [all(map(is_number, column)) for column in zip(*cells)] or [False] * len(columns)
    head = "".join(
        f"<th scope=col{_aligned(column)}>{_heading(name)}</th>"
        for name, column in zip(columns, right)
    )

    def in_html(row):
        return "".join(f"<td{_aligned(r)}>{text_html(cell)}</td>" for cell, r in zip(row, right))

    body = "".join(f"<tr>{in_html(row)}</tr>" for row in cells)
    return _wide("sortable", f"<thead><tr>{head}</tr></thead><tbody>{body}</tbody>")


def first_rows(columns: dict[str, np.ndarray]) -> str:
    """A table of the first MOST_ROWS rows of columns by name, which says how many follow."""
    rows = list(zip(*columns.values()))
    more = len(rows) - MOST_ROWS
    note = f"<p>... and {more} more rows</p>" if more > 0 else ""
    return table([heading(name) for name in columns], rows[:MOST_ROWS]) + note


def _heading(name) -> str:
    words, unit = name if isinstance(name, tuple) else (name, "")
    span = f' <span class="unit">{escape(typeset_unit(unit))}</span>' if unit else ""
    return text_html(words) + span


def _aligned(right: bool) -> str:
    return " class=number" if right else ""


def _fact(row) -> str:
    label, value = row
    return f'<tr><th scope="row">{text_html(label)}</th><td>{text_html(cell_text(value))}</td></tr>'


def _wide(kind: str, rows: str) -> str:
    return f'<div class="wide"><table class="{kind}">{rows}</table></div>'


def _list(lines) -> str:
    items = "".join(f"<li>{text_html(line)}</li>" for line in lines)
    return f"<ul>{items}</ul>" if items else ""

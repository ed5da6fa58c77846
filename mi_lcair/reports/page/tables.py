"""Tables of a page: short ones as HTML, long ones as a panel with sorting and pages."""

import json
from html import escape

import numpy as np

from mi_lcair.errors import printable
from mi_lcair.reports.page.page import Panel
from mi_lcair.results.units import quantity_of, unit_of
from mi_lcair.table import NUMBER

NO_VALUE = "no value"
LONGEST_CELL = 2000  # characters
# Units as people write them, by UDUNITS' parts
WRITTEN = {"m2": "m²", "um": "µm", "degree": "°"}
SUPERSCRIPT = str.maketrans("-123456789", "⁻¹²³⁴⁵⁶⁷⁸⁹")


def heading(name: str) -> tuple[str, str]:
    """Words and unit of a column or entry from its name, such as ("intensity", "W sr⁻¹")."""
    return quantity_of(name), written(unit_of(name))


def written(unit: str) -> str:
    """A unit of UDUNITS as people write it, such as "W sr⁻¹" for "W sr-1"."""
    parts = (part.partition("-") for part in unit.split())
    return " ".join(
        WRITTEN.get(base, base) + (minus + power).translate(SUPERSCRIPT)
        for base, minus, power in parts
    )


def words_of(name: str) -> str:
    """Words of a column or entry with its unit, such as "wavelengths (µm)"."""
    words, unit = heading(name)
    return f"{words} ({unit})" if unit else words


def number(value, digits: int = 6) -> str:
    """A number as text; `no value` for None, NaN and infinite ones."""
    if value is None or isinstance(value, (float, np.floating)) and not np.isfinite(value):
        return NO_VALUE
    if isinstance(value, (bool, np.bool_)):
        return "yes" if value else "no"
    if isinstance(value, (int, np.integer)):
        return str(value)
    if isinstance(value, (float, np.floating)):
        return f"{value:.{digits}g}"
    return printable(value, LONGEST_CELL)


def with_error(value, error) -> str:
    """A value with its standard error as text, to the second digit of the error."""
    return f"{number(value, digits_for(value, error))} ± {number(error, 2)}"


def digits_for(value, error) -> int:
    """Significant digits of a value that end at the second digit of its error, 2 to 9."""
    if not (value and error and np.isfinite(value) and np.isfinite(error)):
        return 6
    size = lambda x: int(np.floor(np.log10(abs(x))))
    return min(max(size(value) - size(error) + 2, 2), 9)


def table(columns, rows, caption: str = "") -> str:
    """A table as HTML that a click on a heading sorts.

    columns: headings, as texts or as (words, unit). rows: sequences of cells; numbers are aligned
    on the right. Texts are escaped.
    """
    heads = [column if isinstance(column, tuple) else (column, "") for column in columns]
    rows = [list(row) for row in rows]
    right = [all(map(is_number, column)) for column in zip(*rows)] or [False] * len(heads)
    head = "".join(
        f"<th scope=col{' class=number' if aligned else ''}>{escape(printable(words))}"
        + (f' <span class="unit">{escape(unit)}</span></th>' if unit else "</th>")
        for (words, unit), aligned in zip(heads, right)
    )
    body = "".join(
        "<tr>"
        + "".join(
            f"<td{' class=number' if aligned else ''}>{escape(number(value))}</td>"
            for value, aligned in zip(row, right)
        )
        + "</tr>"
        for row in rows
    )
    name = f"<caption>{escape(caption)}</caption>" if caption else ""
    return (
        f'<div class="wide"><table class="sortable">{name}<thead><tr>{head}</tr></thead>'
        f"<tbody>{body}</tbody></table></div>"
    )


def is_number(value) -> bool:
    """Whether a cell is a number, also with its error, or has no value."""
    return not isinstance(value, str) or NUMBER.fullmatch(value.partition(" ± ")[0]) is not None


def unpacked(value):
    """An entry as a cell: objects, also as JSON, as `key=value` pairs."""
    if isinstance(value, str) and value.startswith("{"):
        try:
            value = json.loads(value)
        except (ValueError, RecursionError):
            return value
    if isinstance(value, dict):
        return ", ".join(f"{key}={item}" for key, item in value.items()) or "none given"
    return value


def facts(rows, caption: str = "") -> str:
    """A table of (label, value) as HTML."""
    body = "".join(
        f'<tr><th scope="row">{escape(printable(name))}</th><td>{escape(number(value))}</td></tr>'
        for name, value in rows
    )
    name = f"<caption>{escape(caption)}</caption>" if caption else ""
    return f'<div class="wide"><table class="facts">{name}<tbody>{body}</tbody></table></div>'


def listed(lines) -> str:
    """Lines of text as a list in HTML."""
    items = "".join(f"<li>{escape(printable(line, LONGEST_CELL))}</li>" for line in lines)
    return f"<ul>{items}</ul>" if items else ""


def long_table(columns: dict[str, np.ndarray], sort_by: str | None = None) -> Panel:
    """A panel with a table of many rows, which is sorted and turned page by page.

    columns: arrays of numbers or texts by name with unit. sort_by: name of the column whose
    largest values come first.
    """
    return Panel(
        "table",
        {"columns": [column_data(*item) for item in columns.items()], "sort": sort_by},
        height=300,
    )


def column_data(name: str, values) -> dict:
    """A column for the scripts: numbers as they are, texts as numbers of a list of names."""
    values = np.asarray(values)
    words, unit = heading(name)
    entries = {"name": name, "title": words, "unit": unit}
    if values.dtype.kind == "b":
        values = np.where(values, "yes", "no")
    if values.dtype.kind in "fiu":
        return entries | {"values": values if values.dtype.kind == "f" else values.astype(int)}
    names, codes = np.unique(values.astype(str), return_inverse=True)
    return entries | {"values": codes, "names": [printable(text) for text in names]}

"""Sections of a result, which the console prints as text and a page as HTML.

A part of a section is a text (a paragraph, on pages only) or one of the classes below. Cells are
texts, numbers, None for a missing value, or pairs (value, standard error). Units are written as
UDUNITS has them, such as "W sr-1".
"""

import json
import re
from base64 import b64encode
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from typing import Any

import numpy as np

from mi_lcair.declared import percent
from mi_lcair.drawing import file_content
from mi_lcair.errors import option, printable
from mi_lcair.estimate import with_error
from mi_lcair.table import NUMBER

Heading = str | tuple[str, str]  # words, or words and unit


@dataclass(frozen=True)
class Facts:
    """Rows of a label and its value."""

    rows: list[tuple[str, Any]]


@dataclass(frozen=True)
class Table:
    """A short table: headings, and rows of cells."""

    columns: list[Heading]
    rows: list

    @staticmethod
    def of(columns: Mapping[str, Sequence]) -> "Table":
        """The table of columns by name with the unit.

        The errors `x_error_K` stand beside the values `x_K`. Other errors have two digits.
        """
        made = {}
        for name, values in columns.items():
            if (of := re.sub("_(standard_)?error", "", name)) != name and of in made:
                made[of] = list(zip(made[of], values))
            elif of != name or name.startswith("sigma"):
                made[name] = [f"{value:.2g}" for value in values]
            else:
                made[name] = values
        return Table(list(map(heading, made)), list(zip(*made.values())))


@dataclass(frozen=True)
class Lines:
    """A list of sentences below a title."""

    title: str
    lines: list[str]


@dataclass(frozen=True)
class Remarks:
    """What a user should know about a result. The console prints it on stderr."""

    lines: list[str]


@dataclass(frozen=True)
class LongTable:
    """A table of many rows, which pages sort and turn, and the console leaves out.

    columns: arrays of numbers or texts by name with unit. sort_by: name of the column whose largest
    values come first.
    """

    columns: dict[str, np.ndarray]
    sort_by: str | None = None


@dataclass(frozen=True)
class Drawing:
    """A drawing of a page. `panel` makes it, and is called only when a page is written."""

    panel: Callable[[], Any]


class Picture:
    """A picture. On a page it is drawn by a script if it has a method `panel`.

    title: what it shows, also for readers who cannot see it.
    """

    title: str

    def draw(self) -> Any:
        """The picture as a Matplotlib Figure."""
        raise NotImplementedError


@dataclass(frozen=True)
class OwnPicture(Picture):
    """A picture that is like no other. `figure` makes the Matplotlib Figure."""

    title: str
    figure: Callable[[], Any]

    def draw(self) -> Any:
        return self.figure()


Part = str | Facts | Table | Lines | Remarks | LongTable | Drawing | Picture


@dataclass(frozen=True)
class Section:
    """A section of a result: its heading as plain text, and its parts.

    is_detail: pages show it and the console does not.
    """

    title: str
    parts: list[Part]
    is_detail: bool = False


# Sections, cells and headings as text, and the units that the ends of columns' names state
# -----------------------------------------------------------------------------------------

NO_VALUE = "no value"
NORMAL = 1.96  # standard errors to the end of a 95 % interval
FAR = 2  # ratio of an interval to that from which it is explained
# Units as pages write them, by UDUNITS' parts
WRITTEN = {"m2": "m²", "um": "µm", "degree": "°"}
SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
# End of a column's name: its unit as UDUNITS, and so xarray and netCDF, write it.
UNITS = {
    "_W_m2_sr_um": "W m-2 sr-1 um-1",
    "_W_m2_sr": "W m-2 sr-1",
    "_W_sr_um": "W sr-1 um-1",
    "_W_sr": "W sr-1",
    "_W_m2": "W m-2",
    "_W": "W",
    "_mK": "mK",
    "_K": "K",
    "_m2": "m2",
    "_km": "km",
    "_um": "um",
    "_m": "m",
    "_per_sr": "sr-1",
    "_sr": "sr",
    "_deg": "degree",
    "_ms": "ms",
    "_s": "s",
}


def heading(name: str) -> tuple[str, str]:
    """Words and UDUNITS unit of a column from its name, such as ("intensity", "W sr-1")."""
    return quantity_of(name), unit_of(name)


def words_of(name: str) -> str:
    """Words of a column or entry with its unit as pages write it, such as "wavelengths (µm)"."""
    words, unit = heading(name)
    return f"{words} ({typeset_unit(unit)})" if unit else words


def typeset_unit(unit: str) -> str:
    """A unit of UDUNITS as pages write it, such as "W sr⁻¹" for "W sr-1"."""
    parts = (part.partition("-") for part in unit.split())
    return " ".join(
        WRITTEN.get(base, base) + (minus + power).translate(SUPERSCRIPT)
        for base, minus, power in parts
    )


def plain_unit(unit: str) -> str:
    """A unit of UDUNITS in ASCII, such as "W/sr" for "W sr-1", and "W m^-2 sr^-1"."""
    top, _, below = unit.partition(" ")
    if re.fullmatch(r"[a-z]+-\d", below):
        name, power = below.split("-")
        return f"{top}/{name}" + (f"^{power}" if power != "1" else "")
    return re.sub(r"(?<=[a-z])(-?\d)", r"^\1", unit)


def typeset(text: str) -> str:
    """A text in ASCII with the signs of print: ± for +-, and exponents raised."""
    raised = re.sub(r"\^(-?\d)", lambda power: power[1].translate(SUPERSCRIPT), text)
    return raised.replace("+-", "±")


def cell_text(value: object, digits: int = 6) -> str:
    """A cell as text in ASCII: numbers with `digits`, pairs (value, standard error) with +-."""
    if isinstance(value, tuple):
        number, error = value
        if None not in value and np.isfinite(value).all():
            return with_error(number, error)
        texts = cell_text(number), cell_text(error, 2)
        return NO_VALUE if set(texts) == {NO_VALUE} else " +- ".join(texts)
    if value is None or isinstance(value, (float, np.floating)) and not np.isfinite(value):
        return NO_VALUE
    if isinstance(value, (bool, np.bool_)):
        return "yes" if value else "no"
    if isinstance(value, (float, np.floating)):
        return f"{value:.{digits}g}"
    return str(value)


def is_number(text: str) -> bool:
    """Whether a cell's text is a number, also with its error, or says that there is none."""
    number = text.removeprefix("< ").partition(" +- ")[0]
    return text in (NO_VALUE, "") or NUMBER.fullmatch(number) is not None


def part_cell(value: float, error: float, most: float = np.inf) -> object:
    """A part that is 0 or more, and its standard error, as a cell.

    If the error is larger than the part, the cell is the end of its 95 % interval. most: that of
    the whole, which is never exceeded.
    """
    return f"< {min(value + NORMAL * error, most):.2g}" if value < error else (value, error)


def unpacked(value: object) -> object:
    """An entry as a cell: objects, also as JSON, as `key=value` pairs."""
    if isinstance(value, str) and value.startswith("{"):
        try:
            value = json.loads(value)
        except (ValueError, RecursionError):
            return value
    if isinstance(value, dict):
        return ", ".join(f"{key}={item}" for key, item in value.items()) or "none given"
    return value


def unit_of(name: str) -> str:
    """Unit of the column `name`, such as "W sr-1"; "" for a number without one."""
    return next((unit for end, unit in UNITS.items() if name.endswith(end)), "")


def quantity_of(name: str) -> str:
    """What the column `name` holds, in words: the name without its unit."""
    end = next((end for end in UNITS if name.endswith(end)), "")
    return name.removesuffix(end).replace("_", " ")


def interval(half_width: float, value: float, unit: str, of: str, absolute: bool = False) -> str:
    """The 95 % interval of a value in words, as a fraction of the value if it is not zero.

    `half_width` is half of the interval. `of` names the value, such as "the target's intensity".
    `absolute`: state the half width in its unit too.
    """
    width = f"{half_width:.2g} {unit}"
    if half_width >= abs(value):
        return f"the 95 % interval is +- {width}, and {of} may be zero"
    fraction = percent(half_width / abs(value))
    return f"the 95 % interval is +- {f'{width}, ' if absolute else ''}{fraction} of {of}"


def interval_rows(half_width: float, error: float) -> list[tuple[str, str]]:
    """Row that says why half a 95 % interval is far more than 1.96 standard errors, if it is."""
    if half_width <= FAR * NORMAL * error:
        return []
    reason = "it includes a bound for sources that no path has hit, and the standard error does not"
    return [("interval", f"wider than 1.96 standard errors: {reason}; trace more paths")]


def error_row(
    error: str,
    tolerance: float | str | None = None,
    reached: bool | None = None,
    where: str = "",
    remedy: str = "",
) -> tuple[str, str]:
    """Row (label, text) of `Facts`: the error of a result and whether it was allowed.

    Parameters
    ----------
    error : str
        The error in words, see `interval`.
    tolerance : float or str or None
        Allowed error, a fraction or in words. Without one, the row only states the error.
    reached : bool or None
        Whether the tolerance was reached.
    where : str
        Which of several results reached it.
    remedy : str
        What to do if it was not reached; by default to raise max_spp.
    """
    if tolerance is None:
        return "error", error
    allowed = tolerance if isinstance(tolerance, str) else f"{100 * tolerance:.4g} %"
    where = f" {where}" if where else ""
    remedy = remedy or f"raise {option('max_spp')}"
    if reached:
        return "tolerance", f"{allowed} reached{where}: {error}"
    return "tolerance", f"{allowed} NOT reached{where}: {error}; {remedy}"


def blocks(sections: list[Section], rows=()) -> Iterator[list[list[str]]]:
    """Yield the facts, tables and lists of sections as rows of texts, without their details.

    rows: further facts (label, value), which follow the first ones.
    """
    parts = list(parts_of(section for section in sections if not section.is_detail))
    for part in parts:
        match part:
            case Facts():
                yield [[label, cell_text(value)] for label, value in [*part.rows, *rows]]
                rows = ()
            case Table():
                head = [heading_text(column) for column in part.columns]
                yield [head, *([cell_text(cell) for cell in row] for row in part.rows)]
            case Lines(title, lines):
                head = [[f"{title}:"]] if title else []
                yield head + [[f"  {line}" if title else line] for line in lines]


def remarks(sections: list[Section]) -> list[str]:
    """The remarks of all sections."""
    remarks = [part for part in parts_of(sections) if isinstance(part, Remarks)]
    return [line for part in remarks for line in part.lines]


def parts_of(sections) -> Iterator[Part]:
    """Yield the parts of all sections."""
    return (part for section in sections for part in section.parts)


def heading_text(heading: Heading) -> str:
    """A heading of a table with its unit, such as "target W/sr"."""
    if isinstance(heading, str):
        return heading
    words, unit = heading
    return f"{words} {plain_unit(unit)}".rstrip()


# Parts of sections as HTML, in which every text is escaped
# ---------------------------------------------------------

LONGEST_TABLE = 2000  # characters of a line
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
    return escape(typeset(printable(text, LONGEST_TABLE)))


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

"""Sections as rows of text, which the console aligns in columns."""

from collections.abc import Iterator

from mi_lcair.results.cells import cell_text, plain_unit
from mi_lcair.results.sections import Facts, Heading, Lines, Part, Remarks, Section, Table


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

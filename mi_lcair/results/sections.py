"""Sections of a result, which the console prints as text and a page as HTML.

A part of a section is a text (a paragraph, on pages only) or one of the classes below. Cells are
texts, numbers, None for a missing value, or pairs (value, standard error). Units are written as
UDUNITS has them, such as "W sr-1".
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

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
    def of(columns: dict[Heading, tuple[Iterable, str]]) -> "Table":
        """The table of columns by heading: their values, and the format of these."""
        cells = ([format(value, how) for value in values] for values, how in columns.values())
        return Table([*columns], list(zip(*cells)))


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

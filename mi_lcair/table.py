"""Tables in text files with one header line, rows of cells and `#` comments.

Comma, semicolon and tab are allowed as separators, point and comma as decimal marks. All tables of
a user are read by this module. `safe_cell` gives text cells for files that a spreadsheet may open.
"""

import csv
import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from mi_lcair.declared import Bounds, listed
from mi_lcair.errors import InputError, escaped, shown
from mi_lcair.files import read_text

NUMBER = re.compile(r"[+-]?([0-9]+([.,][0-9]*)?|[.,][0-9]+)([eE][+-]?[0-9]+)?")
NO_VALUE = ("", "nan", "n/a", "na", "-")  # cells that mean a missing value
SEPARATORS = {"\t": "tab", ";": "semicolon", ",": "comma"}
# Largest value of a quantity in a table. It is above a blackbody's spectral radiance at 40,000 K.
LARGEST = 1e12
FARTHEST = 1e30  # largest absolute value of a number; products of larger numbers may overflow
FORMULA = ("=", "+", "-", "@")  # first characters of a cell that a spreadsheet takes for a formula


@dataclass
class TextTable:
    """The cells of a table as text.

    file: name of the file in messages. columns: names of the columns. rows: line number and cells
    of each row. header: value and line number of each key in the header. separator: the separator
    of the cells. is_astm: whether it is an ASTM file, which uses radians and allows any name for
    the value column. Raises InputError for a table without rows, and for a row with more or fewer
    cells than columns.
    """

    file: str
    columns: list[str]
    rows: list[tuple[int, list[str]]]
    header: dict[str, tuple[str, int]] = field(default_factory=dict)
    separator: str = ","
    is_astm: bool = False

    def __post_init__(self):
        if not self.rows:
            raise InputError(f"{self.file}: no rows of data below its header")
        for number, cells in self.rows:
            if len(cells) != len(self.columns):
                hint = (
                    "; a decimal comma needs semicolons or tabs between the cells"
                    if self.separator == ","
                    else ""
                )
                raise InputError(
                    f"{self.file}, line {number}: {len(cells)} cells where the header names "
                    f"{len(self.columns)}{hint}"
                )

    def numbers(self, columns, may_lack: bool = False) -> dict[str, np.ndarray]:
        """The named columns as Float64 arrays, by name.

        may_lack: accept empty cells and `nan` as missing values, which become NaN. Raises
        InputError, with the line, for any other cell that is not a number up to FARTHEST.
        """
        marks = {}  # decimal mark: the first line that has it
        values = {}
        for column in columns:
            place, numbers = self.columns.index(column), np.empty(len(self.rows))
            for row, (number, cells) in enumerate(self.rows):
                cell = cells[place]
                if "," in cell:
                    marks.setdefault(",", number)
                elif "." in cell:
                    marks.setdefault(".", number)
                if NUMBER.fullmatch(cell):
                    numbers[row] = float(cell.replace(",", "."))
                    if abs(numbers[row]) <= FARTHEST:
                        continue
                elif may_lack and cell.lower() in NO_VALUE:
                    numbers[row] = np.nan
                    continue
                raise InputError(
                    f"{self.file}, line {number}: {shown(cell)} in column "
                    f"'{column}' is not a number"
                )
            values[column] = numbers
        if len(marks) == 2:
            raise InputError(
                f"{self.file}: which is the decimal mark? line {marks['.']} has a point, "
                f"line {marks[',']} a comma; use one of them throughout"
            )
        return values

    def check_range(self, column: str, values, bounds: Bounds, hint: str = "") -> None:
        """Raise InputError, with the line, for a value that is missing or out of bounds."""
        line = f"{self.file}, line {{}}: {column}"
        bounds.check_all(values, lambda row: line.format(self.rows[row][0]), hint)


def read_table(path: str | Path, needed, kind: str = "") -> TextTable:
    """The table in a CSV file whose header names at least the columns `needed`.

    kind: words before the path in messages. Raises InputError for a file without such a table. The
    message quotes the header only if it names one of the columns. Otherwise the file may be of
    another kind, and its first line could be confidential.
    """
    file = f"{kind} {path}".strip()
    text = read_text(path, file)
    columns = header_of(file, text, needed)
    if not set(needed) <= set(columns):
        named = ", ".join(columns) if set(needed) & set(columns) else "none of them"
        raise InputError(
            f"{file}: the header must name {listed(needed)}; "
            f"found: {named if columns else 'nothing'}"
        )
    return parse_csv(file, text, has_keys=False)


def header_of(file: str, text: str, needed) -> list[str]:
    """Names in the first line that is not a comment; an empty list if there is no such line."""
    for number, line in lines_of(text):
        if not line.lstrip().startswith("#"):
            return column_names(file, number, line, needed)[0]
    return []


def column_names(file: str, number: int, line: str, example) -> tuple[list[str], str]:
    """The columns that a header line names, and the separator between them."""
    separator = next((mark for mark in SEPARATORS if mark in line), ",")
    columns = split(file, number, line, separator)
    if not columns or any(NUMBER.fullmatch(cell) for cell in columns):
        raise InputError(
            f"{file}, line {number}: no header line; name the columns, such as {','.join(example)}"
        )
    return columns, separator


def lines_of(text: str):
    """(line number from 1, line) of each line that is not blank."""
    return (
        (number, line)
        for number, line in enumerate(re.split(r"\r\n|\r|\n", text), 1)
        if line.strip()
    )


def split(file: str, number: int, line: str, separator: str, width: int = 0) -> list[str]:
    """The cells of a line, without quotes and surrounding blanks.

    Empty cells at the end are left out if the line has more than `width` cells.
    """
    try:
        cells = [
            cell.strip()
            for cell in next(csv.reader([line], delimiter=separator, skipinitialspace=True))
        ]
    except (csv.Error, StopIteration):
        raise InputError(f"{file}, line {number}: cannot be split into cells") from None
    while len(cells) > width and not cells[-1]:
        cells.pop()
    return cells


def parse_csv(file: str, text: str, has_keys: bool = True) -> TextTable:
    """The table in the text of a CSV file.

    file: name of the file in messages. has_keys: comments of the form `# key: value` are keys of
    the header.
    """
    header, rows, columns = {}, [], None
    for number, line in lines_of(text):
        if line.lstrip().startswith("#"):
            key, colon, value = line.lstrip().lstrip("#").partition(":")
            if colon and has_keys:
                set_key(file, header, key, value, number)
        elif columns is None:
            columns, separator = column_names(
                file, number, line, ("theta_i_deg", "theta_r_deg", "brdf_per_sr")
            )
        elif any(cells := split(file, number, line, separator, len(columns))):
            rows.append((number, cells))
    if columns is None:
        raise InputError(f"{file}: nothing but comments; expected a header line and rows")
    if twice := {column for column in columns if columns.count(column) > 1}:
        raise InputError(f"{file}: column {shown(min(twice))} appears twice; which one is meant?")
    return TextTable(file, columns, rows, header, separator)


def set_key(file: str, header: dict, key: str, value: str, number: int) -> None:
    """Set a key of the header, in lower case; raises InputError if an earlier line differs."""
    key, value = "_".join(key.lower().split()), value.strip()
    earlier, line = header.setdefault(key, (value, number))
    if earlier != value:
        raise InputError(
            f"{file}, line {number}: {shown(key)} differs from line {line}; keep one of them"
        )


def safe_cell(text: str) -> str:
    """Text for a cell of a table, which no spreadsheet takes for a formula.

    A text that looks like a formula gets a quote in front.
    """
    text = escaped(text)
    return f"'{text}" if text.startswith(FORMULA) else text


def rows_at(places: ArrayLike, knots: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Rows between rising knots: linear, and constant outside.

    places: (...). knots: (n,). rows: (n, ...), one for each knot.
    """
    place = np.asarray(np.interp(places, knots, np.arange(len(knots))))
    low = np.minimum(place.astype(int), max(len(knots) - 2, 0))
    share = (place - low).reshape(*place.shape, *[1] * (np.ndim(rows) - 1))
    return (1 - share) * rows[low] + share * rows[np.minimum(low + 1, len(knots) - 1)]

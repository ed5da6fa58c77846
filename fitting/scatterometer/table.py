"""Measurement files as text: named columns and `# key: value` comments, with any usual separator
and decimal mark.
"""

import csv
import hashlib
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mi_lcair.errors import InputError

NUMBER = re.compile(r"[+-]?(\d+([.,]\d*)?|[.,]\d+)([eE][+-]?\d+)?")
SEPARATORS = {"\t": "tab", ";": "semicolon", ",": "comma"}


@dataclass
class Table:
    """The cells of a file as text, with the line numbers of their rows, and the header's keys:
    (value, line number).

    is_astm: an ASTM file has its own conventions (radians, a value column of any name).
    """

    file: str
    columns: list[str]
    rows: list[tuple[int, list[str]]]
    header: dict[str, tuple[str, int]]
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

    def numbers(self, columns: list[str]) -> dict[str, np.ndarray]:
        """The named columns as Float64; InputError, with the line, for a cell that is no finite
        number.
        """
        marks = {}  # decimal mark: the first line that has it
        values = {column: np.empty(len(self.rows)) for column in columns}
        for row, (number, cells) in enumerate(self.rows):
            for column in columns:
                cell = cells[self.columns.index(column)]
                value = float(cell.replace(",", ".")) if NUMBER.fullmatch(cell) else np.nan
                if not np.isfinite(value):
                    raise InputError(
                        f"{self.file}, line {number}: {shown(cell)} in column '{column}' is not a number"
                    )
                for mark in ".,":
                    if mark in cell:
                        marks.setdefault(mark, number)
                values[column][row] = value
        if len(marks) == 2:
            raise InputError(
                f"{self.file}: which is the decimal mark? line {marks['.']} has a point, line {marks[',']} a "
                f"comma; use one of them throughout"
            )
        return values


def shown(text: str) -> str:
    """A piece of a file as an error message quotes it: one line, not too long."""
    return repr(text if len(text) <= 30 else text[:27] + "...")


def read_text(path: Path) -> tuple[str, str]:
    """A file's text (UTF-8, or Latin-1 where it is not) and the SHA-256 of its bytes; InputError if
    it is no text.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: {error.strerror}") from None
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    if re.search(r"[\x00-\x08\x0e-\x1f\x7f-\x9f]", text):
        raise InputError(
            f"{path}: not a text file; save the measurements as CSV (UTF-8) or ASTM E1392 text"
        )
    if not text.strip():
        raise InputError(f"{path}: the file is empty")
    return text, hashlib.sha256(data).hexdigest()


def lines_of(text: str):
    """(line number from 1, line) of each line that is not blank."""
    return (
        (number, line)
        for number, line in enumerate(re.split(r"\r\n|\r|\n", text), 1)
        if line.strip()
    )


def split(file: str, number: int, line: str, separator: str) -> list[str]:
    """The cells of a line, without quotes, blanks around them, and empty ones at the end."""
    try:
        cells = [
            cell.strip()
            for cell in next(csv.reader([line], delimiter=separator, skipinitialspace=True))
        ]
    except (csv.Error, StopIteration):
        raise InputError(f"{file}, line {number}: cannot be split into cells") from None
    while cells and not cells[-1]:
        cells.pop()
    return cells


def parse_csv(file: str, text: str) -> Table:
    """The table in a CSV file: `# key: value` comments, one header line, rows separated by comma,
    semicolon or tab.
    """
    header, rows, columns = {}, [], None
    for number, line in lines_of(text):
        if line.lstrip().startswith("#"):
            key, colon, value = line.lstrip().lstrip("#").partition(":")
            if colon:
                set_key(file, header, key, value, number)
        elif columns is None:
            separator = next((mark for mark in SEPARATORS if mark in line), ",")
            columns = split(file, number, line, separator)
            if not columns or any(NUMBER.fullmatch(cell) for cell in columns):
                raise InputError(
                    f"{file}, line {number}: no header line; name the columns, such as "
                    f"theta_i_deg,theta_r_deg,brdf_per_sr"
                )
        elif cells := split(file, number, line, separator):
            rows.append((number, cells))
    if columns is None:
        raise InputError(f"{file}: nothing but comments; expected a header line and rows")
    if twice := {column for column in columns if columns.count(column) > 1}:
        raise InputError(f"{file}: column {shown(min(twice))} appears twice; which one is meant?")
    return Table(file, columns, rows, header, separator)


def set_key(file: str, header: dict, key: str, value: str, number: int) -> None:
    """Enter a key of the header, in lower case; InputError where it contradicts an earlier line."""
    key, value = "_".join(key.lower().split()), value.strip()
    earlier, line = header.setdefault(key, (value, number))
    if earlier != value:
        raise InputError(
            f"{file}, line {number}: {shown(key)} differs from line {line}; which one holds?"
        )

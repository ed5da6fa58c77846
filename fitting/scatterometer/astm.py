"""Reader of ASTM E1392 and E2387 text files.

A file has lines `KEY value` (one of them NUM_POINTS), a line VARS with the names of the columns,
and rows of numbers separated by commas.
"""

import re

from mi_lcair.errors import InputError, shown
from mi_lcair.table import TextTable, lines_of, set_key, split

VARS = re.compile(r"^VARS\b", re.MULTILINE)


def is_astm(text: str) -> bool:
    """Whether a text is in this format, which is recognised by its line VARS."""
    return VARS.search(text) is not None


def parse_astm(file: str, text: str) -> TextTable:
    """The table in the text of an ASTM file; the header's keys are in lower case.

    Raises InputError if NUM_POINTS is not the number of rows, or a column's name appears twice.
    """
    header, rows, columns = {}, [], None
    for number, line in lines_of(text):
        if line.startswith("#"):
            continue
        if columns is not None:
            rows.append((number, split(file, number, line, ",")))
        elif VARS.match(line):
            columns = split(file, number, line.removeprefix("VARS").strip().strip('"'), ",")
        else:
            key, _, value = line.strip().partition(" ")
            set_key(file, header, key, value.strip().strip('"'), number)
    if twice := {column for column in columns if columns.count(column) > 1}:
        raise InputError(f"{file}: VARS names {shown(min(twice))} twice; which one is meant?")
    points, number = header.get("num_points", (str(len(rows)), 0))
    if points != str(len(rows)):
        raise InputError(
            f"{file}, line {number}: NUM_POINTS is {shown(points)}, but {len(rows)} rows follow "
            "VARS; is the file complete?"
        )
    return TextTable(file, columns, rows, header, is_astm=True)

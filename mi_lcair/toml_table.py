"""Dataclasses from the tables of a TOML file, with one line about what cannot be used."""

import json
import os
import re
from collections.abc import Mapping
from dataclasses import MISSING, fields
from datetime import date
from pathlib import Path
from typing import Literal, get_args, get_origin

import numpy as np

from mi_lcair.declared import required
from mi_lcair.errors import InputError, check_known, errors_of, shortened, unknown
from mi_lcair.files import parse_toml, read_text

EXPECTED = {
    str: "a text",
    float: "a finite number",
    int: "a whole number",
    bool: "true or false",
    dict: "a table",
    date: "a date without quotes, such as 2026-06-21",
}
# Tables by which a file is known that was given to the command of another kind
TELLING = {
    "scenario": ("observer", "atmosphere", "background", "surroundings", "sensor", "camera"),
    "sweep": ("base", "conditions"),
    "data set": ("views", "draws", "bands", "frames", "splits"),
    "cavity": ("shape", "wall"),
    "heat balance": ("weather", "groups"),
    "inversion": ("data", "unknowns"),
}
SMALLEST, LARGEST = 1e-30, 1e12  # sizes of numbers whose squares and ratios stay finite
SIZES = f"{SMALLEST:g}..{LARGEST:g}"


def check_tables(known, tree: Mapping) -> None:
    """Raise an InputError if a file has other tables than the known ones.

    It names the kind of file that has these tables.
    """
    names = [name for name in tree if name not in known]
    owners = [(each, kind) for each in names for kind, of in TELLING.items() if each in of]
    if names:
        hint = "; [{}] is a table of a {}".format(*owners[0]) if owners else ""
        raise InputError(f"{unknown('table', names[0], known)}{hint}")


def read(source, of, kind: str):
    """Read a TOML file, or a dictionary of its tables, and build the result with `of`.

    of: function of (tables, folder, name). kind: what the file is, such as "sweep"; also the name
    of a dictionary. Paths in a file are relative to its folder, those of a dictionary to the
    working folder. The message of an InputError names the file.
    """
    if isinstance(source, Mapping):
        with errors_of(kind):
            return of(plain(source), Path(), kind)
    path, what = Path(source), f"{kind} '{source}'"
    tables = parse_toml(read_text(path, what), what)
    with errors_of(what):
        return of(tables, path.parent, path.stem)


def plain(value):
    """A value of Python as TOML has it: without NumPy's types, tuples and paths."""
    if isinstance(value, Mapping):
        return {key: plain(entry) for key, entry in value.items()}
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    if isinstance(value, list | tuple):
        return [plain(entry) for entry in value]
    return os.fspath(value) if isinstance(value, os.PathLike) else value


def filled(kind, values, where: str, folder: Path | None = None):
    """The dataclass `kind` with the values of a table.

    `where` names the table in messages. folder: that of the files which it names, if they are to be
    relative to the working folder. Raises InputError for unknown, missing or unusable values.
    A `Table` checks the rest.
    """
    if not isinstance(values, dict):
        raise InputError(f"{where} must be a table")
    known = {entry.name: entry for entry in fields(kind)}
    check_known(f"key of {where}", known, *values)
    needed = [key for key in known if known[key].default is known[key].default_factory is MISSING]
    for key in needed:
        if key not in values:
            raise InputError(f"{where}: {key} is missing; give {', '.join(needed)}")
    if folder is not None:
        values = located_files(kind, values, folder)
    with errors_of(where):
        return kind(
            **{key: converted(value, known[key].type, key) for key, value in values.items()}
        )


def tables_of(tree: Mapping, name: str) -> list:
    """The tables [[name]] of a tree; raises InputError for anything else of that name."""
    tables = tree.get(name, [])
    if not isinstance(tables, list) or not all(isinstance(table, Mapping) for table in tables):
        raise InputError(f"{name} must be tables, [[{name}]]")
    return tables


def table_of(tree: Mapping, name: str) -> Mapping:
    """The table [name] of a tree; raises InputError for anything else of that name."""
    table = tree.get(name, {})
    if not isinstance(table, Mapping):
        raise InputError(f"[{name}] must be a table")
    return table


def dotted(table: Mapping, of_value=(), before: str = "") -> dict:
    """The entries of a table with dotted names, as TOML nests a key such as a.b without quotes.

    of_value: keys that mark a table as the value of an entry, as an empty table then is one.
    """
    entries = {}
    for key, value in table.items():
        is_nested = isinstance(value, Mapping) and not (
            of_value and (not value or set(value) & set(of_value))
        )
        name = f"{before}{key}"
        entries |= dotted(value, of_value, f"{name}.") if is_nested else {name: value}
    return entries


def located(folder: Path, value):
    """Files relative to the working folder in place of `folder`: a text, a list or a table.

    A name without a suffix that is no file stays, and so does a number; so does any text of a table
    that is no file.
    """
    if isinstance(value, Mapping):
        return {
            key: located(folder, text) if is_file(folder, text) else text
            for key, text in value.items()
        }
    if isinstance(value, list):
        return [located(folder, text) for text in value]
    if isinstance(value, str) and (is_file(folder, value) or Path(value.strip()).suffix):
        try:
            float(value)
        except ValueError:
            return str(folder / value.strip())
    return value


def is_file(folder: Path, text) -> bool:
    return isinstance(text, str) and os.path.isfile(folder / text.strip())


def located_files(kind, values, folder: Path):
    """The values of a table, `located` where the dataclass `kind` declares files.

    Anything else than a table stays as it is.
    """
    if not isinstance(values, Mapping):
        return values
    files = {
        name for name, entry in kind.__dataclass_fields__.items() if "is_file" in entry.metadata
    }
    return {key: located(folder, v) if key in files else v for key, v in values.items()}


def text_of(tables: dict[str, dict]) -> str:
    """The TOML of tables of texts, numbers, lists and inner tables."""
    lines = (
        [f"[{table}]", *(f"{keyed(key)} = {worded(value)}" for key, value in entries.items()), ""]
        for table, entries in tables.items()
    )
    return "\n".join(line for part in lines for line in part)


def keyed(key: str) -> str:
    return key if re.fullmatch(r"[\w-]+", key, re.ASCII) else json.dumps(key)


def worded(value) -> str:
    """A value in one line; texts and numbers of TOML are those of JSON."""
    if isinstance(value, dict):
        return f"{{{', '.join(f'{keyed(k)} = {worded(v)}' for k, v in value.items())}}}"
    if isinstance(value, list):
        return f"[{', '.join(map(worded, value))}]"
    return value.isoformat() if isinstance(value, date) else json.dumps(value)


def typed(values: Mapping[str, object], types: Mapping[str, type], needed=()) -> dict:
    """The values of a table, each of the type of its key.

    Raises InputError for an unknown key, for a value of another type, and if one of the `needed`
    keys is missing.
    """
    check_known("key", types, *values)
    table = {key: converted(value, types[key], key) for key, value in values.items()}
    if missing := [key for key in needed if key not in table]:
        raise InputError(f"lacks {', '.join(missing)}")
    return table


def converted(value, kind, where: str):
    """A TOML value as a field of type `kind` holds it.

    A single number may stand for a list of one. A field may also be a word or a text, if its type
    names it.
    Raises InputError if the type or the size is wrong.
    """
    words = [
        word for part in get_args(kind) if get_origin(part) is Literal for word in get_args(part)
    ]
    if value in words or type(value) is str and str in get_args(kind):
        return value
    kind = required(kind)
    if words:
        try:
            return converted(value, kind, where)
        except InputError as error:
            raise InputError(f"{error}, or {' or '.join(words)}") from None
    if get_origin(kind) is Literal:
        kind = str  # the word itself is checked with the table
    if get_origin(kind) is tuple:
        if value == [] and ... in get_args(kind) and get_args(kind)[0] in (int, float):
            raise InputError(f"{where} = []; give at least one number")
        return tuple(
            converted(item, get_args(kind)[0], where)
            for item in (value if isinstance(value, list) else [value])
        )
    if kind is float and type(value) is int and abs(value) <= LARGEST:
        value = float(value)
    if type(value) is not kind or kind is float and not np.isfinite(value):
        raise InputError(f"{where} = {shortened(repr(value), 100)}; must be {EXPECTED[kind]}")
    if kind is float and value and not SMALLEST <= abs(value) <= LARGEST:
        raise InputError(f"{where} = {value:g}; must be 0, or of a size within {SIZES}")
    return value

"""Results from the entries of their JSON: the inverse of `Result.as_dict`."""

from dataclasses import MISSING, fields, is_dataclass
from types import UnionType
from typing import Any, get_args, get_origin, get_type_hints

import numpy as np

PLAIN = {float: (float, int), int: int, str: str, bool: bool}  # types of JSON for those of fields


def built(hint: Any, value: Any) -> Any:
    """An object of a type from what `strict` made of it.

    Parameters
    ----------
    hint : type
        Annotation of a field: a dataclass, a plain type, an array, a list, tuple, dict or optional
        of these. All items of a tuple have the type of the first one.
    value : object
        Numbers, texts, lists and dictionaries. A number that is None becomes NaN. Entries of a
        dictionary that are no fields of the dataclass are ignored.

    Raises
    ------
    KeyError, TypeError, ValueError
        If a field without a default is missing, or if a value has another type.
    """
    kind, inner = get_origin(hint), get_args(hint)
    if kind is UnionType:
        return None if value is None else built(inner[0], value)
    if is_dataclass(hint):
        hints = get_type_hints(hint)
        given = [
            entry
            for entry in fields(hint)
            if entry.name in value or entry.default is entry.default_factory is MISSING
        ]
        return hint(**{entry.name: built(hints[entry.name], value[entry.name]) for entry in given})
    if hasattr(hint, "_fields"):  # a NamedTuple
        hints = get_type_hints(hint)
        return hint(**{name: built(hints[name], value[name]) for name in hint._fields})
    if hint is np.ndarray:
        array = np.array(value)
        return array.astype(float) if array.dtype == object else array
    if kind in (list, tuple):
        return kind(built(inner[0], item) for item in value)
    if kind is dict:
        return {inner[0](key): built(inner[1], item) for key, item in value.items()}
    if hint is float and value is None:
        return np.nan
    if hint in PLAIN and not isinstance(value, PLAIN[hint]):
        raise TypeError(f"{value!r} in place of a {hint.__name__}")
    return value


def columns_of(lists: dict) -> dict[str, np.ndarray]:
    """Columns from the lists of JSON; null is NaN in a column of numbers."""
    columns = {}
    for name, values in lists.items():
        is_text = any(isinstance(value, str) for value in values)
        columns[name] = np.array(values, dtype=object if is_text else float)
    return columns

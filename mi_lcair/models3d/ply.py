"""Checks of PLY meshes before Mitsuba reads them: header, length, coordinates and corners."""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.files import read_bytes

TYPES = {
    "char": "i1",
    "int8": "i1",
    "uchar": "u1",
    "uint8": "u1",
    "short": "i2",
    "int16": "i2",
    "ushort": "u2",
    "uint16": "u2",
    "int": "i4",
    "int32": "i4",
    "uint": "u4",
    "uint32": "u4",
    "float": "f4",
    "float32": "f4",
    "double": "f8",
    "float64": "f8",
}
ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">", "ascii": ""}
LISTS_OF_CORNERS = ("vertex_index", "vertex_indices")
ELEMENT = re.compile(r"element [A-Za-z0-9_]+ [0-9]{1,12}")
LONGEST_HEADER = 2**16  # bytes


@dataclass(frozen=True)
class Element:
    """One element of a PLY: its name, how often it occurs, and its properties: (name, type of the
    value, type of a list's count or None).
    """

    name: str
    count: int
    properties: tuple[tuple[str, str, str | None], ...]


def check_ply(path: str | Path) -> np.ndarray:
    """The lowest and highest coordinates (2, 3) of a PLY mesh.

    Raises InputError for one that a renderer would misread: a damaged header, content that
    is shorter than the header says, coordinates that are not finite, a face that is no triangle, or
    one whose corner is no vertex.
    """
    content = read_bytes(path)
    try:
        order, elements, begin = header(content)
        vertices, sizes, corners = body(content, order, elements, begin)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    bad = ~np.isfinite(vertices).all(axis=1)
    if bad.any():
        raise InputError(f"{path}: vertex {bad.argmax()} is not finite")
    if (sizes != 3).any():
        raise InputError(f"{path}: its faces have {sizes[0]} corners; they must be triangles")
    if len(corners) and not 0 <= corners.min() <= corners.max() < len(vertices):
        bad = (corners < 0) | (corners >= len(vertices))
        raise InputError(
            f"{path}: face {bad.argmax() // 3} names vertex {corners[bad][0]}; the mesh has "
            f"{len(vertices)}, counted from 0"
        )
    if not len(corners):
        raise InputError(f"{path}: has no faces")
    return np.stack([vertices.min(axis=0), vertices.max(axis=0)])


def header(content: bytes) -> tuple[str, list[Element], int]:
    """The byte order ("" for text), the elements, and where the content begins."""
    end = re.search(rb"(?:^|\n)end_header[ \t\r]*\n", content[:LONGEST_HEADER])
    if not re.match(rb"ply[ \t\r]*\n", content) or not end:
        raise InputError("is no PLY file; it must begin with 'ply' and a header up to 'end_header'")
    order, elements = None, []
    for line in content[: end.start()].decode("ascii", "replace").splitlines()[1:]:
        words = line.split()
        if not words or words[0] in ("comment", "obj_info"):
            continue
        if words[0] == "format" and len(words) == 3 and words[1] in ORDERS:
            order = ORDERS[words[1]]
        elif words[0] == "element" and ELEMENT.fullmatch(" ".join(words)):
            elements.append((words[1], int(words[2]), []))
        elif words[0] == "property" and elements and (entry := _property(words[1:])):
            elements[-1][2].append(entry)
        else:
            raise InputError(f"its header's line '{line.strip()[:60]}' cannot be understood")
    if order is None:
        raise InputError(f"its header names no format; one of {', '.join(ORDERS)}")
    names = [name for name, _, _ in elements]
    if names.count("vertex") != 1 or names.count("face") != 1:
        raise InputError("its header must have one element vertex and one element face")
    return order, [Element(name, n, tuple(entries)) for name, n, entries in elements], end.end()


def body(content: bytes, order: str, elements: list[Element], begin: int):
    """Coordinates (V, 3), the number of corners (F,) of each face, and the corners, face after
    face.
    """
    data = np.frombuffer(content, np.uint8, offset=begin)
    if order == "":
        order, data = "=", _text_numbers(content[begin:]).view(np.uint8)
        elements = [_as_text(element) for element in elements]
    vertices = sizes = corners = None
    for element in elements:
        if vertices is not None and sizes is not None:
            break  # what follows them is not a mesh's
        columns, lists, data = _rows(data, element, order)
        if element.name == "vertex":
            missing = [axis for axis in "xyz" if axis not in columns]
            if missing:
                raise InputError(f"its vertices lack {', '.join(missing)}")
            vertices = np.stack([columns[axis].astype(float) for axis in "xyz"], axis=1)
        elif element.name == "face":
            named = [lists[name] for name in LISTS_OF_CORNERS if name in lists]
            if not named:
                raise InputError(f"its faces lack the list {LISTS_OF_CORNERS[1]}")
            sizes, corners = named[0]
    return vertices, sizes, corners


def _property(words):
    """(name, type, type of a list's count or None) of the words after "property"; None if they are
    no property.
    """
    if not words or not re.fullmatch(r"[A-Za-z0-9_]+", words[-1]):
        return None
    if len(words) == 2 and words[0] in TYPES:
        return words[1], TYPES[words[0]], None
    is_list = len(words) == 4 and words[0] == "list" and words[1] in TYPES and words[2] in TYPES
    if is_list and TYPES[words[1]][0] in "iu":
        return words[3], TYPES[words[2]], TYPES[words[1]]
    return None


def _text_numbers(text):
    """All numbers of a text."""
    try:
        return np.array(text.split(), dtype=float)
    except ValueError:
        raise InputError("holds a word that is no number") from None


def _as_text(element):
    """The element as it is stored by `_text_numbers`: every number a double."""
    return Element(
        element.name,
        element.count,
        tuple((name, "f8", count and "f8") for name, _, count in element.properties),
    )


def _rows(data, element, order):
    """Columns and lists (sizes, values) of an element by name, and the data after it."""
    if not element.count:
        empty = np.empty(0, np.int64)
        columns = {name: empty for name, _, count in element.properties if not count}
        return columns, {name: (empty, empty) for name, _, _ in element.properties}, data
    row = _row_type(data, element, order)
    end = row.itemsize * element.count
    if end <= len(data):
        rows = data[:end].view(row)
        lists = {name: rows[name] for name, _, count in element.properties if count}
        if all((rows["n"] == row[name]["of"].shape[0]).all() for name, rows in lists.items()):
            columns = {name: rows[name] for name, _, count in element.properties if not count}
            lists = {
                name: (rows["n"].astype(np.int64), _whole(rows["of"]))
                for name, rows in lists.items()
            }
            return columns, lists, data[end:]
    if not any(count for _, _, count in element.properties):
        raise _short(element)
    raise InputError(
        f"its element '{element.name}' ends early or has lists of different lengths; all faces "
        "must be triangles"
    )


def _row_type(data, element, order):
    """The NumPy type of the row at the beginning of the data."""
    if not element.properties:
        raise InputError(f"its element '{element.name}' has no properties")
    fields, at = [], 0
    for name, kind, count in element.properties:
        field = np.dtype(order + kind)
        if count:
            size = np.dtype(count).itemsize
            if at + size > len(data):
                raise _short(element)
            length = data[at : at + size].view(order + count)[0]
            if not 0 <= length <= len(data):
                raise _short(element)
            field = np.dtype([("n", order + count), ("of", order + kind, (int(length),))])
        fields.append((name, field))
        at += field.itemsize
    try:
        return np.dtype(fields)
    except ValueError:
        raise InputError(f"its header gives element '{element.name}' a property twice") from None


def _whole(values):
    """Indices as integers; what is no number becomes -1, which is none either."""
    values = np.ravel(values)
    if values.dtype.kind == "f":
        values = np.where(np.isfinite(values) & (abs(values) < 2**62), values, -1)
    return values.astype(np.int64)


def _short(element):
    return InputError(f"ends within its {element.count} elements '{element.name}'")

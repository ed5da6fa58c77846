"""Reader of PLY meshes, for imports and for the check before Mitsuba reads a mesh.

A reader of our own, because every mesh of a scene is checked at each load. trimesh takes seven
times longer and reads no binary file whose faces differ in their number of corners. meshio misreads
faces that have further properties. plyfile is under the GPL.
"""

import re
import struct
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from mi_lcair.errors import InputError, errors_of
from mi_lcair.files import read_bytes

ALIASES = {
    "char": "int8",
    "uchar": "uint8",
    "short": "int16",
    "ushort": "uint16",
    "int": "int32",
    "uint": "uint32",
    "float": "float32",
    "double": "float64",
}
# NumPy's types, without byte order, by all names that they have in files
TYPES = {
    name: np.dtype(kind).str[1:]
    for names in ALIASES.items()
    for name in names
    for kind in names[1:]
}
TEXT = "ascii"
ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">", TEXT: "="}
LISTS_OF_CORNERS = ("vertex_index", "vertex_indices")
FORMAT = re.compile(rf"format ({'|'.join(ORDERS)}) \S+")
ELEMENT = re.compile(r"element ([A-Za-z0-9_]+) ([0-9]{1,12})")
PROPERTY = re.compile(r"property (?:list (u?char|u?short|u?int|u?int\d+) )?(\w+) ([A-Za-z0-9_]+)")
END_OF_HEADER = re.compile(rb"(?:^|\n)end_header[ \t\r]*\n")
LONGEST_HEADER = 2**16  # bytes


@dataclass(frozen=True)
class PlyProperty:
    """One property of an element. count_type: type of a list's number of entries, or None."""

    name: str
    type: str
    count_type: str | None


@dataclass(frozen=True)
class Element:
    """One element of a PLY: its name, how often it occurs, and its properties."""

    name: str
    count: int
    properties: list[PlyProperty]


@dataclass(frozen=True)
class Faces:
    """The mesh in a PLY file.

    vertices: (V, 3). sizes: number of corners of each face, (F,). corners: indices of vertices,
    face after face, (N,).
    """

    vertices: np.ndarray
    sizes: np.ndarray
    corners: np.ndarray


def read_ply(path: str | Path) -> Faces:
    """The mesh in a PLY file, text or binary; faces may differ in their number of corners.

    Raises InputError for a damaged header, content that is shorter than the header says,
    coordinates that are not finite, a mesh without faces, and a face whose corner is no vertex.
    """
    content = read_bytes(path)
    with errors_of(path):
        faces = _parsed(content)
        _check(faces)
    return faces


def check_ply(path: str | Path) -> np.ndarray:
    """The lowest and highest coordinates (2, 3) of a PLY mesh.

    Raises InputError as `read_ply`, and for a face that is no triangle, which Mitsuba refuses.
    """
    faces = read_ply(path)
    if (faces.sizes != 3).any():
        size = faces.sizes[faces.sizes != 3][0]
        raise InputError(f"{path}: its faces have {size} corners; they must be triangles")
    return np.stack([faces.vertices.min(axis=0), faces.vertices.max(axis=0)])


def _check(faces):
    vertices, corners = faces.vertices, faces.corners
    if not np.isfinite(vertices).all():
        raise InputError(f"vertex {(~np.isfinite(vertices).all(axis=1)).argmax()} is not finite")
    if not len(faces.sizes):
        raise InputError("has no faces")
    if (faces.sizes < 3).any():
        raise InputError(f"face {(faces.sizes < 3).argmax()} has fewer than three corners")
    if not 0 <= corners.min() <= corners.max() < len(vertices):
        bad = int(((corners < 0) | (corners >= len(vertices))).argmax())
        face = np.searchsorted(np.cumsum(faces.sizes), bad, side="right")
        raise InputError(
            f"face {face} names vertex {corners[bad]}; the mesh has {len(vertices)}, counted from 0"
        )


def _parsed(content):
    """The Faces in the content of a file, as they stand there."""
    end = END_OF_HEADER.search(content[:LONGEST_HEADER])
    if not re.match(rb"ply[ \t\r]*\n", content) or not end:
        raise InputError("is no PLY file; it must begin with 'ply' and a header up to 'end_header'")
    order, elements = _header(content[: end.start()])
    begin = end.end()
    data = np.frombuffer(content, np.uint8, offset=begin)
    if order == ORDERS[TEXT]:
        data = _text_numbers(content[begin:]).view(np.uint8)
    vertices = faces = None
    for element in elements:
        columns, data = _columns(data, element, order)
        if element.name == "vertex":
            if missing := [axis for axis in "xyz" if axis not in columns]:
                raise InputError(f"its vertices lack {', '.join(missing)}")
            vertices = np.stack([columns[axis][1].astype(float) for axis in "xyz"], axis=1)
        elif element.name == "face":
            name = next((name for name in LISTS_OF_CORNERS if name in columns), None)
            if name is None:
                raise InputError(f"its faces lack the list {LISTS_OF_CORNERS[1]}")
            faces = columns[name]
        if vertices is not None and faces is not None:
            break  # what follows them is not a mesh's
    sizes, corners = faces
    return Faces(vertices, sizes, _indices(corners))


@lru_cache(maxsize=64)  # many meshes of a scene have the same header
def _header(content):
    """Byte order and elements in the lines of a header."""
    order, elements = None, []
    for line in content.decode("ascii", "replace").splitlines()[1:]:
        words = " ".join(line.split())
        if not words or words.split()[0] in ("comment", "obj_info"):
            continue
        entry = PROPERTY.fullmatch(words)
        if file_format := FORMAT.fullmatch(words):
            order = ORDERS[file_format[1]]
        elif element := ELEMENT.fullmatch(words):
            elements.append(Element(element[1], int(element[2]), []))
        elif entry and elements and entry[2] in TYPES and (entry[1] or "int") in TYPES:
            kind, count_type = TYPES[entry[2]], entry[1] and TYPES[entry[1]]
            if order == ORDERS[TEXT]:  # every number of a text becomes a double
                kind, count_type = "f8", count_type and "f8"
            elements[-1].properties.append(PlyProperty(entry[3], kind, count_type))
        else:
            raise InputError(f"its header's line '{line.strip()[:60]}' cannot be understood")
    if order is None:
        raise InputError(f"its header names no format; one of {', '.join(ORDERS)}")
    names = [element.name for element in elements]
    if names.count("vertex") != 1 or names.count("face") != 1:
        raise InputError("its header must have one element vertex and one element face")
    for element in elements:
        if not element.properties:
            raise InputError(f"its element '{element.name}' has no properties")
        if len({entry.name for entry in element.properties}) < len(element.properties):
            raise InputError(f"its header gives element '{element.name}' a property twice")
    return order, elements


def _text_numbers(text):
    try:
        return np.array(text.split(), dtype=float)
    except ValueError:
        raise InputError("has a word that is not a number") from None


def _columns(data, element, order):
    """(sizes, values) of each property of an element by name, and the data after the element.

    sizes: number of values in each row, (count,). values: row after row.
    """
    starts, sizes, _ = _walked(data, element, order, min(element.count, 1))
    fields = []
    for entry, size in zip(element.properties, sizes):
        if entry.count_type:
            fields.append((f"{entry.name} count", order + entry.count_type))
        fields.append((entry.name, order + entry.type, int(size[0]) if len(size) else 0))
    row = np.dtype([(name, kind, *((n,) for n in shape)) for name, kind, *shape in fields])
    end = element.count * row.itemsize
    counts = [f"{entry.name} count" for entry in element.properties if entry.count_type]
    if end <= len(data):
        rows = np.ndarray(element.count, row, data)
        if all((rows[name] == rows[name][:1]).all() for name in counts):
            return {
                entry.name: (
                    np.full(element.count, row[entry.name].shape[0]),
                    rows[entry.name].reshape(-1),
                )
                for entry in element.properties
            }, data[end:]
    elif not counts:
        raise _short(element)
    # Lists of different lengths
    starts, sizes, end = _walked(data, element, order, element.count)
    return {
        entry.name: (size, _gathered(data, start, size, np.dtype(order + entry.type)))
        for entry, start, size in zip(element.properties, starts, sizes)
    }, data[end:]


def _walked(data, element, order, count):
    """Where the values of each property begin in the first `count` rows, and how many there are.

    Returns starts and sizes, one array (count,) for each property, and the end of the last row.
    """
    counters = [
        entry.count_type and struct.Struct(order + np.dtype(entry.count_type).char)
        for entry in element.properties
    ]
    widths = [np.dtype(entry.type).itemsize for entry in element.properties]
    starts, sizes, at = [], [], 0
    for _ in range(count):
        for counter, width in zip(counters, widths):
            size = 1
            if counter:
                if at + counter.size > len(data):
                    raise _short(element)
                (size,) = counter.unpack_from(data, at)
                at += counter.size
            if not 0 <= size <= len(data):
                raise _short(element)
            starts.append(at)
            sizes.append(size)
            at += int(size) * width
    if at > len(data):
        raise _short(element)
    columns = len(widths)
    return (
        np.array(starts, np.int64).reshape(-1, columns).T,
        np.array(sizes).astype(np.int64).reshape(-1, columns).T,
        at,
    )


def _gathered(data, starts, sizes, kind):
    """Values of a type in bytes, of which sizes (n,) lie at the places starts (n,)."""
    before = np.cumsum(sizes) - sizes
    places = np.repeat(starts - kind.itemsize * before, sizes)
    places += kind.itemsize * np.arange(len(places))
    return data[places[:, None] + np.arange(kind.itemsize)].view(kind).ravel()


def _indices(values):
    """Indices as integers. A value that is not a finite number becomes -1, which is no index."""
    if values.dtype.kind == "f":
        values = np.where(np.isfinite(values) & (abs(values) < 2**62), values, -1)
    return values.astype(np.int64)


def _short(element):
    return InputError(f"ends within its {element.count} elements '{element.name}'")

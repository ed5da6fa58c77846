"""Wavefront OBJ files, as far as facets need them: vertices, faces and the labelled names of objects and groups."""
import math
from array import array
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..errors import InputError


@dataclass(frozen=True)
class Obj:
    """The content of an OBJ file.

    vertices (V, 3); corners (N,): indices of vertices, face after face; first (F + 1,): where in `corners` each face
    begins, and where the last ends; lines (F,): where each face stands in the file; names: (line, "object" or "group",
    label) of what carries a label; name (F,): which of them holds for each face, -1 for none.
    """

    path: Path
    vertices: np.ndarray
    corners: np.ndarray
    first: np.ndarray
    lines: np.ndarray
    names: list[tuple[int, str, str]]
    name: np.ndarray


def read_obj(path: str | Path) -> Obj:
    """Reads an OBJ file.

    Understands v, f (v, v/vt, v//vn, v/vt/vn, negative indices), o, g, comments and continued lines; all else is passed
    over. A face takes the label of its group if that has one ('*' makes a label), else of its object. Raises InputError,
    with the line, for a vertex that is not three numbers, and for a face that has fewer than three corners, an index
    that is not a number, or one that names no vertex.
    """
    path = Path(path)
    # Compact arrays: a million faces as Python's own integers would take hundreds of megabytes.
    coordinates, corners, first, lines, name = array("d"), array("q"), array("q", [0]), array("q"), array("q")
    names, labels = [], {"o": -1, "g": -1}
    label = -1
    try:
        for number, keyword, text in _statements(path):
            if keyword == "v":
                x, y, z = map(float, text.split(None, 3)[:3])
                if not math.isfinite(x + y + z):
                    raise ValueError
                coordinates.extend((x, y, z))
            elif keyword == "f":
                before = len(coordinates) // 3
                for word in text.split():
                    index = int(word.partition("/")[0])
                    if index < 0:
                        index += before + 1
                        if index <= 0:
                            raise InputError(f"face index {word} is out of range; {_vertices(before)} before it")
                    corners.append(index - 1)
                if len(corners) - first[-1] < 3:
                    raise InputError(f"a face needs three corners or more, has {len(corners) - first[-1]}")
                first.append(len(corners))
                lines.append(number)
                name.append(label)
            elif keyword in ("o", "g"):
                text = _label(text)
                if keyword == "o":
                    labels["g"] = -1    # an object starts afresh
                labels[keyword] = len(names) if text else -1
                if text:
                    names.append((number, "object" if keyword == "o" else "group", text))
                label = labels["g"] if labels["g"] >= 0 else labels["o"]
    except InputError as error:
        raise InputError(f"{path}, line {number}: {error}") from None
    except (ValueError, OverflowError):
        what = ("a vertex must be three numbers" if keyword == "v" else
                "a face must be indices of vertices, such as f 1 2 3 or f 1/1/1 2/2/1 3/3/1")
        raise InputError(f"{path}, line {number}: {what}, not '{_shown(text)}'") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from None
    if not lines:
        raise InputError(f"{path}: no faces; a Wavefront OBJ has lines such as f 1 2 3")
    return _checked(Obj(path, np.array(coordinates).reshape(-1, 3), np.array(corners), np.array(first), np.array(lines),
                        names, np.array(name)))


def _statements(path):
    """(line number, keyword, the rest) of each statement, comments cut off and continued lines joined."""
    with open(path, encoding="utf-8-sig", errors="replace") as file:
        lines = enumerate(file, 1)
        for number, line in lines:
            while line.endswith("\\\n"):
                line = line[:-2] + " " + next(lines, (0, ""))[1]
            if "#" in line:
                line = line[:line.index("#")]
            keyword, *rest = line.split(None, 1) or ("",)
            yield number, keyword, *(rest or ("",))


def _label(text):
    """The label among the names that an o or g statement gives: from the first word with '*' on. Empty if there is none."""
    words = text.split()
    labelled = [position for position, word in enumerate(words) if "*" in word]
    return " ".join(words[labelled[0]:]) if labelled else ""


def _checked(obj):
    """The same, if every corner is a vertex: an index may come before the vertex that it names."""
    unknown = (obj.corners < 0) | (obj.corners >= len(obj.vertices))
    if unknown.any():
        corner = np.argmax(unknown)
        line = obj.lines[np.searchsorted(obj.first, corner, side="right") - 1]
        raise InputError(f"{obj.path}, line {line}: face index {obj.corners[corner] + 1} is out of range; "
                         f"{_vertices(len(obj.vertices))} in the file, counted from 1")
    return obj


def _vertices(count):
    return f"there {'is 1 vertex' if count == 1 else f'are {count} vertices'}"


def _shown(text):
    return text if len(text) <= 40 else f"{text[:37]}..."

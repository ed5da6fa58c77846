"""Reader of Wavefront OBJ files: vertices, faces, and the names that each face has."""

import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.files import read_bytes

# Statements that are read, by keyword.
KINDS = {b"v": "vertex", b"f": "face", b"o": "object", b"g": "group"}
USEMTL = b"\xff"  # stands for the keyword usemtl where the other keywords are one byte
# Statements that are ignored, because they contain no surface and no name. All other statements
# contain a surface or are damaged.
PASSED_OVER = tuple(
    b"vt vn vp s mtllib usemtl maplib usemap l p mg lod bevel c_interp d_interp shadow_obj "
    b"trace_obj end".split()
)
# First lines of Blender's files: "# Blender 5.0.1", before 3.1 "# Blender v2.93.4 OBJ File: ..."
BLENDER = re.compile(rb"\s*#\s*Blender v?([0-9][\w.]*)")
LONGEST_KEYWORD = 12  # bytes
VERTEX = "a vertex must be three numbers"
FACE = "a face must be indices of three vertices or more, such as f 1 2 3 or f 1/1/1 2/2/1 3/3/1"
AT_ONCE = 20_000  # lines parsed at once; more lines need more memory and are not faster
NEWLINE, BLANK, SLASH = b"\n /"
JOINED = b"\v"  # blank character that replaces the end of a line inside a continued statement


@dataclass(frozen=True)
class Obj:
    """The content of an OBJ file.

    vertices (V, 3); corners (N,): indices of vertices from 0, face after face; first (F + 1,):
    where in `corners` each face begins, and where the last ends; lines (F,): where each face stands
    in the file; names: (line, "object" or "group", label) of what carries a label; name (F,): which
    of them holds for each face, -1 for none; parts: the names of material, group and object that
    faces have, "" for none; part (F,): which of them hold for each face; blender: the version of
    Blender that wrote the file, "" if none did.

    What a file may say itself: given: for each part its place in messages, the values of the
    columns of a table of names, and a group where nothing else gives one; kelvin (F,): temperatures
    of faces [K], NaN for none; unit [m]; axes: forward and up; remarks: on the reading;
    motion: `usd.Movement`.
    """

    path: Path
    vertices: np.ndarray
    corners: np.ndarray
    first: np.ndarray
    lines: np.ndarray
    names: list[tuple[int, str, str]]
    name: np.ndarray
    parts: list[tuple[str, str, str]]
    part: np.ndarray
    blender: str = ""
    given: list[tuple[str, dict[str, str], str]] = field(default_factory=list)
    kelvin: np.ndarray | None = None
    unit: float = 1.0
    axes: tuple[str, str] | None = None
    remarks: tuple[str, ...] = ()
    motion: object | None = None

    def place(self, face: int) -> str:
        """Where a face stands in the file, for messages."""
        return f"{self.path}, line {self.lines[face]}"


def read_obj(path: str | Path) -> Obj:
    """Read an OBJ file.

    The statements v, f (v, v/vt, v//vn, v/vt/vn, negative indices), o, g and usemtl, comments and
    continued lines are read. The rest of PASSED_OVER is ignored. A name of an object or group with
    '*' is a label. A face has the label of its group, or of its object if the group has none.

    Raises InputError, with the line, for a vertex that is not three finite numbers, for a face that
    has fewer than three corners, corners of unlike form, an index that is not a number or an index
    of no vertex, and for an unknown statement.
    """
    path = Path(path)
    vertices, corners, sizes, lines, name, part = (
        [np.empty((0, 3))],
        *([np.empty(0, int)] for _ in range(5)),
    )
    vertex_count, names, label_of = 0, [], {"object": -1, "group": -1}
    parts, called = {}, {"material": "", "group": "", "object": ""}
    unknown = None  # what is wrong with the first statement that is not known
    content = read_bytes(path)
    author = BLENDER.match(content)
    text = Text(content)
    try:
        for kind, begin, end in text.runs():
            if kind == "vertex":
                vertices.append(text.parsed(_parse_vertices, begin, end, VERTEX))
                vertex_count += end - begin
            elif kind == "face":
                indices, size = text.parsed(_parse_faces, begin, end, FACE)
                corners.append(np.where(indices < 0, indices + vertex_count, indices - 1))
                if corners[-1].min() < 0:
                    bad = corners[-1].argmin()
                    line = text.line(begin + np.searchsorted(np.cumsum(size), bad, side="right"))
                    raise InputError(
                        f"line {line}: face index {indices[bad]} is out of range; indices count "
                        f"from 1, or back from -1, and {_count(vertex_count)} before this line"
                    )
                sizes.append(size)
                lines.append(text.line(np.arange(begin, end)))
                label = label_of["group"] if label_of["group"] >= 0 else label_of["object"]
                name.append(np.full(end - begin, label))
                number = parts.setdefault(tuple(called.values()), len(parts))
                part.append(np.full(end - begin, number))
            elif kind is None:
                unknown = unknown or text.unknown(begin, end)
            elif kind == "material":
                called[kind] = " ".join(text.rest(end - 1).split()[1:])
            else:
                for statement in range(begin, end):
                    words = " ".join(text.rest(statement).split())
                    called["group"], called[kind] = "", words
                    label_of["group"] = label_of[kind] = -1  # a new object has no group yet
                    if label := _label(text.rest(statement)):
                        label_of[kind] = len(names)
                        names.append((text.line(statement), kind, label))
    except InputError as error:
        raise InputError(f"{path}, {error}") from None
    first = np.concatenate([[0], *sizes]).cumsum()
    if len(first) == 1:
        raise InputError(f"{path}: no faces; a Wavefront OBJ has lines such as f 1 2 3")
    if unknown:
        raise InputError(f"{path}, {unknown}")
    obj = Obj(
        path,
        *map(np.concatenate, (vertices, corners)),
        first,
        np.concatenate(lines),
        names,
        np.concatenate(name),
        list(parts),
        np.concatenate(part),
        author[1].decode() if author else "",
    )
    # This is checked at the end, because a face may name a vertex that follows it in the file
    if obj.corners.max() >= vertex_count:
        line = obj.lines[np.searchsorted(first, obj.corners.argmax(), side="right") - 1]
        raise InputError(
            f"{path}, line {line}: face index {obj.corners.max() + 1} is out of range; "
            f"{_count(vertex_count)} in the file"
        )
    return obj


def check_obj(path: str | Path) -> np.ndarray:
    """The lowest and highest coordinates (2, 3) of an OBJ mesh. Raises InputError as `read_obj`."""
    vertices = read_obj(path).vertices
    return np.stack([vertices.min(axis=0), vertices.max(axis=0)])


class Text:
    """The statements of an OBJ file as an array of bytes, so that NumPy parses many at once."""

    def __init__(self, content: bytes):
        content = content.removeprefix(b"\xef\xbb\xbf").lstrip(b" \t")
        if b"\n" not in content:
            content = content.replace(b"\r", b"\n")
        if b"#" in content:
            content = re.sub(rb"#[^\n]*", b"", content)
        content = re.sub(rb"\\\r?\n", JOINED, content)
        # Two line ends at the end, so that every keyword is followed by a byte
        content = re.sub(rb"\n[ \t]+", rb"\n", content) + b"\n\n"
        self.content = np.frombuffer(content, np.uint8)
        self.begins = np.append(0, np.flatnonzero(self.content == NEWLINE) + 1)
        self.joined = np.flatnonzero(self.content == ord(JOINED))
        self.materials = [match.start() for match in re.finditer(rb"(?m)^usemtl[ \t\v]", content)]

    def runs(self):
        """(kind, begin, end) of runs of up to AT_ONCE consecutive statements of one kind.

        The kind is None for statements that are not read.
        """
        begins = self.begins[:-2]
        keyword, next_byte = self.content[begins], self.content[begins + 1]
        keyword = np.where((next_byte <= BLANK) & (keyword < ord(USEMTL)), keyword, 0)
        keyword[np.searchsorted(begins, self.materials)] = ord(USEMTL)
        limits = np.concatenate([[0], np.flatnonzero(np.diff(keyword)) + 1, [len(keyword)]])
        for begin, end in zip(limits[:-1], limits[1:]):
            kind = {**KINDS, USEMTL: "material"}.get(keyword[begin : begin + 1].tobytes())
            for at in range(begin, end, AT_ONCE):
                yield kind, at, min(at + AT_ONCE, end)

    def unknown(self, begin, end) -> str | None:
        """Message about the first statement with an unknown keyword; None if there is none.

        A keyword alone, with nothing after it, is ignored.
        """
        begins = self.begins[begin:end]
        reach = np.minimum(begins[:, None] + np.arange(LONGEST_KEYWORD), len(self.content) - 1)
        letters = self.content[reach]
        letters[np.logical_or.accumulate(letters <= BLANK, axis=1)] = 0
        keywords = letters.view(f"S{LONGEST_KEYWORD}").ravel()
        for statement in begin + np.flatnonzero(~np.isin(keywords, (b"", *PASSED_OVER))):
            line = self.content[self.begins[statement] : self.begins[statement + 1]].tobytes()
            word, *rest = line.decode(errors="replace").split() or [""]
            if rest:
                known = b", ".join((*KINDS, *PASSED_OVER)).decode()
                return f"line {self.line(statement)}: statement '{word[:20]}' is not one of {known}"
        return None

    def line(self, statement):
        """Number, from 1, of the line on which a statement (or each of an array) begins."""
        return statement + 1 + np.searchsorted(self.joined, self.begins[statement])

    def rest(self, statement) -> str:
        """A statement without its keyword."""
        return (
            self.content[self.begins[statement] + 1 : self.begins[statement + 1]]
            .tobytes()
            .decode(errors="replace")
        )

    def parsed(self, parse, begin, end, rule):
        """Result of `parse` (bytes, begins) for some statements, with their keywords blanked.

        Raises InputError with `rule` for the first statement for which `parse` raises ValueError.
        """
        try:
            begins = self.begins[begin:end] - self.begins[begin]
            content = self.content[self.begins[begin] : self.begins[end]].copy()
            content[begins] = BLANK
            return parse(content, begins)
        except ValueError:
            if end - begin == 1:
                shown = " ".join(self.rest(begin).split())
                raise InputError(
                    f"line {self.line(begin)}: {rule}, "
                    f"not '{shown[:37] + '...' * (len(shown) > 37)}'"
                ) from None
        middle = (begin + end) // 2
        self.parsed(parse, begin, middle, rule)
        return self.parsed(parse, middle, end, rule)


def _parse_vertices(content, begins):
    """Coordinates (n, 3); what follows them (a weight, a colour) is left."""
    values, sizes = _numbers(content, begins, float)
    if sizes.min() < 3 or not np.isfinite(values).all():
        raise ValueError
    return values[(np.cumsum(sizes) - sizes)[:, None] + np.arange(3)]


def _parse_faces(content, begins):
    """Indices as they are written, without those of texture and normal, and the number of corners
    (n,) of each face.
    """
    # Whatever lies between a slash and the next blank goes: where the last mark so far is a
    # slash's, which are odd.
    is_blank, is_slash = content <= BLANK, content == SLASH
    position = 2 * np.arange(len(content), dtype=np.int32)
    marks = np.where(is_blank, position, np.where(is_slash, position + 1, 0))
    is_kept = np.maximum.accumulate(marks) % 2 == 0
    _check_rest(content, ~is_kept, begins)
    indices, sizes = _numbers(np.where(is_kept, content, np.uint8(BLANK)), begins, int)
    if sizes.min() < 3 or len(indices) != np.count_nonzero(_word_starts(content)):
        raise ValueError
    return indices, sizes


def _check_rest(content, is_rest, begins):
    """ValueError where what follows the slashes of a corner is not up to two numbers, or differs in
    kind between a face's corners: a lost blank makes one corner of two.
    """
    if not is_rest.any():
        return
    is_slash = content == SLASH
    is_digit = (content >= ord("0")) & (content <= ord("9"))
    is_sign = (
        (content == ord("-")) & np.append(True, is_slash[:-1]) & np.append(is_digit[1:], False)
    )
    starts = np.flatnonzero(_word_starts(content))
    slashes = np.add.reduceat(is_slash.astype(np.int64), starts)
    if (is_rest & ~(is_slash | is_digit | is_sign)).any() or slashes.max() > 2:
        raise ValueError
    has_number = np.logical_or.reduceat(is_rest & is_digit, starts)
    face = np.searchsorted(begins, starts, side="right") - 1
    kinds = np.unique((3 * face + slashes)[has_number])
    if (np.diff(kinds // 3) == 0).any():
        raise ValueError


def _numbers(content, begins, kind):
    """All numbers in some lines, and how many (n,) there are in each. Raises ValueError for a word
    that is none.
    """
    words = np.flatnonzero(_word_starts(content))
    sizes = np.diff(np.searchsorted(words, begins), append=len(words))
    # The zero at the end, because NumPy takes a last word that is no number, such as '-', for one.
    numbers = np.fromstring(content.tobytes() + b" 0", kind, sep=" ")[:-1]
    if len(numbers) != len(words):
        raise ValueError
    return numbers, sizes


def _word_starts(content):
    """Mask of the bytes at which a word begins; the first byte is blank."""
    is_blank = content <= BLANK
    return np.append(False, is_blank[:-1] & ~is_blank[1:])


def _label(text):
    """The label among the names that an o or g statement gives: from the first word with '*' on.
    Empty if there is none.
    """
    words = text.split()
    labelled = [position for position, word in enumerate(words) if "*" in word]
    if not labelled:
        return ""
    first = labelled[0]
    # In a name such as `f * bareAl * 300 *`, the label begins at the word before the first '*'
    return " ".join(words[first - (first > 0 and words[first].startswith("*")) :])


def _count(vertices):
    return f"there {'is 1 vertex' if vertices == 1 else f'are {vertices} vertices'}"

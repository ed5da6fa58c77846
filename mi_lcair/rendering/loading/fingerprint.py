"""The fingerprint of a scene: a number that changes with whatever the picture depends on."""

import os
import re
from hashlib import file_digest, sha256
from pathlib import Path

import mitsuba as mi
import numpy as np

from mi_lcair.physics.materials import BUILT_IN
from mi_lcair.physics.spectrum import BUNDLED
from mi_lcair.plugins.beside_scene import beside_scene
from mi_lcair.rendering.loading.nodes import properties

NO_ID = re.compile(r"object_\d+")  # what has no id is named by its address in memory


def source_digest(state) -> bytes:
    """Digest of a parsed scene (`mitsuba.parser.ParserState`, its $-parameters in place): every
    property of every node, and the content of every file that one names.

    The tables that come with the library count as such files. Where the files lie does not matter.
    """
    digest = sha256()
    for number, node in enumerate(state.nodes):
        add(digest, f"node {number}", str(node.type), node.props.plugin_name(), node.props.id())
        for name, value in properties(node).items():
            path = named_file(value) if isinstance(value, str) else None
            add(digest, name, content_digest(path) if path else exact(value))
    for path in (BUILT_IN, *sorted(BUNDLED.glob("*.csv"))):
        add(digest, content_digest(path))
    return digest.digest()


def fingerprint(source: bytes, scene: mi.Scene, said: list[str]) -> str:
    """16 hexadecimal digits for a scene: of its `source_digest`, of the values that its objects
    hold now, and of what they say of themselves in words (`said`).
    """
    digest = sha256(source)
    add(digest, *said)
    for name, value in mi.traverse(scene):
        add(digest, NO_ID.sub("", str(name)), exact(value))
    return digest.hexdigest()[:16]


def add(digest, *pieces: str | bytes) -> None:
    """Adds pieces, each with its length before it, so that no two sequences look alike."""
    for piece in pieces:
        piece = piece.encode() if isinstance(piece, str) else piece
        digest.update(len(piece).to_bytes(8, "little") + piece)


def exact(value) -> str | bytes:
    """All digits of a property or parameter; its text where it is no number."""
    if hasattr(value, "matrix"):
        value = value.matrix
    if hasattr(value, "wavelengths"):
        return repr((value.is_uniform(), list(value.wavelengths), list(value.values)))
    if isinstance(value, mi.Properties.ResolvedReference):
        return f"node {value.index()}"
    if hasattr(value, "__array__"):
        return np.ascontiguousarray(value).tobytes()
    return NO_ID.sub("", repr(value))


def named_file(text: str) -> Path | None:
    """The file that a property names, beside the scene or where the text itself leads."""
    try:
        found = [path for path in (Path(beside_scene(text)), Path(text)) if os.path.isfile(path)]
    except (OSError, ValueError):  # a name that no file system takes
        return None
    return found[0] if found else None


def content_digest(path: Path) -> bytes:
    with path.open("rb") as file:
        return file_digest(file, "sha256").digest()

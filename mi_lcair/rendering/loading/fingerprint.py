"""The fingerprint of a scene: a number that changes with everything that affects the image."""

import os
import re
from hashlib import file_digest, sha256
from pathlib import Path

import mitsuba as mi
import numpy as np

from mi_lcair.physics.air.bands import TABLES
from mi_lcair.physics.materials import BUILT_IN
from mi_lcair.physics.spectrum import BUNDLED
from mi_lcair.plugins.properties import beside_scene
from mi_lcair.rendering.loading.nodes import properties

# Name of an object without an id, which contains its address in memory.
NO_ID = re.compile(r"object_\d+")


def source_digest(state) -> bytes:
    """Digest of a parsed scene (`mitsuba.parser.ParserState`) with its $-parameters filled in.

    It contains every property of every node, the content of every file that a property names, and
    the tables that come with the library. The folders of the files do not matter.
    """
    digest, contents = sha256(), {}
    for number, node in enumerate(state.nodes):
        add(digest, f"node {number}", str(node.type), node.props.plugin_name(), node.props.id())
        for name, value in properties(node).items():
            content = None
            if isinstance(value, str):
                if value not in contents:
                    path = named_file(value)
                    contents[value] = path and content_digest(path)
                content = contents[value]
            add(digest, name, content or exact(value))
    for path in (BUILT_IN, *sorted(BUNDLED.glob("*.csv")), *sorted(TABLES.glob("*.csv"))):
        add(digest, content_digest(path))
    return digest.digest()


def described_digest(scene: mi.Scene) -> bytes:
    """Digest of a scene that Mitsuba has loaded, from the description that it prints."""
    return sha256(NO_ID.sub("", str(scene)).encode()).digest()


def fingerprint(source: bytes, scene: mi.Scene, descriptions: list[str]) -> str:
    """16 hexadecimal digits for a scene.

    Parameters
    ----------
    source : bytes
        Its `source_digest`.
    scene : mi.Scene
        The present values of its parameters are part of the fingerprint.
    descriptions : list of str
        Settings that are not parameters, as text.
    """
    digest = sha256(source)
    add(digest, *descriptions)
    for name, value in mi.traverse(scene):
        add(digest, NO_ID.sub("", str(name)), exact(value))
    return digest.hexdigest()[:16]


def add(digest, *pieces: str | bytes) -> None:
    """Add pieces, each after its length, so that different sequences give different digests."""
    for piece in pieces:
        piece = piece.encode() if isinstance(piece, str) else piece
        digest.update(len(piece).to_bytes(8, "little") + piece)


def exact(value) -> str | bytes:
    """All digits of a property or parameter, or its text if it is not a number."""
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
    """The file that a property names, beside the scene or in the working folder; or None."""
    try:
        files = [path for path in (Path(beside_scene(text)), Path(text)) if os.path.isfile(path)]
    except (OSError, ValueError):  # a name that no file system allows
        return None
    return files[0] if files else None


def content_digest(path: Path) -> bytes:
    with path.open("rb") as file:
        return file_digest(file, "sha256").digest()

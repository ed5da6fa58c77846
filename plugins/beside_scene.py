"""Paths of the files that a scene names, found as Mitsuba finds meshes: beside the scene's XML."""

from pathlib import Path

import mitsuba as mi


def beside_scene(text: str) -> str:
    """The path of a file named in a scene; a text without a file suffix is returned unchanged."""
    if "." not in text or not Path(text).suffix:
        return text
    return str(mi.file_resolver().resolve(text))

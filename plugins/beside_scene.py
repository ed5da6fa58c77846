"""Files that a scene names: found beside its XML, as Mitsuba finds meshes."""

from pathlib import Path

import mitsuba as mi


def beside_scene(text: str) -> str:
    """The path of a file named in a scene; a text that names none there is returned as it is."""
    return str(mi.file_resolver().resolve(text)) if Path(text).suffix else text

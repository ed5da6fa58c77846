"""Mitsuba's parser and its objects of a scene file."""

import re
from contextlib import contextmanager
from difflib import get_close_matches
from pathlib import Path

import mitsuba as mi

from mi_lcair.errors import InputError
from mi_lcair.plugins import PLUGINS
from mi_lcair.rendering.loading.names import name_objects
from mi_lcair.rendering.loading.samplers import add_samplers


@contextmanager
def searching(folder: Path):
    """Context manager in which Mitsuba searches for files in this folder first.

    The working folder comes next. Mitsuba itself would search the one in which the process started.
    """
    resolver = mi.file_resolver()
    beside = mi.FileResolver(resolver)
    beside.prepend(str(Path.cwd()))
    beside.prepend(str(folder))
    mi.set_file_resolver(beside)
    try:
        yield
    finally:
        mi.set_file_resolver(resolver)


def configuration():
    """Mitsuba's settings for reading scene files."""
    config = mi.parser.ParserConfig(mi.variant())
    # Mitsuba would merge two equal thermal emitters, and one emitter cannot belong to two shapes
    config.merge_equivalent = config.merge_meshes = False
    return config


def parsed(path: Path, texts: dict[str, str]):
    """The parsed scene file, with Embree's watertight intersections switched on.

    Without them, one ray in 1e7 passes through the edge between two facets.
    """
    state = mi.parser.parse_file(configuration(), str(path), **texts)
    mi.parser.transform_all(configuration(), state)
    if state.root.props.plugin_name() != "scene":
        raise InputError(f"{path}: holds no <scene>")
    add_samplers(state)
    name_objects(state)
    if mi.variant().startswith("llvm"):
        state.root.props["embree_use_robust_intersections"] = True
    return state


def instantiated(state, path: Path) -> mi.Scene:
    """Mitsuba's objects of a parsed scene."""
    loaded = mi.parser.instantiate(configuration(), state)
    if not isinstance(loaded, mi.Scene):
        raise InputError(f"{path}: holds no <scene>")
    return loaded


def with_known_plugins(error: Exception) -> Exception:
    """The error, with the nearest names added if it is about an unknown plugin."""
    match = re.search(r'Plugin "(\w+)" not found', str(error))
    if not match:
        return error
    installed = [file.stem for file in (Path(mi.__file__).parent / "plugins").glob("*.*")]
    nearest = get_close_matches(match[1], [*PLUGINS, *installed], n=5, cutoff=0.4)
    return InputError(f"{error}; the nearest known are: {', '.join(nearest) or 'none'}")

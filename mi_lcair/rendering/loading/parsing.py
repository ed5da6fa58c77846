"""Mitsuba's parser and its objects of a scene file, with the names and samplers that it lacks."""

import re
from collections.abc import Sequence
from contextlib import contextmanager
from difflib import get_close_matches
from pathlib import Path

import drjit as dr
import mitsuba as mi

from mi_lcair.errors import InputError
from mi_lcair.plugins import PLUGINS
from mi_lcair.rendering.loading.nodes import properties, references

REPLACED = ("sky", "sun")  # emitters that surroundings replace
ENVIRONMENTS = ("envmap", "constant", "sunsky")  # others of which a scene can have only one
ONE_SKY = "leave [surroundings] out, or remove that sky"
KNOWN_SAMPLERS = ("lattice", "independent")
INDEPENDENT = "sampler 'independent' may need ten times as many paths as lattice"


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


@contextmanager
def exr_files():
    """Context manager in which Mitsuba can read and write OpenEXR files.

    With one thread its OpenEXR waits forever for the lines of a picture.
    """
    threads = dr.thread_count()
    dr.set_thread_count(max(threads, 2))
    try:
        yield
    finally:
        dr.set_thread_count(threads)


def configuration():
    """Mitsuba's settings for reading scene files."""
    config = mi.parser.ParserConfig(mi.variant())
    # Mitsuba would merge two equal thermal emitters, and one emitter cannot belong to two shapes
    config.merge_equivalent = config.merge_meshes = False
    config.parallel = False  # see `mi_lcair.startup.threads`
    return config


def parsed(path: Path, texts: dict[str, str], around: Sequence[dict] = ()):
    """The parsed scene file, with Embree's watertight intersections switched on.

    Without them, one ray in 1e7 passes through the edge between two facets. around: properties of
    emitters that replace sky and sun of the scene.
    """
    state = mi.parser.parse_file(configuration(), str(path), **texts)
    mi.parser.transform_all(configuration(), state)
    if state.root.props.plugin_name() != "scene":
        raise InputError(f"{path}: holds no <scene>")
    if around:
        surround(state, around)
    add_samplers(state)
    name_objects(state)
    if mi.variant().startswith("llvm"):
        state.root.props["embree_use_robust_intersections"] = True
    return state


def surround(state, around: Sequence[dict]) -> None:
    """Give a parsed scene the emitters `around` in place of its own sky and sun.

    Raises InputError if the scene has a sky that cannot be replaced.
    """
    root = properties(state.root)
    for name, value in root.items():
        if isinstance(value, mi.Properties.ResolvedReference):
            plugin = state.nodes[value.index()].props.plugin_name()
            if plugin in REPLACED:
                del state.root.props[name]
            elif plugin in ENVIRONMENTS:
                raise InputError(f"the scene has a sky of its own, {plugin}; {ONE_SKY}")
    for node in state.nodes:
        if node.type == mi.ObjectType.Emitter and properties(node).get("facet_type") == "sky":
            raise InputError(f"the scene has sky facets of its own; {ONE_SKY}")
    for number, emitter in enumerate(around):
        add_child(state, state.root, f"_surroundings_{number}", mi.ObjectType.Emitter, emitter)


def add_child(state, parent, name: str, kind, entries: dict) -> None:
    """Give a node of a parsed scene a child with these properties, whose plugin is `type`."""
    added = mi.parser.SceneNode()
    added.type, added.props = kind, mi.Properties(entries["type"])
    added.file_index, added.offset = parent.file_index, parent.offset
    for key, value in entries.items():
        if key != "type":
            added.props[key] = value
    # Set before the append, which may move all nodes in memory and leave `parent` invalid
    parent.props[name] = mi.Properties.ResolvedReference(len(state.nodes))
    state.nodes.append(added)


def instantiated(state) -> mi.Scene:
    """Mitsuba's objects of a parsed scene."""
    with exr_files():
        return mi.parser.instantiate(configuration(), state)


def with_known_plugins(error: Exception) -> Exception:
    """The error, with the nearest names added if it is about an unknown plugin."""
    match = re.search(r'Plugin "(\w+)" not found', str(error))
    if not match:
        return error
    installed = [file.stem for file in (Path(mi.__file__).parent / "plugins").glob("*.*")]
    nearest = get_close_matches(match[1], [*PLUGINS, *installed], n=5, cutoff=0.4)
    return InputError(
        f"{error}; the nearest known are: {', '.join(nearest) or 'none'}; "
        "register yours with --plugin FILE.py in the shell, [plugins] in a scenario, or in Python "
        "with mi.register_bsdf and its kind"
    )


def name_objects(state) -> None:
    """Give each shape, sensor and emitter of a parsed scene that has no id a name.

    It is `sensor`, or the name of the plugin. Later ones of a name are numbered from 2. Mitsuba
    would name them by their address in memory, so that the names of parameters would differ
    between processes.
    """
    taken = {node.props.id() for node in state.nodes}
    last = {}  # the last number that was given to each name
    kinds = (mi.ObjectType.Shape, mi.ObjectType.Sensor, mi.ObjectType.Emitter)
    for child in references(properties(state.root)):
        node = state.nodes[child]
        if node.props.id() or node.type not in kinds:
            continue
        name = "sensor" if node.type == mi.ObjectType.Sensor else node.props.plugin_name()
        numbered = name
        while numbered in taken:
            last[name] = last.get(name, 1) + 1
            numbered = f"{name}_{last[name]}"
        taken.add(numbered)
        node.props.set_id(numbered)


def add_samplers(state) -> None:
    """Give each sensor of a parsed scene that names no sampler the sampler `lattice`.

    Mitsuba would give it `independent`.
    """
    samplers = {k for k, node in enumerate(state.nodes) if node.type == mi.ObjectType.Sampler}
    for k in range(len(state.nodes)):
        node = state.nodes[k]
        if node.type == mi.ObjectType.Sensor and not samplers & set(references(properties(node))):
            add_child(state, node, "_sampler", mi.ObjectType.Sampler, {"type": "lattice"})


def remarks_on_samplers(state) -> list[str]:
    """Remarks on the samplers that a scene file names, one line each."""
    named = {node.props.plugin_name() for node in state.nodes if node.type == mi.ObjectType.Sampler}
    lines = [
        f"sampler '{name}' is replaced by lattice, which has known standard errors"
        for name in sorted(named - set(KNOWN_SAMPLERS))
    ]
    if "independent" in named:
        lines.append(INDEPENDENT)
    return lines

"""Mitsuba's parser and its objects of a scene file, with the names and samplers that it lacks."""

import re
import traceback
from collections.abc import Iterable, Sequence
from contextlib import contextmanager
from difflib import get_close_matches
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.declared import Bounds
from mi_lcair.errors import InputError, option, unknown
from mi_lcair.models3d.model import SIZES_AWAY
from mi_lcair.physics.bands import band
from mi_lcair.plugins import PLUGINS
from mi_lcair.plugins.properties import BRIGHTEST, TEMPERATURE, beside_scene
from mi_lcair.tasks import is_worker

# Checks of a parsed scene before Mitsuba creates its objects
# -----------------------------------------------------------
# They find values out of bounds, and errors that would end the process or that Mitsuba would
# ignore.

# Largest coordinate, whose square is far below the largest Float32 number
REACHED = Bounds(lower=0, upper=1e9, unit="m")
MOST_SAMPLES = 2**32 - 1  # largest number of samples per pixel
FINITE = Bounds(lower=-3.4e38, upper=3.4e38)  # in Float32
SHARE, POSITIVE = Bounds(lower=0, upper=1), Bounds(is_positive=True, upper=1e30)
EMITTED = Bounds(lower=0, upper=BRIGHTEST)
SHARES = (
    *("reflectance", "specular_reflectance", "specular_transmittance", "diffuse_reflectance"),
    *("base_color", "opacity", "weight", "roughness", "metallic", "specular", "clearcoat", "sheen"),
    *("spec_trans", "flatness"),
)
# Bounds of the properties of Mitsuba's plugins, by the kind of object and the property's name.
# Fractions of the incident radiance lie in 0..1. Other properties are positive or not negative.
BOUNDS = {
    mi.ObjectType.BSDF: dict.fromkeys(SHARES, SHARE)
    | dict.fromkeys(("alpha", "alpha_u", "alpha_v", "int_ior", "ext_ior"), POSITIVE)
    | dict.fromkeys(("eta", "k"), Bounds(lower=0, upper=1e30)),
    mi.ObjectType.Emitter: dict.fromkeys(("radiance", "irradiance", "intensity", "scale"), EMITTED)
    | {"temperature": TEMPERATURE},
    mi.ObjectType.Shape: {"radius": POSITIVE},
    mi.ObjectType.Sensor: {"near_clip": POSITIVE, "far_clip": POSITIVE},
    mi.ObjectType.Sampler: {"sample_count": Bounds(lower=1, upper=MOST_SAMPLES)},
}
NUMBERS_OF_TEXTURES = ("value", "color", "color0", "color1", "values")
SURFACE_EMITTERS = ("thermal", "area", "directionalarea")  # emitters that must belong to a shape
CHECKED_BY_THEMSELVES = ("thermal",)  # plugins that check their properties themselves
SPECTRAL_ONLY = ("hair",)  # BSDFs of Mitsuba that fail in variants without colour
# Properties and children without which a plugin would end the process.
REQUIRED_PROPERTY = {"bitmap": "filename"}
REQUIRED_CHILDREN = {"blendbsdf": (mi.ObjectType.BSDF, 2), "volume": (mi.ObjectType.Volume, 1)}


def check_nodes(state) -> None:
    """Raise InputError, with the place in the file, for the first node that cannot be used.

    state: the parsed scene, a `mitsuba.parser.ParserState`.
    """
    nodes = [(node, properties(node)) for node in state.nodes]
    of_shapes = children(nodes, lambda node: node.type == mi.ObjectType.Shape)
    measured = measures([value for _, values in nodes for value in values.values()])
    for number, (node, values) in enumerate(nodes):
        try:
            check_names(node.props.plugin_name(), values)
            check_values(node, values, nodes, measured)
            check_complete(node, values, nodes)
            plugin = node.props.plugin_name()
            if plugin in SURFACE_EMITTERS and number not in of_shapes:
                raise InputError(f"{plugin}: belongs to no shape; put it inside a <shape>")
        except InputError as error:
            raise InputError(f"{mi.parser.file_location(state, node)}: {error}") from None
    check_bands(state, nodes)


def properties(node) -> dict:
    """Properties of a node by name.

    They are read from a copy, because Mitsuba would take reading the original for the plugin's
    query.
    """
    props = mi.Properties(node.props)
    return {name: props[name] for name in props.keys()}  # noqa: SIM118 Properties is no dict


def references(values: dict) -> list[int]:
    """Numbers of the nodes that a node's properties refer to."""
    return [
        value.index()
        for value in values.values()
        if isinstance(value, mi.Properties.ResolvedReference)
    ]


def children(nodes, is_parent) -> set[int]:
    """Numbers of the nodes to which those refer for which a function of the node is true."""
    parents = (values for node, values in nodes if is_parent(node))
    return {child for values in parents for child in references(values)}


def check_names(plugin: str, values: dict) -> None:
    """Raise InputError for a property of this project's plugins whose name is misspelt.

    Mitsuba rejects every unknown property, but only after the plugin has missed one that it needs,
    and without the name that was meant.
    """
    if plugin not in PLUGINS:
        return
    known = {entry.name for entry in PLUGINS[plugin].type.PROPERTIES}
    for name, value in values.items():
        if name in known or not isinstance(value, bool | int | float | str):
            continue
        near = get_close_matches(name, known - values.keys(), 1, 0.7)
        if near:
            raise unknown(f"property of {plugin}", name, known)


def numbers(value) -> np.ndarray:
    """Numbers of a property that is a float, a colour, a point or a spectrum; otherwise none."""
    if hasattr(value, "wavelengths"):
        return np.array(value.values, dtype=float).ravel()
    if isinstance(value, bool) or not isinstance(
        value, (int, float, mi.ScalarColor3d, mi.ScalarArray3d)
    ):
        return np.empty(0)
    return np.array(value, dtype=float).ravel()


def check_values(node, values: dict, nodes, measured: dict) -> None:
    """Raise InputError for numbers that are not finite in Float32 or are out of bounds.

    measured: see `measures`.
    """
    plugin = node.props.plugin_name()
    for name, value in values.items():
        if isinstance(value, (str, bool)):
            continue
        if id(value) in measured:
            check_transform(name, *measured[id(value)], node.type)
            continue
        bounds = BOUNDS.get(node.type, {}).get(name)
        given = [(numbers(value), FINITE if plugin in CHECKED_BY_THEMSELVES else bounds)]
        if bounds and isinstance(value, mi.Properties.ResolvedReference):
            child, child_values = nodes[value.index()]
            if child.type == mi.ObjectType.Texture:
                given += [(numbers(child_values.get(key)), bounds) for key in NUMBERS_OF_TEXTURES]
        for array, allowed in given:
            (allowed or FINITE).check_all(array, lambda k, name=name: f"{plugin}: {name}")


def measures(values: list) -> dict[int, tuple]:
    """What `check_transform` judges of those values that are transforms, by their `id`.

    It is the largest number, the volume of the axes if they had the length 1, and the relative
    error of the inverse.
    """
    kinds = mi.ScalarAffineTransform4d | mi.ScalarProjectiveTransform4d
    transforms = [value for value in values if isinstance(value, kinds)]
    matrix, inverse = (
        np.array([np.array(getattr(t, name)) for t in transforms], float).reshape(-1, 4, 4)
        for name in ("matrix", "inverse_transpose")
    )
    with np.errstate(all="ignore"):
        inverse, axes = inverse.swapaxes(1, 2), matrix[:, :3, :3]
        lengths = np.maximum(np.linalg.norm(axes, axis=1, keepdims=True), 1e-30)
        error = abs(matrix @ inverse - np.eye(4)).max((1, 2))
        error /= (abs(matrix) @ abs(inverse)).max((1, 2))
        found = abs(matrix).max((1, 2)), abs(np.linalg.det(axes / lengths)), error
    return dict(zip(map(id, transforms), zip(*found)))


def check_transform(name: str, largest: float, volume: float, error: float, kind) -> None:
    """Raise InputError for a transform that is not finite, is too large, or flattens an object.

    Mitsuba does not bring the axis of <rotate> to length 1. With another length the transform is no
    rotation, and its inverse is another one's, so that normals are wrong. The numbers: `measures`.
    """
    REACHED.check(largest, f"{name}: largest number of the transform")
    if kind not in (mi.ObjectType.Shape, mi.ObjectType.Sensor, mi.ObjectType.Emitter):
        return
    if volume < 1e-9:
        raise InputError(
            f"{name}: the transform flattens to nothing; each scale must differ from 0"
        )
    if error > 1e-6:
        raise InputError(
            f"{name}: <rotate> has an axis that is not of length 1, which stretches the object; "
            "divide its x, y and z by their length"
        )


def check_complete(node, values: dict, nodes) -> None:
    """Raise InputError if a plugin lacks something without which it would end the process."""
    plugin = node.props.plugin_name()
    if plugin in SPECTRAL_ONLY:
        raise InputError(f"{plugin}: works only in spectral variants of Mitsuba; use another BSDF")
    needed = REQUIRED_PROPERTY.get(plugin)
    if needed and needed not in values:
        raise InputError(f"{plugin}: lacks its {needed}")
    kind, count = REQUIRED_CHILDREN.get(plugin, (None, 0))
    if sum(nodes[child][0].type == kind for child in references(values)) < count:
        raise InputError(f"{plugin}: needs {count} {kind.name.lower()} inside it")


def check_bands(state, nodes) -> None:
    """Raise InputError if the BSDFs and emitters of a scene name different bands."""
    bands = []
    for node, values in nodes:
        text = values.get("band")
        if isinstance(text, str) and node.type in (mi.ObjectType.BSDF, mi.ObjectType.Emitter):
            try:
                bands.append((node, text, band(beside_scene(text))))
            except InputError:
                return  # the plugin raises the error when it is created
    emitted = {of_node.name for node, _, of_node in bands if node.type == mi.ObjectType.Emitter}
    if len(emitted) > 1:
        return  # the integrator raises an error that lists the bands
    for node, text, of_node in bands:
        other, other_text, first = bands[0]
        if not same_band(of_node, first):
            raise InputError(
                f"{mi.parser.file_location(state, node)}: {node.props.plugin_name()}: band {text} "
                f"differs from {other_text} at {mi.parser.file_location(state, other)}; a scene "
                "has one band"
            )


def same_band(a, b) -> bool:
    """Whether two bands have the same wavelengths and weights."""
    return np.array_equal(a.wavelengths_um, b.wavelengths_um) and np.array_equal(
        a.weights_um, b.weights_um
    )


REPLACED = ("sky", "sun")  # emitters that surroundings replace
ENVIRONMENTS = ("envmap", "constant", "sunsky")  # others of which a scene can have only one
ONE_SKY = "leave [surroundings] out, or remove that sky"
COLOURS = ("rgb", "rgba", "xyz", "xyza")  # pixel formats of films
KNOWN_SAMPLERS = ("lattice", "independent")
INDEPENDENT = "sampler 'independent' may need ten times as many paths as the sampler lattice"


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
    config.parallel = False  # see `mi_lcair.tasks`
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
                raise InputError(f"the scene already has a sky, {plugin}; {ONE_SKY}")
    for node in state.nodes:
        if node.type == mi.ObjectType.Emitter and properties(node).get("facet_type") == "sky":
            raise InputError(f"the scene already has sky facets; {ONE_SKY}")
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
    """Mitsuba's objects of a parsed scene, whose films have one channel in place of colours."""
    for node in state.nodes:
        if node.props.plugin_name() == "hdrfilm":
            given = properties(node).get("pixel_format", "rgb")
            if str(given).lower() in COLOURS:  # Mitsuba would change it too, with a warning
                node.props["pixel_format"] = "luminance"
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
        "register yours with --plugin FILE.py in the shell, or in Python "
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


# Moves scenes that lie far from the origin to it, before Mitsuba uses single precision
# -------------------------------------------------------------------------------------

# Ratio of distance from the origin to size above which a scene is moved. At this ratio Float32
# coordinates have an error of 1e-6 of the scene's size.
FAR = 10
# Parameters that are points of the scene, by the kind of object.
POINTS = {
    mi.ObjectType.Shape: ("center", "p0", "p1"),
    mi.ObjectType.Emitter: ("position",),
    mi.ObjectType.Sensor: ("origin", "target"),
}
PLACED_EMITTERS = ("point", "spot", "projector")  # emitters with a position in the scene
UNPLACED_SHAPES = ("shapegroup", "merge")  # shapes whose parts are moved in their place


def far_origin(scene: mi.Scene) -> np.ndarray | None:
    """Centre (3,) [m] of a scene that is too far from the origin; None if it is near enough."""
    low, high = extent(scene)
    away = max(abs(low).max(), abs(high).max())
    return (low + high) / 2 if away > FAR * (high - low).max() else None


def extent(scene: mi.Scene) -> tuple[np.ndarray, np.ndarray]:
    """Lowest and highest coordinates (3,) of the shapes of a scene [m]; 0 without any."""
    boxes = [shape.bbox() for shape in scene.shapes()]
    if not boxes:
        return np.zeros(3), np.zeros(3)
    low = np.array([box.min for box in boxes], dtype=float).reshape(-1, 3).min(axis=0)
    high = np.array([box.max for box in boxes], dtype=float).reshape(-1, 3).max(axis=0)
    return low, high


def move(state, origin: np.ndarray) -> None:
    """Move all shapes, emitters and sensors of a parsed scene by -origin (3,) [m].

    The move is done in double precision. Raises InputError, with the place in the file, if the
    scene has a volume, which cannot be moved.
    """
    nodes = [(node, properties(node)) for node in state.nodes]
    within_groups = children(nodes, lambda node: node.props.plugin_name() == "shapegroup")
    shift = mi.ScalarAffineTransform4d().translate(-origin)
    for number, (node, values) in enumerate(nodes):
        plugin = node.props.plugin_name()
        if node.type == mi.ObjectType.Volume:
            raise InputError(
                f"{mi.parser.file_location(state, node)}: {plugin}: the scene lies far from its "
                "origin, and a volume cannot be moved there; move the scene in its file"
            )
        is_placed = (
            (
                node.type == mi.ObjectType.Shape
                and plugin not in UNPLACED_SHAPES
                and number not in within_groups
            )
            or (node.type == mi.ObjectType.Emitter and plugin in PLACED_EMITTERS)
            or (node.type == mi.ObjectType.Sensor and plugin != "batch")
        )
        if is_placed:
            move_node(node, values, origin, shift)


def move_node(node, values: dict, origin: np.ndarray, shift) -> None:
    """Move one shape, emitter or sensor by changing its `to_world` or its points."""
    points = [name for name in POINTS[node.type] if name in values]

    def point(name):
        return np.array(values[name], dtype=float)

    if "to_world" not in values and points:
        for name in points:
            node.props[name] = mi.ScalarPoint3d(point(name) - origin)
        return
    to_world = mi.ScalarAffineTransform4d(values.get("to_world", mi.ScalarAffineTransform4d()))
    if node.props.plugin_name() == "distant":  # its transform gives only a direction
        for name in points:
            node.props[name] = mi.ScalarPoint3d(point(name) - origin)
        return
    if points:
        # The points are in the shape's own frame. Their distance is put into the transform, so that
        # the points themselves are small numbers.
        first = point(points[0])
        to_world = to_world @ mi.ScalarAffineTransform4d().translate(first)
        for name in points:
            node.props[name] = mi.ScalarPoint3d(point(name) - first)
    node.props["to_world"] = shift @ to_world


def check_meshes_near(meshes: dict[int, float], state, scene: mi.Scene) -> None:
    """Raise InputError for a mesh that is too far from the origin of its file.

    Its coordinates are inaccurate before anything can be moved. meshes: largest coordinate of each
    mesh [m], from `check_mesh_files`. state: the parsed scene.
    """
    low, high = extent(scene)
    size = (high - low).max()
    for number, away in meshes.items():
        if away > SIZES_AWAY * size:
            node = state.nodes[number]
            mesh = f"{mi.parser.file_location(state, node)}: {properties(node)['filename']}"
            raise InputError(
                f"{mesh}: its vertices lie {away:g} m from the origin of the file, in a scene of "
                f"{size:g} m, too far for the renderer's single precision; move the mesh to its "
                "origin and place it by to_world"
            )


# Python files of the user that register plugins with Mitsuba: BSDFs, emitters and others
# ---------------------------------------------------------------------------------------

RUN: set[tuple[Path, str]] = set()  # files that have been run, each with Mitsuba's variant


TRUSTED: set[Path] = set()  # files that the user lets scenarios run


def run_named_plugins(files: Iterable[str | Path]) -> None:
    """Run the plugins that a scenario names, if the user trusts them, see `mi_lcair.trust`.

    The tasks of a worker come from a process that has asked for it.
    """
    for file in files:
        if Path(file).resolve() not in TRUSTED and not is_worker():
            in_python = f"mi_lcair.trust({str(file)!r})"
            how = option("plugin", file) if option("plugin").startswith("--") else in_python
            raise InputError(
                f"[plugins]: '{file}' is a program, which could do anything that you may do; read "
                f"it, and let it run with {how}"
            )
    run_plugin_files(files)


def run_plugin_files(files: Iterable[str | Path]) -> None:
    """Run files that register plugins, each once in the present variant of Mitsuba.

    Raises InputError if a file is absent, is no Python file, or fails.
    """
    for file in files:
        path = Path(file).resolve()
        if (path, mi.variant()) in RUN:
            continue
        if path.suffix != ".py" or not path.is_file():
            raise InputError(
                f"plugin '{file}' is no Python file; give a file that ends with "
                "mi.register_bsdf or mi.register_emitter"
            )
        spec = spec_from_file_location(path.stem, path)
        try:
            spec.loader.exec_module(module_from_spec(spec))
        except Exception as error:  # of any kind, because the code is the user's
            line = traceback.extract_tb(error.__traceback__)[-1]
            what = f"{type(error).__name__}: {error}".splitlines()[0]
            raise InputError(
                f"plugin '{file}': {what} ({Path(line.filename).name}, line {line.lineno})"
            ) from None
        RUN.add((path, mi.variant()))

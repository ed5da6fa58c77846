"""Checks of a parsed scene before Mitsuba creates its objects.

They find values out of bounds, and errors that would end the process or that Mitsuba would ignore.
"""

from difflib import get_close_matches

import mitsuba as mi
import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.physics.bands import band
from mi_lcair.plugins import PLUGINS
from mi_lcair.plugins.properties import BRIGHTEST, HOTTEST, beside_scene

FARTHEST = 1e9  # largest coordinate [m], whose square is far below the largest Float32 number
MOST_SAMPLES = 2**32 - 1  # largest number of samples per pixel
SHARE, POSITIVE, EMITTED = (0, 1), (1e-30, 1e30), (0, BRIGHTEST)
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
    | dict.fromkeys(("eta", "k"), (0, 1e30)),
    mi.ObjectType.Emitter: dict.fromkeys(("radiance", "irradiance", "intensity", "scale"), EMITTED)
    | {"temperature": (1e-30, HOTTEST)},
    mi.ObjectType.Shape: {"radius": POSITIVE},
    mi.ObjectType.Sensor: {"near_clip": POSITIVE, "far_clip": POSITIVE},
    mi.ObjectType.Sampler: {"sample_count": (1, MOST_SAMPLES)},
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
    for number, (node, values) in enumerate(nodes):
        try:
            check_names(node.props.plugin_name(), values)
            check_values(node, values, nodes)
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
            raise InputError(f"{plugin}: unknown property '{name}'; is {near[0]} meant?")


def numbers(value) -> np.ndarray:
    """Numbers of a property that is a float, a colour, a point or a spectrum; otherwise none."""
    if hasattr(value, "wavelengths"):
        return np.array(value.values, dtype=float).ravel()
    if isinstance(value, bool) or not isinstance(
        value, (int, float, mi.ScalarColor3d, mi.ScalarArray3d)
    ):
        return np.empty(0)
    return np.array(value, dtype=float).ravel()


def check_values(node, values: dict, nodes) -> None:
    """Raise InputError for numbers that are not finite in Float32 or are out of bounds."""
    plugin = node.props.plugin_name()
    for name, value in values.items():
        if isinstance(value, mi.ScalarAffineTransform4d | mi.ScalarProjectiveTransform4d):
            check_transform(name, value, node.type)
            continue
        given = numbers(value)
        with np.errstate(over="ignore"):
            bad = ~np.isfinite(given.astype(np.float32))
        if bad.any():
            raise InputError(f"{plugin}: {name} = {given[bad][0]:g}; it must be finite")
        bounds = BOUNDS.get(node.type, {}).get(name)
        if bounds:
            where = f"{plugin}: {name}"
            if plugin not in CHECKED_BY_THEMSELVES:
                check_bounds(where, given, bounds)
            if isinstance(value, mi.Properties.ResolvedReference):
                child, child_values = nodes[value.index()]
                if child.type == mi.ObjectType.Texture:
                    for key in NUMBERS_OF_TEXTURES:
                        check_bounds(where, numbers(child_values.get(key)), bounds)


def check_bounds(where: str, given: np.ndarray, bounds: tuple[float, float]) -> None:
    """Raise InputError for the first number outside the bounds; NaN is outside."""
    lower, upper = bounds
    bad = ~((given >= lower) & (given <= upper))
    if bad.any():
        right = "be positive" if lower == POSITIVE[0] else f"lie in {lower:g}..{upper:g}"
        if lower == POSITIVE[0] and upper < POSITIVE[1]:
            right += f" and at most {upper:g}"
        raise InputError(f"{where} = {given[bad][0]:g}; it must {right}")


def check_transform(name: str, transform, kind) -> None:
    """Raise InputError for a transform that is not finite, is too large, or flattens an object.

    Mitsuba does not bring the axis of <rotate> to length 1. With another length the transform is no
    rotation, and its inverse is another one's, so that normals are wrong.
    """
    matrix = np.array(transform.matrix, dtype=float)
    if not np.isfinite(matrix).all():
        raise InputError(f"{name}: the transform holds NaN or infinity; its numbers must be finite")
    if kind not in (mi.ObjectType.Shape, mi.ObjectType.Sensor, mi.ObjectType.Emitter):
        return
    if abs(matrix).max() > FARTHEST:
        raise InputError(
            f"{name}: the transform reaches {abs(matrix).max():g} m; at most {FARTHEST:g} m are "
            "within single precision"
        )
    lengths = np.linalg.norm(matrix[:3, :3], axis=0)
    if abs(np.linalg.det(matrix[:3, :3] / np.maximum(lengths, 1e-30))) < 1e-9:
        raise InputError(
            f"{name}: the transform flattens to nothing; each scale must differ from 0"
        )
    inverse = np.array(transform.inverse_transpose, dtype=float).T
    if abs(matrix @ inverse - np.eye(4)).max() > 1e-6 * (abs(matrix) @ abs(inverse)).max():
        raise InputError(
            f"{name}: <rotate> has an axis that is not of length 1, which stretches the object; "
            "divide its x, y and z by their length"
        )


def check_complete(node, values: dict, nodes) -> None:
    """Raise InputError if a plugin lacks something without which it would end the process."""
    plugin = node.props.plugin_name()
    if plugin in SPECTRAL_ONLY:
        raise InputError(f"{plugin}: works in spectral variants of Mitsuba alone; use another BSDF")
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

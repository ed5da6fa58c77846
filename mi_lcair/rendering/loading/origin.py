"""Moves scenes that lie far from the origin to it, before Mitsuba uses single precision."""

import mitsuba as mi
import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.models3d.model import SIZES_AWAY
from mi_lcair.rendering.loading.nodes import children, properties

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

"""Scenes that lie far from their origin: moved there before Mitsuba takes them into single
precision.
"""

import mitsuba as mi
import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.models3d.model import SIZES_AWAY
from mi_lcair.rendering.loading.nodes import properties, references

FAR = (
    10  # sizes of the scene away from its origin: then it is moved; Float32 still holds 1e-6 of it
)
# Parameters that hold a point of the scene, and emitters that have a place there
POINTS = {
    mi.ObjectType.Shape: ("center", "p0", "p1"),
    mi.ObjectType.Emitter: ("position",),
    mi.ObjectType.Sensor: ("origin", "target"),
}
PLACED_EMITTERS = ("point", "spot", "projector")
UNPLACED_SHAPES = ("shapegroup", "merge")  # whose place is that of their parts


def far_origin(scene: mi.Scene) -> np.ndarray | None:
    """The middle (3,) [m] of a scene that lies more than FAR times its extent from the origin; None
    where it does not.
    """
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
    """Moves all that has a place in a parsed scene so that `origin` (3,) becomes its origin, in
    double precision.

    Raises InputError, with the place in the file, for a volume in a scene: it cannot be moved.
    """
    nodes = [(node, properties(node)) for node in state.nodes]
    within_groups = {
        child
        for node, values in nodes
        if node.props.plugin_name() == "shapegroup"
        for child in references(values)
    }
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
    """Moves one shape, emitter or sensor by its `to_world` or by its points."""
    points = [name for name in POINTS[node.type] if name in values]
    point = lambda name: np.array(values[name], dtype=float)
    if "to_world" not in values and points:
        for name in points:
            node.props[name] = mi.ScalarPoint3d(point(name) - origin)
        return
    to_world = mi.ScalarAffineTransform4d(values.get("to_world", mi.ScalarAffineTransform4d()))
    if node.props.plugin_name() == "distant":  # its transform is a direction alone
        for name in points:
            node.props[name] = mi.ScalarPoint3d(point(name) - origin)
        return
    if points:
        # the points are in the shape's own frame: what is far of them goes into the transform
        first = point(points[0])
        to_world = to_world @ mi.ScalarAffineTransform4d().translate(first)
        for name in points:
            node.props[name] = mi.ScalarPoint3d(point(name) - first)
    node.props["to_world"] = shift @ to_world


def check_meshes_near(meshes: dict[str, float], scene: mi.Scene) -> None:
    """Raise InputError for a mesh whose file places it too far from the file's own origin: there
    its coordinates have lost their digits before anything can be moved.

    meshes: how far [m] each reaches from there, see `check_mesh_files`.
    """
    low, high = extent(scene)
    size = (high - low).max()
    for mesh, away in meshes.items():
        if away > SIZES_AWAY * size:
            raise InputError(
                f"{mesh}: its vertices lie {away:g} m from the origin of the file, in a scene of "
                f"{size:g} m, too far for the renderer's single precision; move the mesh to its "
                "origin and place it by to_world"
            )

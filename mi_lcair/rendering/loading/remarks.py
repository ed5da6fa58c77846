"""What a user should know of a loaded scene before trusting its picture."""

import mitsuba as mi
import numpy as np

from mi_lcair.models3d.coincident import overlaps
from mi_lcair.plugins.derivatives import members
from mi_lcair.plugins.emission.triangles import is_faceted
from mi_lcair.rendering.loading.nodes import properties, references

WITHOUT_BSDF = ("instance", "shapegroup", "merge")


def shapes_without_bsdf(state) -> list[str]:
    """Remarks on the shapes of a parsed scene for which Mitsuba's default BSDF stands."""
    found = []
    for node in state.nodes:
        if node.type != mi.ObjectType.Shape or node.props.plugin_name() in WITHOUT_BSDF:
            continue
        inside = {state.nodes[child].type for child in references(properties(node))}
        if mi.ObjectType.BSDF not in inside:
            reflects = "nothing" if mi.ObjectType.Emitter in inside else "half of what arrives"
            found.append(
                f"{mi.parser.file_location(state, node)}: the {node.props.plugin_name()} has no "
                f"BSDF; Mitsuba's default stands for it and reflects {reflects}"
            )
    return found


def thin_sheets(scene: mi.Scene) -> list[str]:
    """Remarks on triangles that overlap in one plane, where the renderer meets either at random."""
    corners, shape_of, number = [], [], []
    for shape in scene.shapes():
        if is_faceted(shape):
            buffers = members(shape)
            vertices, faces = (
                buffers[name].numpy().reshape(-1, 3) for name in ("vertex_positions", "faces")
            )
            corners.append(vertices[faces].astype(float))
            shape_of += [shape] * len(faces)
            number.append(np.arange(len(faces)))
    if not corners:
        return []
    found, number = overlaps(np.concatenate(corners)), np.concatenate(number)
    remarks = []
    for pairs, how in ((found.back_to_back, "back to back"), (found.same_side, "one on the other")):
        if len(pairs):
            a, b = (f"{triangle_name(shape_of[k])} {number[k]}" for k in pairs[0])
            remarks.append(
                f"{len(pairs)} pair{'s' * (len(pairs) > 1)} of triangles lie in one plane, {how}, "
                f"first {a} and {b}; which of them is seen is left to rounding: move them apart or "
                "remove one"
            )
    return remarks


def triangle_name(shape) -> str:
    """How a remark names the triangles of a shape."""
    return f"triangle of '{shape.id()}'" if shape.id() else "triangle"


def clipped(loaded, sensors) -> list[str]:
    """Remarks on sensors that may not see the scene whole: Mitsuba cuts each first ray at near_clip
    and far_clip, 0.01 m and 10 km unless the scene says otherwise.
    """
    box, found = loaded.bbox(), []
    low, high = np.array(box.min), np.array(box.max)
    for number, sensor in enumerate(sensors):
        clips, place = members(sensor), members(sensor).get("to_world")
        if place is None or "near_clip" not in clips:
            continue
        eye = np.array(place.matrix)[:3, 3].ravel()[:3]
        nearest = np.linalg.norm(np.maximum(np.maximum(low - eye, eye - high), 0))
        farthest = np.linalg.norm(np.maximum(high - eye, eye - low))
        if nearest < clips["near_clip"] and clips["near_clip"] > 0.01 * np.linalg.norm(high - low):
            found.append(
                f"sensor {number}: does not see what is nearer than its near_clip = {clips['near_clip']:g} m"
            )
        if farthest > clips["far_clip"]:
            found.append(
                f"sensor {number}: does not see what is farther than its far_clip = {clips['far_clip']:g} m"
            )
    return found

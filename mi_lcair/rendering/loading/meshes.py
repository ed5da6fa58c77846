"""Checks of meshes and textures: of their files before loading, of their values afterwards."""

import re
from pathlib import Path

import mitsuba as mi
import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.models3d.modellers.obj import check_obj
from mi_lcair.models3d.modellers.ply import check_ply
from mi_lcair.plugins.derivatives import children, members
from mi_lcair.plugins.emission.triangles import NORMALS, TEXTURE, VERTICES, is_faceted
from mi_lcair.plugins.properties import HOTTEST, beside_scene
from mi_lcair.rendering.loading.nodes import BOUNDS, FARTHEST, properties

READERS = {"ply": check_ply, "obj": check_obj}
OF_MESH = re.compile(r'name = "((?:face|vertex)_\w+)"')  # in the text of a mesh_attribute texture


def check_mesh_files(state) -> dict[int, float]:
    """Largest coordinate of each mesh file of a parsed scene, in the file's axes [m].

    The keys are the numbers of the meshes' nodes. Raises InputError for the first file that Mitsuba
    would misread. Mitsuba drops a facet whose corner does not exist, or ends the process.
    """
    reach, boxes = {}, {}
    for number, node in enumerate(state.nodes):
        check = READERS.get(node.props.plugin_name())
        values = properties(node) if check else {}
        name = values.get("filename")
        path = Path(beside_scene(name)) if isinstance(name, str) else None
        if path and path.is_file():  # Mitsuba raises the error for a missing file
            if path not in boxes:
                try:
                    boxes[path] = check(path)
                except InputError as error:
                    place = mi.parser.file_location(state, node)
                    raise InputError(f"{place}: {error}") from None
            linear = np.eye(3)
            if "to_world" in values:
                linear = np.array(values["to_world"].matrix, dtype=float)[:3, :3]
            corners = np.stack(np.meshgrid(*boxes[path].T), axis=-1).reshape(-1, 3) @ linear.T
            reach[number] = float(abs(corners).max())
    return reach


def check_shapes(scene: mi.Scene) -> None:
    """Raise InputError for shapes and textures of a scene that cannot be used.

    These are shapes without extent or beyond single precision, and textures whose values are
    impossible for a temperature or a reflectance.
    """
    for shape in scene.shapes():
        name = f"shape '{shape.id()}'"
        if not shape.bbox().valid() and is_faceted(shape):
            shape.recompute_bbox()  # `mi.load_dict` does not when it merges shapes of one BSDF
        box = shape.bbox()
        low, high = np.array(box.min, dtype=float), np.array(box.max, dtype=float)
        if not (np.isfinite(low).all() and np.isfinite(high).all() and (low <= high).all()):
            raise InputError(f"{name}: has no extent, or coordinates that are not finite")
        if max(abs(low).max(), abs(high).max()) > FARTHEST:
            raise InputError(f"{name}: reaches beyond {FARTHEST:g} m; move it to the origin")
        if not (high - low).max() > 0:
            raise InputError(f"{name}: is a point; give it a size above 0")
        emitter = shape.emitter()
        if emitter is not None:
            check_texture(shape, members(emitter).get("temperature"), "temperature", (0, HOTTEST))
        check_bsdf(shape, shape.bsdf())


def check_bsdf(shape, bsdf) -> None:
    """Check the textures of a BSDF and of the BSDFs that it wraps."""
    if bsdf is None:
        return
    for key, value in members(bsdf).items():
        bounds = BOUNDS[mi.ObjectType.BSDF].get(key)
        if bounds:
            check_texture(shape, value, key, bounds)
    for child in children(bsdf):
        if isinstance(child, mi.BSDF):
            check_bsdf(shape, child)


def check_texture(shape, texture, what: str, bounds: tuple[float, float]) -> None:
    """Raise InputError for a texture with values out of bounds.

    Also for a texture that names a mesh attribute which the shape does not have. what: the quantity
    that the texture gives, for messages. bounds: smallest and largest allowed value.
    """
    if not isinstance(texture, mi.Texture):
        return
    name, of = f"shape '{shape.id()}': {what}", "texel"
    if texture.class_name() == "MeshAttribute":
        values, of = mesh_attribute(shape, texture, name)
    else:
        arrays = [value for value in members(texture).values() if hasattr(value, "numpy")]
        values = np.concatenate([array.numpy().ravel() for array in arrays] or [np.empty(0)])
    lower, upper = bounds
    is_temperature = what == "temperature"
    bad = ~((values >= lower) & (values <= upper)) | (is_temperature & (values == 0))
    if bad.any():
        right = (
            f"be positive, at most {upper:g}" if is_temperature else f"lie in {lower:g}..{upper:g}"
        )
        unit = " K" if is_temperature else ""
        raise InputError(
            f"{name} of {of} {bad.argmax()} = {values[bad][0]:g}{unit}; it must {right}"
        )


def mesh_attribute(shape, texture, name: str) -> tuple[np.ndarray, str]:
    """Values of the attribute that a `mesh_attribute` texture names, and "facet" or "vertex".

    The word says to what each value belongs. name: the texture's name in messages.
    """
    match = OF_MESH.search(str(texture))
    attribute = match[1] if match else "?"
    buffers = members(shape)
    known = [key for key in buffers if key.startswith(("face_", "vertex_"))]
    attributes = [key for key in known if key not in (VERTICES, NORMALS)]
    if attribute not in attributes or not is_faceted(shape):
        raise InputError(
            f"{name} names the mesh attribute '{attribute}', which the shape does not have; it has "
            f"{', '.join(key for key in attributes if key != TEXTURE) or 'none'}"
        )
    values = buffers[attribute].numpy()
    of = "facet" if attribute.startswith("face_") else "vertex"
    count = shape.face_count() if of == "facet" else shape.vertex_count()
    if len(values) != count:
        raise InputError(
            f"{name}: mesh attribute '{attribute}' has {len(values) // count} numbers for each "
            f"{of}; it must have 1"
        )
    return values, of

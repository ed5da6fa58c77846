"""What a loaded scene is: its line, its fingerprint, and checks of its meshes and textures."""

import os
import re
from hashlib import file_digest, sha256
from pathlib import Path

import mitsuba as mi
import numpy as np

from mi_lcair.declared import Bounds
from mi_lcair.errors import InputError, printable, shortened
from mi_lcair.models3d.modellers.obj import check_obj
from mi_lcair.models3d.modellers.ply import check_ply
from mi_lcair.physics.air.levels import TABLES
from mi_lcair.physics.bands import BUNDLED
from mi_lcair.physics.materials import BUILT_IN
from mi_lcair.plugins.derivatives import members
from mi_lcair.plugins.emission.draw_table import texels
from mi_lcair.plugins.emission.triangles import NORMALS, TEXTURE, VERTICES, is_faceted
from mi_lcair.plugins.properties import TEMPERATURE, beside_scene
from mi_lcair.rendering.loading.parsing import BOUNDS, REACHED, properties

# What a loaded scene tells about itself in one line
# --------------------------------------------------

MOST = 8  # names in a list
LONGEST = 190  # characters of the line


def line(scene) -> str:
    """The scene in one line: name, band, groups, materials, sensors and parameters."""
    lists = {
        "groups": scene.groups,
        "materials": dict.fromkeys(surface.material for surface in scene.surfaces()),
        "sensors": map(sensor_text, scene.sensors),
        "parameters": [f"{name}={value}" for name, value in scene.parameters.items()],
    }
    parts = [f"band {scene.band.label}", *(f"{name} {names(of)}" for name, of in lists.items())]
    return printable(f"<Scene {scene.name}: {'; '.join(parts)}"[: LONGEST - 1] + ">")


def sensor_text(sensor) -> str:
    """Kind and size of a sensor, such as "orthographic 64 x 64"."""
    kind = sensor.class_name().removesuffix("Camera").lower()
    return f"{kind} {' x '.join(str(int(size)) for size in sensor.film().crop_size())}"


def names(texts) -> str:
    """The first names of a list, and how many there are beyond them."""
    texts = [shortened(text, 40) for text in texts]
    more = f" and {len(texts) - MOST} more" if len(texts) > MOST else ""
    return (", ".join(texts[:MOST]) or "none") + more


# The fingerprint of a scene: a number that changes with everything that affects the image
# ----------------------------------------------------------------------------------------

# Name of an object without an id, which contains its address in memory.
NO_ID = re.compile(r"object_\d+")


def source_digest(state) -> bytes:
    """Digest of a parsed scene (`mitsuba.parser.ParserState`) with its $-parameters filled in.

    It contains every property of every node, the content of every file that a property names, and
    the tables that come with the library. The folders of the files do not matter.
    """
    digest, contents = sha256(), {}
    for number, node in enumerate(state.nodes):
        add(digest, f"node {number}", str(node.type), node.props.plugin_name(), node.props.id())
        for name, value in properties(node).items():
            content = None
            if isinstance(value, str):
                if value not in contents:
                    path = named_file(value)
                    contents[value] = path and content_digest(path)
                content = contents[value]
            add(digest, name, content or exact(value))
    for path in (BUILT_IN, *sorted(BUNDLED.glob("*.csv")), *sorted(TABLES.glob("*.csv"))):
        add(digest, content_digest(path))
    return digest.digest()


def described_digest(scene: mi.Scene) -> bytes:
    """Digest of a scene that Mitsuba has loaded, from the description that it prints."""
    return sha256(NO_ID.sub("", str(scene)).encode()).digest()


def fingerprint(source: bytes, scene: mi.Scene, descriptions: list[str]) -> str:
    """16 hexadecimal digits for a scene.

    Parameters
    ----------
    source : bytes
        Its `source_digest`.
    scene : mi.Scene
        The present values of its parameters are part of the fingerprint.
    descriptions : list of str
        Settings that are not parameters, as text.
    """
    digest = sha256(source)
    add(digest, *descriptions)
    for name, value in mi.traverse(scene):
        add(digest, NO_ID.sub("", str(name)), exact(value))
    return digest.hexdigest()[:16]


def add(digest, *pieces: str | bytes) -> None:
    """Add pieces, each after its length, so that different sequences give different digests."""
    for piece in pieces:
        piece = piece.encode() if isinstance(piece, str) else piece
        digest.update(len(piece).to_bytes(8, "little") + piece)


def exact(value) -> str | bytes:
    """All digits of a property or parameter, or its text if it is not a number."""
    if hasattr(value, "matrix"):
        value = value.matrix
    if hasattr(value, "wavelengths"):
        return repr((value.is_uniform(), list(value.wavelengths), list(value.values)))
    if isinstance(value, mi.Properties.ResolvedReference):
        return f"node {value.index()}"
    if hasattr(value, "__array__"):
        return np.ascontiguousarray(value).tobytes()
    return NO_ID.sub("", repr(value))


def named_file(text: str) -> Path | None:
    """The file that a property names, beside the scene or in the working folder; or None."""
    try:
        files = [path for path in (Path(beside_scene(text)), Path(text)) if os.path.isfile(path)]
    except (OSError, ValueError):  # a name that no file system allows
        return None
    return files[0] if files else None


def content_digest(path: Path) -> bytes:
    with path.open("rb") as file:
        return file_digest(file, "sha256").digest()


# Checks of meshes and textures: of their files before loading, of their values afterwards
# ----------------------------------------------------------------------------------------

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
        REACHED.check(max(abs(low).max(), abs(high).max()), f"{name}: largest coordinate")
        if not ((high >= low).all() and (high > low).any()):
            raise InputError(f"{name}: has no extent; give it a size above 0")
        emitter = shape.emitter()
        if emitter is not None:
            check_texture(shape, members(emitter).get("temperature"), "temperature", TEMPERATURE)
        check_bsdf(shape, shape.bsdf())


def check_bsdf(shape, bsdf) -> None:
    """Check the textures of a BSDF and of the BSDFs that it wraps."""
    if bsdf is None:
        return
    held = members(bsdf)
    for key, value in held.items():
        bounds = BOUNDS[mi.ObjectType.BSDF].get(key)
        if bounds:
            check_texture(shape, value, key, bounds)
    for child in held.values():
        if isinstance(child, mi.BSDF):
            check_bsdf(shape, child)


def check_texture(shape, texture, what: str, bounds: Bounds) -> None:
    """Raise InputError for a texture with values out of bounds.

    Also for a texture that names a mesh attribute which the shape does not have. what: the quantity
    that the texture gives, for messages.
    """
    if not isinstance(texture, mi.Texture):
        return
    name, of = f"shape '{shape.id()}': {what}", "texel"
    if texture.class_name() == "MeshAttribute":
        values, of = mesh_attribute(shape, texture, name)
    else:
        arrays = [texels(v).ravel() for v in members(texture).values() if hasattr(v, "numpy")]
        values = np.concatenate(arrays or [np.empty(0)])
    bounds.check_all(values, lambda k: f"{name} of {of} {k}")


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

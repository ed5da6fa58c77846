"""Reader of glTF, PLY and STL files, by trimesh: triangles with the names of their objects."""

import re
from pathlib import Path

import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.extras import optional
from mi_lcair.files import check_file
from mi_lcair.models3d.modellers.axes import AS_BLENDER, EXPORTED
from mi_lcair.models3d.obj import Obj

# Kinds of file by suffix, and the axes `forward` and `up` of their coordinates. glTF has y up by
# its specification; Blender writes the others in its own axes.
KINDS = {
    ".glb": ("glTF", EXPORTED),
    ".gltf": ("glTF", EXPORTED),
    ".ply": ("PLY", AS_BLENDER),
    ".stl": ("STL", AS_BLENDER),
}
# trimesh adds this to the name of a node whose mesh has several materials.
OF_PRIMITIVE = re.compile(r"_[0-9a-f]{6}$")


class Mesh(Obj):
    """The content of a file whose facets are triangles that stand in no line of a text."""

    def place(self, face: int) -> str:
        """Where a face stands in the file, for messages."""
        return f"{self.path}, facet {face}"


def read_mesh(path: str | Path) -> Mesh:
    """Read a glTF, PLY or STL file. The transforms of the file's scene are applied.

    Facets are triangles, mesh after mesh in the file's order. The names of nodes and meshes are
    those of object and group, and labels if they contain '*'. The objects of a PLY or STL file
    without names are called as the file.

    Raises InputError if trimesh is not installed, and for a file that it cannot read, that has no
    triangles, or coordinates that are not finite.
    """
    path = Path(path)
    kind, _ = KINDS[path.suffix.lower()]
    trimesh = optional("trimesh", f"{path}: a {kind} file")
    check_file(path)
    if not path.is_file():
        raise InputError(f"{path}: cannot be read: No such file or directory")
    try:
        scene = trimesh.load_scene(path, process=False)
        pieces = _pieces(trimesh, scene, path)
    except Exception as error:  # trimesh raises what its parsers raise
        if "unexpected length" in str(error):  # its binary PLY has facets of one size only
            raise InputError(
                f"{path}: a binary PLY that is cut off, or whose facets differ in their number of "
                "corners; export it triangulated or as ASCII"
            ) from None
        raise InputError(f"{path}: cannot be read as {kind}: {error or type(error)}") from None
    if not pieces:
        raise InputError(f"{path}: no faces; the {kind} file must contain a mesh of triangles")
    points, faces, parts = zip(*pieces)
    for piece in points:
        if not np.isfinite(piece).all():
            raise InputError(f"{path}: a coordinate is not finite")
    sizes = [len(own) for own in faces]
    offsets = np.cumsum([0, *map(len, points)])
    known = list(dict.fromkeys(parts))
    labels = list(dict.fromkeys(filter(None, map(_label, known))))
    count = sum(sizes)
    return Mesh(
        path,
        np.concatenate(points),
        np.concatenate([own + offset for own, offset in zip(faces, offsets)]).ravel(),
        3 * np.arange(count + 1),
        np.arange(count),
        [(0, kind, text) for kind, text in labels],
        np.repeat([labels.index(_label(part)) if _label(part) else -1 for part in parts], sizes),
        known,
        np.repeat([known.index(part) for part in parts], sizes),
    )


def _pieces(trimesh, scene, path):
    """Points (V, 3), triangles (T, 3) and (material, group, object) of each mesh of a scene."""
    order = {name: number for number, name in enumerate(scene.geometry)}
    placed = sorted((order[scene.graph[node][1]], node) for node in scene.graph.nodes_geometry)
    pieces = []
    for _, node in placed:
        transform, name = scene.graph[node]
        mesh = scene.geometry[name]
        if not isinstance(mesh, trimesh.Trimesh) or not len(mesh.faces):
            continue
        faces = np.array(mesh.faces, np.int64)
        if not 0 <= faces.min() <= faces.max() < len(mesh.vertices):
            raise InputError("a triangle names a vertex that does not exist")
        if np.linalg.det(transform[:3, :3]) < 0:
            faces = faces[:, ::-1]  # a mirror image turns the triangles over
        points = np.asarray(mesh.vertices, float) @ transform[:3, :3].T + transform[:3, 3]
        if mesh.metadata.get("from_gltf_primitive"):
            node = OF_PRIMITIVE.sub("", node)
        is_named = "from_gltf_primitive" in mesh.metadata or mesh.metadata.get("name")
        material = getattr(getattr(mesh.visual, "material", None), "name", None) or ""
        part = (material, name, node) if is_named else ("", "", path.stem)
        pieces.append((points, faces, part))
    return pieces


def _label(part):
    """(kind, label) among the names of a mesh; None if none is a label."""
    _, group, node = part
    return next(
        ((kind, name) for kind, name in (("object", node), ("mesh", group)) if "*" in name), None
    )

"""Reader of glTF, PLY and STL files: faces with the names of their objects."""

import re
from pathlib import Path

import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.extras import optional
from mi_lcair.files import check_file
from mi_lcair.models3d.modellers.axes import AS_BLENDER, EXPORTED
from mi_lcair.models3d.modellers.obj import Obj
from mi_lcair.models3d.modellers.ply import read_ply

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
    """The content of a file whose facets are not lines of a text."""

    def place(self, face: int) -> str:
        """Where a face stands in the file, for messages."""
        return f"{self.path}, facet {face}"


def read_mesh(path: str | Path) -> Mesh:
    """Read a glTF, PLY or STL file. The transforms of the file's scene are applied.

    Facets are the faces of a PLY file. In the other formats they are triangles, mesh after mesh in
    the file's order. The names of nodes and meshes are those of object and group, and labels if
    they contain '*'. The objects of a PLY or STL file without names are called as the file.

    Raises InputError for a file that cannot be read, that has no faces, or coordinates that are not
    finite, and if trimesh is not installed, which reads glTF and STL.
    """
    path = Path(path)
    kind, _ = KINDS[path.suffix.lower()]
    if kind == "PLY":
        faces = read_ply(path)
        return _mesh(path, [(faces.vertices, faces.sizes, faces.corners, ("", "", path.stem))])
    trimesh = optional("trimesh", f"{path}: a {kind} file")
    check_file(path)
    if not path.is_file():
        raise InputError(f"{path}: cannot be read: No such file or directory")
    try:
        scene = trimesh.load_scene(path, process=False)
        pieces = _pieces(trimesh, scene, path)
    except Exception as error:  # trimesh raises what its parsers raise
        raise InputError(f"{path}: cannot be read as {kind}: {error or type(error)}") from None
    if not pieces:
        raise InputError(f"{path}: no faces; the {kind} file must contain a mesh of triangles")
    if not all(np.isfinite(points).all() for points, *_ in pieces):
        raise InputError(f"{path}: a coordinate is not finite")
    return _mesh(path, pieces)


def _mesh(path, pieces):
    """The Mesh of some pieces: (points, sizes, corners, (material, group, object)) each.

    points: (V, 3). sizes: number of corners of each face, (F,). corners: indices of the piece's
    points, face after face, (N,).
    """
    points, sizes, corners, parts = zip(*pieces)
    offsets = np.cumsum([0, *map(len, points)])
    counts = [len(size) for size in sizes]
    known = list(dict.fromkeys(parts))
    labels = list(dict.fromkeys(filter(None, map(_label, known))))
    return Mesh(
        path,
        np.concatenate(points),
        np.concatenate([corner + offset for corner, offset in zip(corners, offsets)]),
        np.concatenate([[0], *sizes]).cumsum(),
        np.arange(sum(counts)),
        [(0, kind, text) for kind, text in labels],
        np.repeat([labels.index(_label(part)) if _label(part) else -1 for part in parts], counts),
        known,
        np.repeat([known.index(part) for part in parts], counts),
    )


def _pieces(trimesh, scene, path):
    """The meshes of a scene, as `_mesh` takes them."""
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
        pieces.append((points, np.full(len(faces), 3), faces.ravel(), part))
    return pieces


def _label(part):
    """(kind, label) among the names of a mesh; None if none is a label."""
    _, group, node = part
    return next(
        ((kind, name) for kind, name in (("object", node), ("mesh", group)) if "*" in name), None
    )

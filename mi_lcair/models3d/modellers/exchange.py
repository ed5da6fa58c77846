"""Reader of glTF, PLY and STL files: faces with the names of their objects."""

import re
from pathlib import Path

import numpy as np
import scipy

from mi_lcair.errors import InputError, check_known, option
from mi_lcair.extras import optional
from mi_lcair.files import check_file
from mi_lcair.models3d.modellers.obj import Obj
from mi_lcair.models3d.modellers.ply import read_ply
from mi_lcair.scenes import USD

# Temperatures of facets from a mesh of another program, such as a FEM model
# --------------------------------------------------------------------------

SUFFIXES = (".vtu", ".vtk", ".med", ".inp", ".msh", ".xdmf", ".e")  # that meshio reads
WORDS = ("temp", "kelvin", "nt11")  # in the names of temperatures; NT11 is that of Abaqus


def temperatures_of_mesh(
    path: Path, polygons: list[np.ndarray]
) -> tuple[np.ndarray, tuple[str, ...]]:
    """Temperatures of facets from the cells or the nodes of a mesh [K], (F,).

    A facet has the temperature of the nearest cell, or the mean over its corners of the nearest
    nodes.

    Parameters
    ----------
    path : Path
        File that meshio reads, in metres, with one temperature of each cell or node.
    polygons : list of ndarray
        Corners of each facet [m], (corners, 3).

    Returns
    -------
    kelvin : ndarray
    remarks : tuple of str
        A line if a facet is farther from the mesh than it is large.

    Raises
    ------
    InputError
        If the file cannot be read, or has no temperatures or several.
    """
    meshio = optional("meshio", f"temperatures {path}")
    check_file(path)
    try:
        mesh = meshio.read(path)
    except (SystemExit, Exception) as error:  # meshio ends the program for some files
        raise InputError(f"temperatures {path}: cannot be read: {error}") from None
    cells = {name: np.concatenate([*map(np.ravel, of)]) for name, of in mesh.cell_data.items()}
    nodes = {name: np.ravel(values) for name, values in mesh.point_data.items()}
    named = [
        (values, is_node)
        for is_node, data in ((False, cells), (True, nodes))
        for name, values in data.items()
        if any(word in name.lower() for word in WORDS)
    ]
    if len(named) != 1:
        names = ", ".join([*cells, *nodes]) or "none"
        raise InputError(
            f"temperatures {path}: needs one field of cells or nodes whose name has "
            f"{' or '.join(WORDS)}; its fields are {names}"
        )
    ((values, of_nodes),) = named
    points = mesh.points @ np.eye(mesh.points.shape[1], 3)
    if of_nodes:
        places, count = np.concatenate(polygons), [len(polygon) for polygon in polygons]
    else:
        points = np.concatenate([points[block.data].mean(axis=1) for block in mesh.cells])
        places, count = np.array([polygon.mean(axis=0) for polygon in polygons]), 1
    apart, nearest = scipy.spatial.cKDTree(points).query(places)
    facet = np.repeat(np.arange(len(polygons)), count)
    kelvin = np.bincount(facet, values[nearest]) / np.bincount(facet)
    size = np.array([np.ptp(polygon, axis=0).max() for polygon in polygons])
    worst = int(np.argmax(apart - size[facet]))
    if apart[worst] <= size[facet[worst]]:
        return kelvin, ()
    return kelvin, (
        f"{path}: facet {facet[worst]} gets the temperature of a point {apart[worst]:.3g} m "
        "away, which is more than its size; check the units and the axes of the mesh",
    )


# Axes of other programs: how a file's coordinates become x forward (nose), y left, z up
# --------------------------------------------------------------------------------------
# An exporter of Blender writes Blender's +Y along the file's axis `forward` and Blender's +Z along
# the axis `up`. The same two names undo it here, as they do in Blender's importer. In Blender's own
# coordinates, z then points up, and the nose points along the axis `nose`.

AXES = ("X", "Y", "Z", "-X", "-Y", "-Z")
AS_BLENDER = ("Y", "Z")  # forward and up of a file whose coordinates are those of Blender
EXPORTED = ("-Z", "Y")  # forward and up that Blender's OBJ exporter uses if nothing else is chosen
# Largest distance of a mirrored corner from the nearest corner, as a fraction of the extent, and
# the fraction of the corners that must have such a partner, in a model that counts as symmetric.
TOLERANCE, PARTNERS = 1e-3, 0.99
MOST_MIRRORED = 20_000  # corners that are mirrored; of more, every n-th


def rotation(forward: str = "Y", up: str = "Z", nose: str = "X") -> np.ndarray:
    """The matrix (3, 3) that turns a file's coordinates into those of a model.

    forward, up: axes of the file along which Blender's +Y and +Z were written. nose: axis of
    Blender's coordinates along which the nose points. Each is one of AXES. Raises InputError for
    other names, and for axes that exclude each other.
    """
    for name, axis in (("forward", forward), ("up", up), ("nose", nose)):
        check_known(f"axis in {option(name)}", AXES, axis)
    if forward[-1] == up[-1]:
        raise InputError(
            f"{_given(forward, up)} lie on one line; Blender's OBJ exporter has "
            f"{_given(*EXPORTED)} unless it is set otherwise"
        )
    if nose[-1] == "Z":
        raise InputError(f"{option('nose', nose)} is vertical in Blender; give X, Y, -X or -Y")
    y, z, x = _vector(forward), _vector(up), _vector(nose)
    to_blender = np.stack([np.cross(y, z), y, z])
    to_model = np.stack([x, np.cross([0, 0, 1], x), [0, 0, 1]])
    return to_model @ to_blender


def remark(points: np.ndarray, blender: str) -> str | None:
    """A line about a file that was probably exported with y up; None if nothing tells so.

    Vehicles are symmetric about the plane y = 0. If the model is symmetric about z = 0 instead, its
    y axis may point up. A file of Blender is remarked unless its symmetry shows that z points up,
    because Blender's default is y up and its header does not name the axes.

    points: corners (N, 3) of the model in the file's coordinates. blender: version of Blender that
    wrote the file, or "".
    """
    undo, keep = _given(*EXPORTED), _given(*AS_BLENDER)
    about_y, about_z = _is_symmetric(points, 1), _is_symmetric(points, 2)
    if about_z and not about_y:
        writer = f"Blender {blender} wrote the file, and the" if blender else "the"
        return (
            f"{writer} model is symmetric about z = 0 and not about y = 0, like a model that was "
            f"exported with y up; if it was, give {undo}, otherwise {keep}"
        )
    if blender and not (about_y and not about_z):
        return (
            f"Blender {blender} wrote the file, and its OBJ exporter writes y up by default; "
            f"give {undo} if the export dialogue had this setting, or {keep} if it had the other "
            "one"
        )
    return None


def _given(forward: str, up: str) -> str:
    """The options forward and up with their values, as the caller writes them."""
    return f"{option('forward', forward)} {option('up', up)}"


def _is_symmetric(points, axis):
    """Whether points (N, 3) are symmetric about the plane where their coordinate `axis` is 0."""

    extent = np.ptp(points, axis=0)
    if extent[axis] <= TOLERANCE * extent.max():
        return False  # it is flat
    mirrored = points[:: -(-len(points) // MOST_MIRRORED)].copy()
    mirrored[:, axis] *= -1
    distance, _ = scipy.spatial.cKDTree(points).query(mirrored)
    return np.mean(distance <= TOLERANCE * extent.max()) >= PARTNERS


def _vector(name):
    """The unit vector (3,) of an axis, in whole numbers."""
    return np.eye(3, dtype=int)["XYZ".index(name[-1])] * (-1 if name[0] == "-" else 1)


# Kinds of file by suffix, and the axes `forward` and `up` of their coordinates. glTF has y up by
# its specification; Blender writes the others in its own axes.
KINDS = {
    ".glb": ("glTF", EXPORTED),
    ".gltf": ("glTF", EXPORTED),
    ".ply": ("PLY", AS_BLENDER),
    ".stl": ("STL", AS_BLENDER),
    **dict.fromkeys(USD, ("USD", AS_BLENDER)),  # a file says which axis is up
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
    labels = list(dict.fromkeys(filter(None, map(label_in, known))))
    return Mesh(
        path,
        np.concatenate(points),
        np.concatenate([corner + offset for corner, offset in zip(corners, offsets)]),
        np.concatenate([[0], *sizes]).cumsum(),
        np.arange(sum(counts)),
        [(0, kind, text) for kind, text in labels],
        np.repeat(
            [labels.index(label) if (label := label_in(part)) else -1 for part in parts], counts
        ),
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


def label_in(part: tuple[str, str, str]) -> tuple[str, str] | None:
    """(kind, label) among the names of a mesh; None if none is a label."""
    _, group, node = part
    return next(
        ((kind, name) for kind, name in (("object", node), ("mesh", group)) if "*" in name), None
    )

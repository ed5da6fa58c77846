"""Motions that a user declares, see `mi_lcair.rendering.motions.table`.

With `scale`, a vertex moves by value x scale x (vertex - middle), component by component. The
middle is that of the groups or, with `each`, of each connected part. With `displaced`, it moves by
value x (vertex of that file - vertex). Both are in the axes of the model.
"""

from pathlib import Path

import mitsuba as mi
import numpy as np

from mi_lcair.errors import InputError, check_known
from mi_lcair.files import check_file
from mi_lcair.models3d.coincident import weld
from mi_lcair.plugins.emission.triangles import triangle_vertices, vertex_positions
from mi_lcair.rendering.motions.motion import Motion, groups_of_meshes
from mi_lcair.rendering.motions.table import Declared

LARGEST = 1e3  # bound of the value of a declared motion, which is 0 in the loaded scene


def declared_motions(scene, declared: dict[str, Declared], points: dict) -> list[Motion]:
    """The declared motions of a scene.

    points: vertices (n, 3) of each mesh in the axes of the model [m]. Raises InputError for unknown
    groups, for a file with other triangles, and for a motion that moves nothing.
    """
    groups, motions = groups_of_meshes(scene), []
    for name, motion in declared.items():
        check_known(f"group of meshes of {scene.name}", groups, *motion.groups)
        shapes = [shape for group in motion.groups for shape in groups[group]]
        if motion.displaced:
            displacement = displaced(name, motion.displaced, shapes, points)
        else:
            displacement = stretched(motion, shapes, points)
        if not any(moved.any() for moved in displacement.values()):
            raise InputError(f"motion '{name}' moves no vertex; check its groups and its scale")
        bounds = 0.0, -LARGEST, LARGEST
        motions.append(Motion(name, "1", *bounds, tuple(shapes), displacement=displacement))
    return motions


def stretched(motion: Declared, shapes, points: dict) -> dict:
    """Displacements scale x (vertex - middle) of the vertices of each mesh, (n, 3) [m]."""
    whole, displacement = np.concatenate([points[shape] for shape in shapes]), {}
    for shape in shapes:
        vertices, middle = points[shape], (whole.min(axis=0) + whole.max(axis=0)) / 2
        if motion.each:
            middle = middles_of_parts(vertices, triangle_vertices(shape))
        displacement[shape] = np.array(motion.scale) * (vertices - middle)
    return displacement


def middles_of_parts(vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """For each vertex (n, 3), the middle of the bounding box of its connected part, (n, 3)."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    welded = weld(vertices)
    ends = np.concatenate([welded[triangles[:, [0, 1]]], welded[triangles[:, [1, 2]]]])
    links = coo_array((np.ones(len(ends), bool), ends.T), shape=(len(vertices),) * 2)
    _, part = connected_components(links, directed=False)
    _, part = np.unique(part[welded], return_inverse=True)
    count = part.max() + 1
    low, high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    np.minimum.at(low, part, vertices)
    np.maximum.at(high, part, vertices)
    return ((low + high) / 2)[part]


def displaced(name: str, file: str, shapes, points: dict) -> dict:
    """Displacements of the vertices of a mesh to those of a PLY file, (n, 3) [m]."""
    check_file(Path(file))
    if not Path(file).is_file():
        raise InputError(f"motion '{name}': there is no file {file}")
    other = mi.load_dict({"type": "ply", "filename": file, "face_normals": True}, parallel=False)
    if len(shapes) != 1 or not np.array_equal(*map(triangle_vertices, (other, shapes[0]))):
        raise InputError(
            f"motion '{name}': {file} must have the triangles of the one mesh that it moves, with "
            "other vertices"
        )
    return {shapes[0]: vertex_positions(other).astype(float) - points[shapes[0]]}

"""Axes of other programs: how a file's coordinates become x forward (nose), y left, z up.

An exporter of Blender writes Blender's +Y along the file's axis `forward` and Blender's +Z along
the axis `up`. The same two names undo it here, as they do in Blender's importer. In Blender's own
coordinates, z then points up, and the nose points along the axis `nose`.
"""

import numpy as np

from mi_lcair.errors import InputError, check_known, option

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
            f"{writer} model is symmetric about z = 0 and not about y = 0, as one that was "
            f"exported with y up; if so, give {undo}, otherwise {keep}"
        )
    if blender and not (about_y and not about_z):
        return (
            f"Blender {blender} wrote the file, and its OBJ exporter turns y up by default; give "
            f"{undo} if the export dialogue said so, or {keep} if it said that"
        )
    return None


def _given(forward: str, up: str) -> str:
    """The options forward and up with their values, as the caller writes them."""
    return f"{option('forward', forward)} {option('up', up)}"


def _is_symmetric(points, axis):
    """Whether points (N, 3) are symmetric about the plane where their coordinate `axis` is 0."""
    from scipy.spatial import cKDTree

    extent = np.ptp(points, axis=0)
    if extent[axis] <= TOLERANCE * extent.max():
        return False  # it is flat
    mirrored = points[:: -(-len(points) // MOST_MIRRORED)].copy()
    mirrored[:, axis] *= -1
    distance, _ = cKDTree(points).query(mirrored)
    return np.mean(distance <= TOLERANCE * extent.max()) >= PARTNERS


def _vector(name):
    """The unit vector (3,) of an axis, in whole numbers."""
    return np.eye(3, dtype=int)["XYZ".index(name[-1])] * (-1 if name[0] == "-" else 1)

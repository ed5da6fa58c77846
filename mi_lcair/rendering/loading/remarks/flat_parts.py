"""Remarks on triangles and rectangles of a scene: sheets in one plane, and parts too small."""

import mitsuba as mi
import numpy as np

from mi_lcair.models3d.coincident import overlaps
from mi_lcair.plugins.derivatives import members
from mi_lcair.plugins.emission.triangles import is_faceted, triangle_corners
from mi_lcair.plugins.paths.offsets import UNIT

CORNERS = np.array([[-1, -1, 0, 1], [1, -1, 0, 1], [1, 1, 0, 1], [-1, 1, 0, 1]])  # of a rectangle
HALVES = np.array([[0, 1, 2], [0, 2, 3]])  # its triangles
# Relative error of what is reflected between facets whose size is that of one rounding of their
# coordinates. True errors of 22 cubes of 1 mm to 1 km, up to 100 km from the origin, were at most
# 1.7 times as large. In five of them they were 4 to 17 times smaller, as rounding is random. Errors
# up to RESOLVED are not remarked.
ERROR, RESOLVED = 2.0, 1e-3


def remarks_on_triangles(scene: mi.Scene) -> list[str]:
    """Remarks on the triangles of meshes and the rectangles of a scene, one line each."""
    corners, shapes = [], []
    for shape in scene.shapes():
        of_shape = triangles(shape)
        if of_shape is not None:
            corners.append(of_shape)
            shapes.append(shape)
    if not corners:
        return []
    first = np.cumsum([0, *map(len, corners)])
    corners = np.concatenate(corners)

    def name(number: int) -> str:
        shape = int(np.searchsorted(first, number, side="right")) - 1
        label = shapes[shape].id()
        whose = f"triangle of '{label}'" if label else "triangle"
        return f"{whose} {number - first[shape]}" if is_faceted(shapes[shape]) else f"'{label}'"

    return [
        *without_area(corners, shapes, first),
        *thin_sheets(corners, name),
        *small_parts(corners, name),
    ]


def triangles(shape) -> np.ndarray | None:
    """Corners of a mesh's or a rectangle's triangles, (n, 3, 3) [m]; None for other shapes."""
    if is_faceted(shape):
        return np.stack(triangle_corners(shape), axis=1).astype(float)
    if shape.class_name() != "Rectangle":
        return None
    to_world = np.array(members(shape)["to_world"].matrix, dtype=float).reshape(4, 4)
    return (CORNERS @ to_world.T)[HALVES, :3]


def without_area(corners: np.ndarray, shapes: list, first: np.ndarray) -> list[str]:
    """Remarks on shapes that no ray can hit, as all of their triangles are points or lines.

    first: number of the first triangle of each shape, and of all triangles.
    """
    is_empty = sizes(corners) == 0
    return [
        f"'{shape.id()}' has no area: all of its {end - begin} triangles are points or lines in "
        "single precision, and no ray hits them; move the scene to the origin, or remove the shape"
        for shape, begin, end in zip(shapes, first, first[1:])
        if is_empty[begin:end].all()
    ]


def sizes(corners: np.ndarray) -> np.ndarray:
    """Square root of twice the area of triangles (n, 3, 3), (n,) [m]."""
    sides = corners[:, 1:] - corners[:, :1]
    return np.sqrt(np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1))


def thin_sheets(corners: np.ndarray, name) -> list[str]:
    """Remarks on triangles that overlap in one plane, where rays hit either one at random.

    corners: (n, 3, 3) [m]. name: function that gives the name of a triangle by its number.
    """
    sheets, remarks = overlaps(corners), []
    for pairs, how in (
        (sheets.back_to_back, "back to back"),
        (sheets.same_side, "one on the other"),
    ):
        if len(pairs):
            a, b = map(name, pairs[0])
            remarks.append(
                f"{len(pairs)} pair{'s' * (len(pairs) > 1)} of triangles lie in one plane, {how}, "
                f"first {a} and {b}; which of them is seen is left to rounding: move them apart or "
                "remove one"
            )
    return remarks


def small_parts(corners: np.ndarray, name) -> list[str]:
    """Remark on triangles whose size is not much more than the rounding of their coordinates."""
    size = sizes(corners)
    away = np.abs(corners).max(axis=(1, 2))
    error = ERROR * UNIT * away / np.maximum(size, 1e-30)
    small = (error > RESOLVED) & (size > 0)
    if not small.any():
        return []
    worst = int(np.where(small, error, 0).argmax())
    return [
        f"{small.sum()} of {len(corners)} triangles are small for where "
        f"they are: {name(worst)} is {size[worst]:.2g} m large and {away[worst]:.3g} m from the "
        f"origin, where single precision leaves errors of about {min(error[worst], 1):.1%}, "
        "sometimes of a tenth of it, of what such parts reflect to each other; move the scene, or "
        "make the part a scene of its own"
    ]

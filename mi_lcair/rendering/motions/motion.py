"""Motions of a scene's meshes by name, and the vertices that they give.

======================================= ===========================================================
model.yaw_deg, .pitch_deg, .roll_deg    attitude of the model: turns about the axes z, -y and x
                                        through the origin of the scene's file, roll first [deg]
GROUP.size                              factor of the size of a group, about its middle
GROUP.yaw_deg, .pitch_deg, .roll_deg    the same turns of one group, about its middle [deg]
GROUP.x_m, .y_m, .z_m                   shift of a group [m]
own names                               see `mi_lcair.rendering.motions.declared`
observer.NAME                           see `mi_lcair.rendering.motions.observer`
======================================= ===========================================================

The motions of a group act in the axes of the model: x toward the nose, y to the left, z up. They
act in the order of the table, own ones first, and the attitude of the model acts last. The middle
of a group is that of its bounding box in these axes.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial

import mitsuba as mi
import numpy as np

from mi_lcair.plugins.emission.triangles import is_faceted
from mi_lcair.plugins.emitters.thermal_emitter import is_thermal
from mi_lcair.rendering.loading.files import survey_values
from mi_lcair.rendering.views import model_shapes

MODEL = "model"
# Axis and sign of each turn in the order in which they act, as the attitude of a scene's XML
TURNS = {"roll_deg": (0, 1.0), "pitch_deg": (1, -1.0), "yaw_deg": (2, 1.0)}
SHIFTS = {"x_m": 0, "y_m": 1, "z_m": 2}
RESERVED = (MODEL, "observer", "sun")  # owners of motions that are no groups of meshes
FULL_TURN_DEG, LARGEST_SHIFT_M, SIZES = 360.0, 1e6, (1e-3, 1e3)


@dataclass(frozen=True)
class Motion:
    """A motion: a name, and how its value moves the vertices of some meshes.

    unit: "deg", "m" or "1". rest: its value in the loaded scene. lower, upper: its bounds. shapes:
    the meshes. moved: function of vertices (n, 3) [m] and of the value. displacement: instead, the
    displacement of the vertices of each mesh for a value of 1, (n, 3) [m].
    """

    name: str
    unit: str
    rest: float
    lower: float
    upper: float
    shapes: tuple[mi.Shape, ...]
    moved: Callable[[np.ndarray, float], np.ndarray] | None = None
    displacement: dict[mi.Shape, np.ndarray] = field(default_factory=dict)

    def vertices(self, shape: mi.Shape, before: np.ndarray, value: float) -> np.ndarray:
        """Vertices of a mesh [m], (n, 3), from those before the motion."""
        if self.moved is not None:
            return self.moved(before, value)
        return before + value * self.displacement[shape]


def turned(vertices: np.ndarray, degrees: float, turn: str, middle: np.ndarray) -> np.ndarray:
    """Vertices (n, 3) after a turn, a key of TURNS, about an axis through `middle` (3,)."""
    axis, sign = TURNS[turn]
    c, s = np.cos(np.radians(degrees)), sign * np.sin(np.radians(degrees))
    matrix = np.eye(3)
    j, k = (axis + 1) % 3, (axis + 2) % 3
    matrix[[j, j, k, k], [j, k, j, k]] = c, -s, s, c
    return middle + (vertices - middle) @ matrix.T


def shifted(vertices: np.ndarray, metres: float, axis: int) -> np.ndarray:
    return vertices + metres * np.eye(3)[axis]


def scaled(vertices: np.ndarray, size: float, middle: np.ndarray) -> np.ndarray:
    return middle + size * (vertices - middle)


def groups_of_meshes(scene) -> dict[str, list[mi.Shape]]:
    """The meshes of each group of the model that consists of meshes, by name of the group."""
    groups = {}
    for shape in model_shapes(scene):
        if is_thermal(shape.emitter()):
            groups.setdefault(shape.emitter().group, []).append(shape)
    return {group: groups[group] for group in sorted(groups) if all(map(is_faceted, groups[group]))}


def attitude_of(scene) -> list[Motion]:
    """The turns of a scene's model; none if a part of it is no mesh.

    They rest at the $-parameters of the same names with which the scene was loaded.
    """
    shapes, rest = model_shapes(scene), {}
    if not all(map(is_faceted, shapes)):
        return []
    if scene.path is not None:
        values = survey_values(scene.path, scene.parameters)
        rest = {turn: float(values[turn]) for turn in TURNS if turn in values}
    return turns(MODEL, shapes, -np.array(scene.origin), rest)


def motions_of_groups(scene, points: dict) -> list[Motion]:
    """The motions of the groups of a scene.

    A group whose name is one of RESERVED has none. points: vertices (n, 3) of each mesh in the axes
    of the model [m].
    """
    motions = []
    for group, shapes in groups_of_meshes(scene).items():
        if group in RESERVED:
            continue
        of_group = np.concatenate([points[shape] for shape in shapes])
        middle = (of_group.min(axis=0) + of_group.max(axis=0)) / 2
        size, each = partial(scaled, middle=middle), tuple(shapes)
        motions.append(Motion(f"{group}.size", "1", 1.0, *SIZES, each, size))
        motions += turns(group, shapes, middle, {})
        bounds = 0.0, -LARGEST_SHIFT_M, LARGEST_SHIFT_M
        motions += [
            Motion(f"{group}.{name}", "m", *bounds, each, partial(shifted, axis=axis))
            for name, axis in SHIFTS.items()
        ]
    return motions


def turns(owner: str, shapes, middle: np.ndarray, rest: dict[str, float]) -> list[Motion]:
    """The turns of some meshes about a point, in the order in which they act."""
    bounds, each = (-FULL_TURN_DEG, FULL_TURN_DEG), tuple(shapes)
    return [
        Motion(
            f"{owner}.{turn}",
            "deg",
            rest.get(turn, 0.0),
            *bounds,
            each,
            partial(turned, turn=turn, middle=middle),
        )
        for turn in TURNS
    ]


def in_axes_of_model(vertices: np.ndarray, attitude: list[Motion]) -> np.ndarray:
    """Vertices of the loaded scene (n, 3) in the axes of the model, before its attitude."""
    for motion in reversed(attitude):
        vertices = motion.moved(vertices, -motion.rest)
    return vertices

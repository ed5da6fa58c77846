"""Motions of a scene's meshes by name, and the vertices that they give.

======================================= ===========================================================
model.yaw_deg, .pitch_deg, .roll_deg    attitude of the model: turns about the axes z, -y and x
                                        through the origin of the scene's file, roll first [deg]
GROUP.yaw_deg, .pitch_deg, .roll_deg    the same turns of one group, about its middle [deg]
GROUP.x_m, .y_m, .z_m                   shift of a group along the axes of the scene [m]
GROUP.size                              factor of the size of a group, about its middle
======================================= ===========================================================

The middle of a group is that of its bounding box. The size of a group acts first, then its turns
and its shifts, and then the attitude of the model.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import mitsuba as mi
import numpy as np

from mi_lcair.plugins.emission.triangles import is_faceted, vertex_positions
from mi_lcair.plugins.emitters.thermal_emitter import facet_type_of, is_thermal
from mi_lcair.rendering.loading.files import survey_values

MODEL = "model"
# Axis and sign of each turn in the order in which they act, as the attitude of a scene's XML
TURNS = {"roll_deg": (0, 1.0), "pitch_deg": (1, -1.0), "yaw_deg": (2, 1.0)}
SHIFTS = {"x_m": 0, "y_m": 1, "z_m": 2}
RESERVED = (MODEL, "observer", "sun")  # owners of motions that are no groups of meshes
LARGEST_SHIFT, SMALLEST_SIZE, LARGEST_SIZE = 1e6, 1e-3, 1e3


@dataclass(frozen=True)
class Motion:
    """A motion: a name, and how its value moves the vertices of some meshes.

    unit: "deg", "m" or "1". rest: its value in the loaded scene. lower, upper: its bounds. shapes:
    the meshes. moved: vertices (n, 3) [m] for vertices and a value, Float64.
    """

    name: str
    unit: str
    rest: float
    lower: float
    upper: float
    shapes: tuple[mi.Shape, ...]
    moved: Callable[[np.ndarray, float], np.ndarray]

    @property
    def is_attitude(self) -> bool:
        """Whether it is a part of the attitude of the model."""
        return self.name.partition(".")[0] == MODEL


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


def motions_of(scene, loaded: dict) -> dict[str, Motion]:
    """The motions of a scene by name.

    scene: a Scene. loaded: vertices (n, 3) of the loaded scene, for the meshes that have been moved
    since. A group whose name is one of RESERVED has no motions, nor has one with a shape that is no
    mesh.
    """
    model = [shape for shape in scene.mi.shapes() if facet_type_of(shape.emitter()) == "model"]
    groups = {}
    for shape in model:
        if is_thermal(shape.emitter()):
            groups.setdefault(shape.emitter().group, []).append(shape)
    origin = -np.array(scene.origin)
    motions = turns(MODEL, model, origin, attitude(scene)) if all(map(is_faceted, model)) else []
    for group, shapes in sorted(groups.items()):
        if group in RESERVED or not all(map(is_faceted, shapes)):
            continue
        points = np.concatenate([loaded.get(s, vertex_positions(s)) for s in shapes])
        middle = (points.min(axis=0) + points.max(axis=0)).astype(float) / 2
        size = partial(scaled, middle=middle)
        bounds = 1.0, SMALLEST_SIZE, LARGEST_SIZE
        motions.append(Motion(f"{group}.size", "1", *bounds, tuple(shapes), size))
        motions += turns(group, shapes, middle, {})
        motions += [
            Motion(
                f"{group}.{name}",
                "m",
                0.0,
                -LARGEST_SHIFT,
                LARGEST_SHIFT,
                tuple(shapes),
                partial(shifted, axis=axis),
            )
            for name, axis in SHIFTS.items()
        ]
    return {motion.name: motion for motion in motions}


def attitude(scene) -> dict[str, float]:
    """The attitude in which a scene was loaded, from the $-parameters of its file [deg]."""
    if scene.path is None:
        return {}
    values = survey_values(scene.path, scene.parameters)
    return {turn: float(values[turn]) for turn in TURNS if turn in values}


def turns(owner: str, shapes, middle: np.ndarray, rest: dict[str, float]) -> list[Motion]:
    """The turns of some meshes about a point, in the order in which they act."""
    return [
        Motion(
            f"{owner}.{turn}",
            "deg",
            rest.get(turn, 0.0),
            -360.0,
            360.0,
            tuple(shapes),
            partial(turned, turn=turn, middle=middle),
        )
        for turn in TURNS
    ]


def moved_vertices(vertices: np.ndarray, motions: list[Motion], values: dict) -> np.ndarray:
    """Vertices of a mesh for values of its motions, Float64.

    Parameters
    ----------
    vertices : ndarray, shape (n, 3)
        Those of the loaded scene [m].
    motions : list of Motion
        Those of the mesh, in the order in which they act.
    values : dict of str to float
        Values by name, of those that are not at rest.
    """
    attitude = [motion for motion in motions if motion.is_attitude]
    for motion in motions:
        if motion.name in values and not motion.is_attitude:
            vertices = motion.moved(vertices, values[motion.name])
    if any(motion.name in values for motion in attitude):
        for motion in reversed(attitude):
            vertices = motion.moved(vertices, -motion.rest)
        for motion in attitude:
            vertices = motion.moved(vertices, values.get(motion.name, motion.rest))
    return vertices

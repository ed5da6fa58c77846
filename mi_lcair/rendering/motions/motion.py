"""Motions of a scene's meshes by name, and the vertices that they give.

======================================= ===========================================================
model.yaw_deg, .pitch_deg, .roll_deg    attitude of the model: turns about the axes z, -y and x
                                        through the origin of the scene's file, roll first [deg]
GROUP.size                              factor of the size of a group, about its middle
GROUP.yaw_deg, .pitch_deg, .roll_deg    the same turns of one group, about its middle [deg]
GROUP.x_m, .y_m, .z_m                   shift of a group [m]
own names                               motions that a user declares, see `declared_motions`
observer.NAME                           motions of all sensors, see `observer_motions`
======================================= ===========================================================

The motions of a group act in the axes of the model: x toward the nose, y to the left, z up. They
act in the order of the table, own ones first, and the attitude of the model acts last. The middle
of a group is that of its bounding box in these axes.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import mitsuba as mi
import numpy as np
import scipy

from mi_lcair.coincident import weld
from mi_lcair.errors import InputError, check_known
from mi_lcair.files import check_file
from mi_lcair.plugins.emission.triangles import is_faceted, triangle_vertices, vertex_positions
from mi_lcair.plugins.emitters.thermal_emitter import is_thermal, one_sun
from mi_lcair.rendering.facets import normals_of
from mi_lcair.rendering.loading.files import survey_values
from mi_lcair.rendering.motions.table import Declared
from mi_lcair.rendering.views import model_shapes
from mi_lcair.rendering.window import window

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
    displacement of the vertices of each mesh for a value of 1, (n, 3) [m]. place: of a control
    point in the axes of the model (3,) [m].
    """

    name: str
    unit: str
    rest: float
    lower: float
    upper: float
    shapes: tuple[mi.Shape, ...]
    moved: Callable[[np.ndarray, float], np.ndarray] | None = None
    displacement: dict[mi.Shape, np.ndarray] = field(default_factory=dict)
    place: tuple[float, float, float] | None = None

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


# Motions of a scene's sensors and of its sun: where the observer is, and how the image lies
# ------------------------------------------------------------------------------------------
# observer.azimuth_deg, .elevation_deg    direction from the origin of the scene's file to the
#                                         observer: azimuth 0 is +x, 90 +y [deg]
# observer.range_m                        distance of a perspective sensor from that origin [m]
# observer.x_px, .y_px                    shift of the image to the right and down [pixels]
# observer.roll_deg                       turn of the sensor about its axis, to the right [deg]
# sun.azimuth_deg, .elevation_deg         direction of the emitter `sun`, with its light there [deg]
#
# All sensors of a scene move together. The values of the direction are those of the first one.

OBSERVER, SUN = "observer", "sun"
ANGLES = ("azimuth_deg", "elevation_deg")
KINDS = ("OrthographicCamera", "PerspectiveCamera")
LARGEST_PX, LARGEST_RANGE_M = 1e6, 1e7


def observer_motions(scene) -> list[Motion]:
    """The motions of the sensors that a scene was loaded with; none for other kinds of sensors."""
    sensors = scene.mi.sensors()
    if any(sensor.class_name() not in KINDS for sensor in sensors):
        return []
    azimuth, elevation, range_m = direction_of(matrix_of(sensors[0]), np.array(scene.origin))

    def motion(name: str, unit: str, rest: float, lower: float, upper: float) -> Motion:
        return Motion(f"{OBSERVER}.{name}", unit, rest, lower, upper, ())

    motions = [
        motion("azimuth_deg", "deg", azimuth, -FULL_TURN_DEG, FULL_TURN_DEG),
        motion("elevation_deg", "deg", elevation, -90.0, 90.0),
        motion("roll_deg", "deg", 0.0, -FULL_TURN_DEG, FULL_TURN_DEG),
        motion("x_px", "pixel", 0.0, -LARGEST_PX, LARGEST_PX),
        motion("y_px", "pixel", 0.0, -LARGEST_PX, LARGEST_PX),
    ]
    if sensors[0].class_name() == "PerspectiveCamera":
        motions.append(motion("range_m", "m", range_m, 1e-3 * range_m, LARGEST_RANGE_M))
    return motions


def sun_motions(scene) -> list[Motion]:
    """The motions of the emitter `sun`; none without one.

    A sun that a sky fits cannot leave it, see `one_sun`.
    """
    sun = one_sun(scene.mi.emitters())
    if sun is None:
        return []
    rests = zip(ANGLES, (sun.azimuth_deg, sun.elevation_deg), (FULL_TURN_DEG, 90.0))
    return [Motion(f"{SUN}.{n}", "deg", float(rest), -most, most, ()) for n, rest, most in rests]


def matrix_of(sensor) -> np.ndarray:
    """The transformation of a sensor to the scene, (4, 4), Float64."""
    return np.array(mi.traverse(sensor)["to_world"].matrix, dtype=float).reshape(4, 4)


def direction_of(matrix: np.ndarray, origin: np.ndarray) -> tuple[float, float, float]:
    """Azimuth and elevation [deg] and range [m] of a sensor from the origin of its file."""
    backward = -matrix[:3, 2] / np.linalg.norm(matrix[:3, 2])
    azimuth = np.degrees(np.arctan2(backward[1], backward[0]))
    elevation = np.degrees(np.arcsin(np.clip(backward[2], -1, 1)))
    return float(azimuth), float(elevation) + 0.0, float((matrix[:3, 3] + origin) @ backward)


def settings_of(sensor) -> dict:
    """The parameters of a sensor that motions change, by Mitsuba's names."""
    parameters = mi.traverse(sensor)
    names = ("to_world", "principal_point_offset_x", "principal_point_offset_y")
    return {name: type(parameters[name])(parameters[name]) for name in names if name in parameters}


def set_sensor(sensor, settings: dict) -> None:
    parameters = mi.traverse(sensor)
    for name, value in settings.items():
        if isinstance(value, np.ndarray):
            value = type(parameters[name])(mi.Matrix4f(value.tolist()))
        parameters[name] = value
    parameters.update()


def placed(sensor, loaded: dict, change: dict[str, float], rest: dict, origin) -> dict:
    """The parameters of a sensor for values of the motions; the transformation in Float64.

    Parameters
    ----------
    sensor : mi.Sensor
    loaded : dict
        Its `settings_of` in the loaded scene.
    change : dict of str to float
        Differences of all motions from their values at rest, by the names behind `observer.`
    rest : dict of str to float
        The values at rest.
    origin : ndarray, shape (3,)
        Position of the scene's origin in the file's coordinates.
    """
    matrix = np.array(loaded["to_world"].matrix, dtype=float).reshape(4, 4)
    settings = dict(loaded)
    width, height = sensor.film().size()
    if sensor.class_name() == "OrthographicCamera":
        set_sensor(sensor, loaded)
        _, right, down, _ = window(sensor)
        columns, rows = sensor.film().crop_size()
        matrix[:3, 3] -= change["x_px"] * right / columns + change["y_px"] * down / rows
    else:
        for name, pixels in (("x", change["x_px"] / width), ("y", change["y_px"] / height)):
            key = f"principal_point_offset_{name}"
            settings[key] = loaded[key] - pixels
    axis = matrix[:3, 2] / np.linalg.norm(matrix[:3, 2])
    matrix[:3, 3] -= change.get("range_m", 0.0) * axis
    roll = scipy.spatial.transform.Rotation.from_rotvec(
        np.radians(change["roll_deg"]) * axis
    ).as_matrix()
    matrix[:3, :3] = roll @ matrix[:3, :3]
    azimuth, elevation = rest["azimuth_deg"], rest["elevation_deg"]
    ends = azimuth + change["azimuth_deg"], elevation + change["elevation_deg"]
    turn = toward(*ends) @ toward(azimuth, elevation).T
    matrix[:3, :3] = turn @ matrix[:3, :3]
    matrix[:3, 3] = turn @ (matrix[:3, 3] + origin) - origin
    return settings | {"to_world": matrix}


def toward(azimuth_deg: float, elevation_deg: float) -> np.ndarray:
    """The rotation of +x to a direction, (3, 3)."""
    return scipy.spatial.transform.Rotation.from_euler(
        "yz", [-elevation_deg, azimuth_deg], degrees=True
    ).as_matrix()


# Motions that a user declares in a table [motions]
# -------------------------------------------------
# With `scale`, a vertex moves by value x scale x (vertex - middle), component by component. The
# middle is that of the groups or, with `each`, of each connected part. With `displaced`, it moves
# by value x (vertex of that file - vertex). Both are in the axes of the model. With
# `control_points`, there is a motion for each of these, see `control_points`.

CANCELLED = 1e-3  # length of a mean normal, as a fraction of the area, that counts as 0
LARGEST = 1e3  # bound of the value of a declared motion, which is 0 in the loaded scene


def declared_motions(scene, declared: dict[str, Declared], points: dict) -> list[Motion]:
    """The declared motions of a scene.

    points: vertices (n, 3) of each mesh in the axes of the model [m]. Raises InputError for unknown
    groups, for a file with other triangles, and for a motion that moves nothing.
    """
    groups, motions = groups_of_meshes(scene), []
    for name, motion in declared.items():
        check_known(f"group of meshes of {scene.name}", groups, *motion.groups)
        shapes = [shape for group in dict.fromkeys(motion.groups) for shape in groups[group]]
        if not shapes:
            raise InputError(f"motion '{name}': groups = []; name at least one group")
        if motion.control_points:
            motions += control_points(name, motion.control_points, shapes, points)
            continue
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


def control_points(name: str, count: int, shapes, points: dict) -> list[Motion]:
    """Motions of control points of a surface along its outward normals [m].

    The displacements at the control points, which are far from each other, are interpolated by
    multiquadrics (Hardy 1971, 10.1029/JB076i008p01905) and a constant: with equal values, the whole
    surface moves by this value. Raises InputError for too many points, and where the surface has no
    outward normal.
    """
    vertices = np.concatenate([points[shape] for shape in shapes])
    parts, places, normals = outward_normals(vertices, shapes)
    if count > len(places):
        raise InputError(
            f"motion '{name}': control_points = {count}; must be at most the number of vertices, "
            f"{len(places)}"
        )
    if not normals.any(axis=1).all():
        raise InputError(
            f"motion '{name}': {np.sum(~normals.any(axis=1))} vertices have no outward normal, as "
            "those of a plate without thickness; name groups of closed bodies"
        )
    surface, sides = vertices[places], np.ptp(vertices, axis=0)
    distance, chosen = np.linalg.norm(surface - surface.mean(axis=0), axis=1), []
    for k in range(count):
        # Rounded, so that among equally far ones the first is taken on every processor
        chosen.append(int(np.argmax(np.round(distance / sides.max(), 6))))
        new = np.linalg.norm(surface - surface[chosen[-1]], axis=1)
        distance = np.minimum(distance, new) if k else new
    near = scipy.spatial.cKDTree(surface[chosen]).query(surface[chosen], 2)[0][:, 1]
    shares = scipy.interpolate.RBFInterpolator(
        surface[chosen], np.eye(count), kernel="multiquadric", epsilon=1 / near.mean(), degree=0
    )(surface)
    # A vertex without a triangle moves with any other one
    numbers = np.minimum(np.searchsorted(places, parts), len(places) - 1)
    reach = sides.max() / 2
    ends = np.cumsum([len(points[shape]) for shape in shapes])[:-1]
    return [
        Motion(
            f"{name}.{k}",
            "m",
            *(0.0, -reach, reach),
            tuple(shapes),
            displacement=dict(zip(shapes, np.split((share[:, None] * normals)[numbers], ends))),
            place=tuple(surface[chosen[k]].tolist()),
        )
        for k, share in enumerate(shares.T)
    ]


def outward_normals(vertices: np.ndarray, shapes) -> tuple[np.ndarray, ...]:
    """The welded vertex of each vertex (V,) of meshes, these (n,), and their unit normals (n, 3).

    A normal is the mean of those of the triangles, by area. It is 0 where they cancel.
    """
    welded, normals, areas = weld(vertices), np.zeros_like(vertices), np.zeros(len(vertices))
    firsts = np.cumsum([0, *(shape.vertex_count() for shape in shapes)])
    for shape, first in zip(shapes, firsts):
        faces = welded[first + triangle_vertices(shape).astype(int)]
        of_faces = normals_of(vertices[faces]) * (-1 if shape.has_flipped_normals() else 1)
        np.add.at(normals, faces, of_faces[:, None])
        np.add.at(areas, faces, np.linalg.norm(of_faces, axis=1)[:, None])
    places = np.flatnonzero(areas > 0)
    length = np.linalg.norm(normals[places], axis=1, keepdims=True)
    is_known = length > CANCELLED * areas[places, None]
    unit = np.divide(normals[places], length, out=np.zeros((len(places), 3)), where=is_known)
    return welded, places, unit

"""The pose of a loaded scene: values of its motions, and the vertices that they give."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager

import mitsuba as mi
import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.plugins.derivatives import held, own_memory, same_variables
from mi_lcair.plugins.emission.triangles import (
    is_faceted,
    points,
    set_vertices,
    triangle_vertices,
    vertex_buffer,
)
from mi_lcair.plugins.emitters.thermal_emitter import one_sun
from mi_lcair.rendering.motions import motion
from mi_lcair.rendering.motions.table import Declared
from mi_lcair.rendering.views import model_shapes

MOST_HALVINGS = 20  # of a step that would turn triangles over

POSE, DECLARED = "pose", "declared"  # keys of `Scene.moved`


class ScenePose:
    """The motions of a scene, their values, and what they have changed.

    loaded: the vertices of the model's meshes in the loaded scene, mi.Float. present: those that
    the values gave. attitude: the turns of the model. motions: all motions by name, in the order in
    which they act. values: of the motions that are not at rest. sensors: parameters of the sensors
    in the loaded scene. origin: of the scene, see `Scene`. sun: the emitter, or None. sun_before:
    its attributes before a motion.
    """

    def __init__(self, scene):
        meshes = [shape for shape in model_shapes(scene) if is_faceted(shape)]
        self.loaded = dict(zip(meshes, held([vertex_buffer(mesh) for mesh in meshes])))
        self.present, self.values = dict(self.loaded), {}
        self.attitude = motion.attitude_of(scene)
        of_meshes = {mesh: self.in_axes_of_model(mesh) for mesh in meshes}
        motions = motion.declared_motions(scene, scene.moved.get(DECLARED, {}), of_meshes)
        motions += motion.motions_of_groups(scene, of_meshes)
        motions += [*self.attitude, *motion.observer_motions(scene), *motion.sun_motions(scene)]
        self.sensors = {sensor: motion.settings_of(sensor) for sensor in scene.mi.sensors()}
        self.origin = np.array(scene.origin)
        self.sun, self.sun_before = one_sun(scene.mi.emitters()), None
        self.motions = {}
        for entry in motions:
            if entry.name in self.motions:
                raise InputError(f"motion '{entry.name}' is declared, and is a motion of a group")
            self.motions[entry.name] = entry

    @staticmethod
    def of(scene) -> "ScenePose":
        """The pose of a scene; a new one if a caller has changed the vertices since."""
        pose = scene.moved.get(POSE)
        if pose is None or not pose.holds:
            pose = scene.moved[POSE] = ScenePose(scene)
        return pose

    @property
    def holds(self) -> bool:
        """Whether the meshes have the vertices that the values gave."""
        present = [vertex_buffer(mesh) for mesh in self.present]
        return same_variables(present, list(self.present.values()))

    def in_axes_of_model(self, mesh) -> np.ndarray:
        """Vertices (n, 3) of a mesh of the loaded scene in the axes of the model [m], Float64."""
        return motion.in_axes_of_model(points(self.loaded[mesh]).astype(float), self.attitude)

    def buffer(self, mesh) -> mi.Float:
        """The vertices of a mesh for the present values; if all are at rest, those loaded."""
        if not any(mesh in self.motions[name].shapes for name in self.values):
            return self.loaded[mesh]
        self.check_unfolded(mesh)
        array = mi.Float(np.ravel(self.vertices(mesh, self.values)))
        own_memory([array])
        return array

    def check_unfolded(self, mesh) -> None:
        """Raise InputError if the values of control points turn triangles of a mesh over."""
        values = {n: x for n, x in self.values.items() if self.motions[n].place is not None}
        if not values:
            return
        faces = triangle_vertices(mesh)
        before, after = (motion.normals_of(self.vertices(mesh, of)[faces]) for of in ({}, values))
        turned = ((before * after).sum(axis=1) <= 0) & before.any(axis=1)
        if turned.any():
            raise InputError(
                f"the control points {', '.join(list(values)[:3])}{' ...' * (len(values) > 3)} "
                f"turn {turned.sum()} triangles of the surface over; give smaller values, or "
                "declare fewer points"
            )

    def vertices(self, mesh, values: Mapping[str, float]) -> np.ndarray:
        """Vertices (n, 3) of a mesh for values of motions that are not at rest [m], Float64."""
        vertices = self.in_axes_of_model(mesh)
        for entry in self.motions.values():
            if mesh in entry.shapes and (entry.name in values or entry in self.attitude):
                vertices = entry.vertices(mesh, vertices, values.get(entry.name, entry.rest))
        return vertices

    def put(self, scene, buffers: dict[mi.Shape, mi.Float]) -> None:
        """Give meshes of the scene other vertices."""
        set_vertices(scene.mi, buffers)
        self.present |= dict(zip(buffers, held([vertex_buffer(mesh) for mesh in buffers])))

    def place(self, scene, names) -> None:
        """Put all that some motions move where the present values have it."""
        moving = {mesh for name in names for mesh in self.motions[name].shapes}
        owners = {name.partition(".")[0] for name in names if not self.motions[name].shapes}
        if motion.OBSERVER in owners:
            self.place_sensors()
        if motion.SUN in owners:
            self.place_sun()
        self.put(scene, {mesh: self.buffer(mesh) for mesh in self.loaded if mesh in moving})

    def place_sun(self) -> None:
        """Give the sun the place of the present values; at rest, all that it had before."""
        if self.sun_before is None:
            self.sun_before = dict(vars(self.sun))
        place = [self.motions[f"{motion.SUN}.{angle}"] for angle in motion.ANGLES]
        if any(entry.name in self.values for entry in place):
            self.sun.move_to(*(self.values.get(entry.name, entry.rest) for entry in place))
        else:
            vars(self.sun).update(self.sun_before)
            self.sun_before = None

    def place_sensors(self) -> None:
        """Give the sensors the places of the present values; those at rest, bit for bit."""
        for sensor in self.sensors:
            motion.set_sensor(sensor, self.settings_of(sensor, self.values))

    def settings_of(self, sensor, values: Mapping[str, float]) -> dict:
        """The parameters of a sensor for values of motions that are not at rest."""
        motions = {n: m for n, m in self.motions.items() if n.startswith(f"{motion.OBSERVER}.")}
        rest = {name.partition(".")[2]: entry.rest for name, entry in motions.items()}
        change = {
            name.partition(".")[2]: values.get(name, entry.rest) - entry.rest
            for name, entry in motions.items()
        }
        if not any(change.values()):
            return self.sensors[sensor]
        return motion.placed(sensor, self.sensors[sensor], change, rest, self.origin)


def declare(scene, motions: dict[str, Declared]) -> None:
    """Give a scene more motions; raises InputError for what cannot be used."""
    with moved(scene, {name: of.rest for name, of in ScenePose.of(scene).motions.items()}):
        before = dict(scene.moved)
        scene.moved[DECLARED] = scene.moved.get(DECLARED, {}) | motions
        del scene.moved[POSE]
        try:
            ScenePose.of(scene)
        except InputError:
            scene.moved.update(before)
            raise


def known_motions(scene) -> dict[str, motion.Motion]:
    """The motions of a scene by name; without those of sensors if its sensors are others."""
    motions = ScenePose.of(scene).motions
    if scene.sensors == list(scene.mi.sensors()):
        return motions
    return {name: m for name, m in motions.items() if not name.startswith(f"{motion.OBSERVER}.")}


def value_of(scene, moved: motion.Motion) -> float:
    """The present value of a motion."""
    return ScenePose.of(scene).values.get(moved.name, moved.rest)


def set_motions(scene, values: Mapping[str, float]) -> None:
    """Change the values of motions of a scene, and move its vertices.

    The vertices follow in Float64 from those of the loaded scene. Meshes whose motions are all at
    rest get the loaded vertices back, bit for bit. Raises InputError if the sun cannot stand there,
    and for values of control points that fold a surface; the scene is then as before.
    """
    pose = ScenePose.of(scene)
    before = pose.values
    pose.values = {n: v for n, v in (before | values).items() if v != pose.motions[n].rest}
    try:
        pose.place(scene, values)
    except InputError:
        pose.values = before
        pose.place(scene, values)
        raise


@contextmanager
def moved(scene, values: Mapping[str, float]) -> Iterator[None]:
    """Context manager in which motions have other values; the vertices are restored exactly."""
    before = {name: value_of(scene, known_motions(scene)[name]) for name in values}
    set_motions(scene, values)
    try:
        yield
    finally:
        set_motions(scene, before)


def unfolded(scene, of: motion.Motion, step: float) -> float:
    """A step of a motion, halved until two steps either way turn no triangle over."""
    value = value_of(scene, of)
    for _ in range(MOST_HALVINGS if of.place is not None else 0):
        try:
            for end in (value + 2 * step, value - 2 * step):
                with moved(scene, {of.name: end}):
                    pass
            break
        except InputError:
            step /= 2
    return step


@contextmanager
def displaced(scene, vertices: Mapping[mi.Shape, np.ndarray]) -> Iterator[None]:
    """Context manager in which meshes have other vertices (n, 3) [m]; they are restored exactly."""
    pose, arrays = ScenePose.of(scene), {m: mi.Float(np.ravel(v)) for m, v in vertices.items()}
    before = {mesh: pose.present[mesh] for mesh in arrays}
    own_memory(arrays.values())
    pose.put(scene, arrays)
    try:
        yield
    finally:
        pose.put(scene, before)

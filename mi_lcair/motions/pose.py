"""The pose of a loaded scene: values of its motions, and the vertices that they give."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager

import mitsuba as mi
import numpy as np

from mi_lcair.motions.motion import Motion, motions_of, moved_vertices
from mi_lcair.plugins.derivatives import held, own_memory, same_variables
from mi_lcair.plugins.emission.triangles import points, set_vertices, vertex_buffer

MOVED = "pose"  # key of `Scene.moved`


class Pose:
    """What motions have changed in a scene.

    values: of the motions that are not at rest. loaded: the vertices of moved meshes in the loaded
    scene, mi.Float. present: those that the values gave.
    """

    def __init__(self):
        self.values, self.loaded, self.present = {}, {}, {}

    @staticmethod
    def of(scene) -> "Pose":
        """The pose of a scene; a new one if a caller has changed the vertices since."""
        pose = scene.moved.get(MOVED)
        if pose is None or not pose.holds:
            pose = scene.moved[MOVED] = Pose()
        return pose

    @property
    def holds(self) -> bool:
        """Whether the moved meshes have the vertices that the values gave."""
        present = [vertex_buffer(shape) for shape in self.present]
        return same_variables(present, list(self.present.values()))

    @property
    def loaded_points(self) -> dict:
        """Vertices (n, 3) of the moved meshes in the loaded scene [m]."""
        return {shape: points(array) for shape, array in self.loaded.items()}


def known_motions(scene) -> dict[str, Motion]:
    """The motions of a scene by name."""
    return motions_of(scene, Pose.of(scene).loaded_points)


def value_of(scene, motion: Motion) -> float:
    """The present value of a motion."""
    return Pose.of(scene).values.get(motion.name, motion.rest)


def set_motions(scene, values: Mapping[str, float]) -> None:
    """Change the values of motions of a scene, and move its vertices.

    The vertices follow in Float64 from those of the loaded scene. Meshes whose motions are all at
    rest get the loaded vertices back, bit for bit.
    """
    if not values:
        return
    motions, pose = known_motions(scene), Pose.of(scene)
    touched = {shape for name in values for shape in motions[name].shapes}
    pose.values |= values
    pose.values = {n: value for n, value in pose.values.items() if value != motions[n].rest}
    arrays = {}
    for shape in touched:
        of_shape = [motion for motion in motions.values() if shape in motion.shapes]
        pose.loaded.setdefault(shape, *held([vertex_buffer(shape)]))
        if any(motion.name in pose.values for motion in of_shape):
            vertices = points(pose.loaded[shape]).astype(float)
            array = mi.Float(np.ravel(moved_vertices(vertices, of_shape, pose.values)))
            own_memory([array])
        else:
            array = pose.loaded[shape]
        arrays[shape] = array
    set_vertices(scene.mi, arrays)
    pose.present |= {shape: held([vertex_buffer(shape)])[0] for shape in touched}


@contextmanager
def moved(scene, values: Mapping[str, float]) -> Iterator[None]:
    """Context manager in which motions have other values; the vertices are restored exactly."""
    motions = known_motions(scene)
    before = {name: value_of(scene, motions[name]) for name in values}
    set_motions(scene, values)
    try:
        yield
    finally:
        set_motions(scene, before)

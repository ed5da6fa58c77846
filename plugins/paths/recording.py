"""The state of a scene, and the recording of launches in it, whose Python code then runs once.

Dr.Jit's `freeze` records which kernels a function launches, and launches them again for other
arrays. An array that it was not given is an error, but a Python number goes into the recording
unseen. A recording must therefore never outlive the state of the scene for which it was made. It
belongs to a `PathTracer`, whose scene does not change. What differs between its launches is an
array, a number or a text among the arguments.
"""

import gc
import os
import warnings
from contextlib import contextmanager

import drjit as dr
import mitsuba as mi

from mi_lcair.plugins.derivatives import (
    Deriving,
    attached,
    flatten,
    held,
    members,
    same_variables,
    variables,
)

OFF = "MI_LCAIR_NO_RECORDING"  # environment variable; not empty: nothing is recorded
MOST_RECORDINGS = 16  # of one tracer; the one used least recently is dropped
PACKAGE = __name__.partition(".")[0] + "."
# Mitsuba's objects of which `dr.freeze` finds all arrays. Others may end the process while it
# records: a bitmap texture does.
RECORDABLE = {"Scene", "PLYMesh", "SmoothDiffuse", "UniformSpectrum", "MeshAttribute"}
OF_VERTICES = 'name = "vertex_'  # in the text of an attribute; a temperature of it ends the process


class SceneState:
    """All objects of a scene that a path meets, their parameters and their attributes.

    `==` tells whether nothing has changed. It holds references to everything, so that the identity
    of an object or of a Dr.Jit variable says whether it is still the same one. Derivatives of
    parameters are a part of the state. plugins: the plugins in Python of this package. is_known:
    whether everything can be seen; False with a plugin in Python from elsewhere, whose attributes
    may change in any way. is_recordable: whether launches in the scene can be recorded.
    """

    def __init__(self, objects, *settings):
        """objects: those of a scene, see `nodes`."""
        self.values, self.plugins, self.is_known, arrays = list(settings), [], True, []
        self.is_recordable = True
        for node in objects:
            values = [node, *members(node).values()]
            if type(node).__module__.startswith(PACKAGE):
                self.plugins.append(node)
                values += vars(node).values()
                arrays += flatten(tuple(node.derivations)) if isinstance(node, Deriving) else []
            elif not type(node).__module__.startswith("mitsuba"):
                self.is_known = self.is_recordable = False
            elif not is_recordable(node):
                self.is_recordable = False
            for value in values:
                (arrays if dr.is_array_v(value) else self.values).append(value)
        self.variables = held([variable for array in arrays for variable in variables(array)])

    @property
    def has_gradients(self) -> bool:
        return attached(self.variables)

    def __eq__(self, other):
        return (
            self.is_known
            and len(self.values) == len(other.values)
            and all(map(same, self.values, other.values))
            and same_variables(self.variables, other.variables)
        )


def is_recordable(node) -> bool:
    """Whether `dr.freeze` can record an object of Mitsuba."""
    kind = node.class_name().partition("[")[0]
    return kind in RECORDABLE and not (kind == "MeshAttribute" and OF_VERTICES in str(node))


def same(a, b) -> bool:
    """Whether two values are the same object, or equal numbers or texts."""
    return a is b or (type(a) is type(b) and isinstance(a, (bool, int, float, str)) and a == b)


class Recorded:
    """Recordings of `PathTracer.block_sums` for one tracer.

    reason: why launches are traced and not recorded; None if they are recorded.
    """

    def __init__(self, state: SceneState):
        """state: the state of the tracer's scene."""
        self.plugins = state.plugins
        self.frozen = dr.freeze(run, limit=MOST_RECORDINGS, warn_after=2**31 - 1)
        self.reason = None
        if os.environ.get(OFF):
            self.reason = f"{OFF} is set"
        elif not state.is_recordable:
            self.reason = "the scene has objects that are not known to be recordable"
        elif state.has_gradients:
            self.reason = "parameters have gradients"

    @property
    def count(self) -> int:
        """Number of recordings made so far."""
        return self.frozen.n_recordings

    def __call__(self, tracer, *arguments):
        """Result of `tracer.block_sums(*arguments)`, from a recording if there is one.

        arguments: PyTrees of Dr.Jit arrays, and numbers and texts. There is a recording for each
        set of numbers and texts. The widths of arrays may differ from call to call.
        """
        if self.reason:
            return tracer.block_sums(*arguments)
        try:
            return self.run_frozen(tracer, arguments)
        except RuntimeError:
            # The plugin that cannot be recorded may belong to a scene that is already deleted
            gc.collect()
        try:
            return self.run_frozen(tracer, arguments)
        except RuntimeError as error:
            self.reason = (
                "the recording failed, perhaps because of a plugin of another scene that is not "
                f"yet deleted: {error.__cause__ or error}"
            )
        warnings.warn(
            f"launches are not recorded, and small ones are slower: {self.reason}", stacklevel=2
        )
        return tracer.block_sums(*arguments)

    def run_frozen(self, tracer, arguments):
        """Result of `tracer.block_sums(*arguments)` from a recording, which is made if needed.

        Raises RuntimeError if it cannot be made. All recordings are dropped in that case.
        """
        attributes = tuple(vars(plugin) for plugin in self.plugins)
        paths = tracer.paths
        derived = tracer.emitters, tracer.ambient_radiance, paths.explored, paths.openings
        arrays = flatten((attributes, derived))
        call = Unseen((tracer, self.plugins, attributes))
        try:
            hidden = [{} for _ in self.plugins]
            with without_collection(), attributes_replaced(self.plugins, hidden):
                return self.frozen(call, tracer.scene, registries(), arrays, *arguments)
        except RuntimeError:
            self.frozen.clear()
            raise
        finally:
            call.content = None  # the recording keeps `call`, and must not keep the scene


def registries() -> list:
    """A pointer to each of the kinds of objects whose methods a path calls.

    Dr.Jit records a call of a method for every object of the kind that is alive, also in other
    scenes. `freeze` looks for the arrays of all these objects if its arguments contain a pointer of
    the kind. A scene contains pointers to shapes and emitters, but none to BSDFs. Without one, it
    would not find the arrays of a BSDF that belongs to no shape.
    """
    return [dr.zeros(kind) for kind in (mi.ShapePtr, mi.EmitterPtr, mi.BSDFPtr)]


class Unseen:
    """Holds an object so that `freeze` neither looks into it nor compares it."""

    def __init__(self, content):
        self.content = content

    def __eq__(self, other):
        return isinstance(other, Unseen)

    def __hash__(self):
        return 0


def run(call, scene, pointers, arrays, *arguments):
    """The function that is recorded. `freeze` compares all arguments but `call`."""
    tracer, plugins, attributes = call.content
    with attributes_replaced(plugins, attributes):
        return tracer.block_sums(*arguments)


@contextmanager
def without_collection():
    """Context manager in which Python's garbage collector does not run.

    Dr.Jit ends the process if the collector finds an array in memory of NumPy's while it records.
    """
    collects = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collects:
            gc.enable()


@contextmanager
def attributes_replaced(plugins, attributes):
    """Context manager in which the plugins have other dictionaries of attributes.

    `freeze` looks for arrays in all attributes of plugins in Python. That takes up to 7 ms for each
    call. It finds none in an empty dictionary, and gets the arrays in a list.
    """
    originals = [vars(plugin) for plugin in plugins]
    for plugin, replacement in zip(plugins, attributes):
        plugin.__dict__ = replacement
    try:
        yield
    finally:
        for plugin, original in zip(plugins, originals):
            plugin.__dict__ = original

"""Recording of a pass over a scene, so that later passes repeat its kernels without tracing Python.

Dr.Jit's `freeze` records which kernels a function launches, and launches them again for other
arrays. It sees a change only in what it is given. An array that it was not given is an error while
it records, but a Python number goes into the kernels unseen. `Recorded` therefore gives it the
arrays of all plugins of this package, and compares all their numbers and texts. Recordings are
dropped when a parameter of another plugin or the geometry has changed.
"""

import os
import warnings
from contextlib import contextmanager

import drjit as dr
import mitsuba as mi

from mi_lcair.plugins.derivatives import attached, children, held, members, same_variables
from mi_lcair.plugins.emission.sources import Source

OFF = "MI_LCAIR_NO_RECORDING"  # environment variable; not empty: nothing is recorded
MOST_RECORDINGS = 16  # of one scene; the one used least recently is dropped
PACKAGE = __name__.partition(".")[0] + "."
# Attributes that depend on temperatures and never enter a kernel. They would spoil the comparison.
NOT_IN_KERNELS = {"brightest", "bounds", "unbounded", "error", "relative_error"} | {
    "derived_from",
    "made_of",
}


class Unseen:
    """Holds an object so that `freeze` neither looks into it nor compares it."""

    def __init__(self, content):
        self.content = content

    def __eq__(self, other):
        return isinstance(other, Unseen)

    def __hash__(self):
        return 0


class Recorded:
    """Recordings of passes over one scene.

    It must belong to that scene, because recordings hold for the scene's objects only. `update` is
    called after every change of the scene, and then the object is called for each pass.

    count: number of recordings made so far. reason: why passes are not recorded; None if they are.
    """

    def __init__(self):
        self.frozen = dr.freeze(run, limit=MOST_RECORDINGS, warn_after=2**31 - 1)
        self.reason = None
        self.fixed, self.numbers = [], ()
        self.plugins, self.attributes, self.arrays, self.settings = [], [], [], ()

    @property
    def count(self) -> int:
        return self.frozen.n_recordings

    def update(self, scene, *derived) -> None:
        """Take up the present state of the scene.

        Parameters
        ----------
        scene : mi.Scene
        *derived
            Further objects of this package whose arrays a pass uses, such as the EmitterTable.
        """
        nodes = traced_nodes(scene)
        self.plugins = [node for node in nodes if is_of_package(node)]
        tables, self.arrays, settings = [], [], []
        for owner in derived:
            collect(owner, tables, settings, set())
        # Memory of NumPy arrays is aligned by chance, and `freeze` records once for either case
        for table in tables:
            table *= dr.opaque(type(table), 1)
        for plugin in self.plugins:
            collect(vars(plugin), self.arrays, settings, set())
        self.arrays += tables
        # A literal would go into the kernels, and `freeze` would see only its copy in the list
        dr.make_opaque(self.arrays)
        # Kernels contain the widths of the tables that they search
        self.settings = (*settings, *map(dr.width, self.arrays))
        fixed, numbers = parameters(nodes)
        if not same_variables(fixed, self.fixed) or numbers != self.numbers:
            self.frozen.clear()
            self.fixed, self.numbers, self.reason = held(fixed), numbers, None
        foreign = [node for node in nodes if is_foreign(node)]
        if os.environ.get(OFF):
            self.reason = f"{OFF} is set"
        elif foreign:
            self.reason = f"{foreign[0].class_name()} is a plugin in Python from elsewhere"

    def __call__(self, function, scene, key: tuple, *arrays):
        """Result of `function(*arrays)`, from a recording if there is one.

        Parameters
        ----------
        function : callable
            Traces a pass and returns a PyTree of arrays. It is called only to record. It may use
            the scene, the objects given to `update`, `key`, and `arrays`, and no other arrays.
        scene : mi.Scene
        key : tuple
            Every number, text and choice that `function` uses, such as max_bounces.
        *arrays
            PyTrees of Dr.Jit arrays: rays, random shifts. Their widths may differ from pass to
            pass. Sums over blocks of a given size are possible, `dr.width` is not.

        Returns
        -------
        PyTree
            As from `function`. Without a recording it is `function` that gives the result: where
            gradients are wanted, a plugin is not known, or the recording failed (see `reason`).
        """
        if self.reason or attached(self.arrays):
            return function(*arrays)
        dr.make_opaque(arrays)
        call = Unseen((self, function))
        try:
            with self.hidden():
                return self.frozen(call, (key, self.settings), scene, self.arrays, arrays)
        except RuntimeError as error:
            self.frozen.clear()
            self.reason = f"the recording failed: {error.__cause__ or error}"
            warnings.warn(
                f"passes are not recorded, and small ones are slower: {self.reason}", stacklevel=2
            )
            return function(*arrays)
        finally:
            call.content = None  # the recording keeps `call`, and must not keep the scene

    @contextmanager
    def hidden(self):
        """Context manager in which the plugins have no attributes, and `freeze` finds none.

        Looking for arrays in them takes up to 15 ms for each pass, and the flat list 0.03 ms.
        """
        self.hide()
        try:
            yield
        finally:
            self.show()

    @contextmanager
    def shown(self):
        """Context manager inside `hidden` in which the plugins have their attributes."""
        self.show()
        try:
            yield
        finally:
            self.hide()

    def hide(self) -> None:
        self.attributes = [dict(vars(plugin)) for plugin in self.plugins]
        for plugin in self.plugins:
            vars(plugin).clear()

    def show(self) -> None:
        for plugin, attributes in zip(self.plugins, self.attributes):
            vars(plugin).update(attributes)
        self.attributes = []


def run(call, key, scene, state, arrays):
    """The function that is recorded. All arguments but `call` are compared by `freeze`."""
    recorded, function = call.content
    with recorded.shown():
        result = function(*arrays)
        dr.eval(result)
        return result


def traced_nodes(scene) -> list:
    """The objects of a scene that a path meets: no sensors and no integrator."""
    found, waiting, seen = [], [scene], {scene}
    while waiting:
        node = waiting.pop()
        found.append(node)
        new = [child for child in children(node) if child not in seen]
        seen.update(new)
        waiting += [child for child in new if not isinstance(child, (mi.Sensor, mi.Integrator))]
    return found


def is_of_package(thing) -> bool:
    return type(thing).__module__.startswith(PACKAGE)


def is_foreign(node) -> bool:
    """Whether an object of a scene is a plugin in Python that is not of this package."""
    return not is_of_package(node) and not type(node).__module__.startswith("mitsuba")


def collect(thing, arrays: list, settings: list, seen: set) -> None:
    """Add the Dr.Jit arrays in an object to a list, and its numbers and texts to another."""
    if dr.is_array_v(thing):
        arrays += flat(thing)
    elif thing is None or isinstance(thing, (str, int, float)):
        settings.append(thing)
    elif isinstance(thing, Source):
        settings.append(thing.group)
    elif isinstance(thing, (tuple, list)):
        settings.append(len(thing))
        for part in thing:
            collect(part, arrays, settings, seen)
    elif isinstance(thing, dict):
        for name, part in thing.items():
            if name not in NOT_IN_KERNELS:
                settings.append(name)
                collect(part, arrays, settings, seen)
    elif is_of_package(thing) and not isinstance(thing, mi.Object) and id(thing) not in seen:
        seen.add(id(thing))
        collect(vars(thing), arrays, settings, seen)


def flat(value) -> list:
    """The Dr.Jit variables of an array: one for each component, none if it is empty."""
    if dr.is_tensor_v(value):
        return flat(value.array)
    if dr.depth_v(value) > 1:
        return [variable for component in value for variable in flat(component)]
    return [value] if dr.is_jit_v(value) and value.index else []


def parameters(nodes) -> tuple[list, tuple]:
    """Parameters of which C++ plugins may hold copies in kernels: variables, and numbers.

    These are the geometry and all parameters of plugins that are not of this package. Attributes of
    meshes, such as facet temperatures, are not among them: `freeze` finds them in the scene.
    """
    variables, numbers = [], []
    for node in nodes:
        if is_of_package(node):
            continue
        for name, value in members(node).items():
            if name.startswith(("face_", "vertex_")) and name not in GEOMETRY:
                continue
            if dr.is_array_v(value):
                variables += flat(value)
            elif isinstance(value, (str, int, float)):
                numbers.append(value)
    return variables, tuple(numbers)


GEOMETRY = ("vertex_positions", "vertex_normals", "vertex_texcoords")

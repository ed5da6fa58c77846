"""What a tracer and its recordings are made for: the state of a scene, and its form."""

from functools import cache

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.plugins import derivatives

PACKAGE = __name__.partition(".")[0] + "."
TABLES = tuple(PACKAGE + name for name in ("plugins.", "physics.reflection."))  # modules of tables
# Mitsuba's objects of which `dr.freeze` finds all arrays. Others may end the process while it
# records: a bitmap texture does.
RECORDABLE = {"Scene", "PLYMesh", "SmoothDiffuse", "UniformSpectrum", "MeshAttribute"}
# Roles of variables. Attributes of a mesh's faces, such as temperatures, are no geometry.
ROLES = GEOMETRY, REFLECTION, EMISSION = "geometry", "reflection", "emission"
PLAIN = bool, int, float, str
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
        self.values, self.variables, self.plugins = {None: settings}, {}, []
        self.is_known = self.is_recordable = True
        self.forms = {}  # of the objects, see `follow`
        for node in objects:
            values, arrays = list(derivatives.members(node).items()), {role: [] for role in ROLES}
            others = self.values[node] = []
            of_node = REFLECTION if isinstance(node, mi.BSDF) else EMISSION
            if type(node).__module__.startswith(PACKAGE):
                self.plugins.append(node)
                values += vars(node).items()
                if isinstance(node, derivatives.Deriving):
                    arrays[of_node] += derivatives.flatten(tuple(node.derivations))
            elif not type(node).__module__.startswith("mitsuba"):
                self.is_known = self.is_recordable = False
            elif not is_recordable(node):
                self.is_recordable = False
            is_shape = isinstance(node, mi.Shape)
            for name, value in values:
                if not dr.is_array_v(value):
                    others.append(value)
                else:
                    is_geometry = is_shape and not name.startswith("face_")
                    arrays[GEOMETRY if is_geometry else of_node].append(value)
            for role in filter(arrays.get, ROLES):
                variables = [v for array in arrays[role] for v in derivatives.variables(array)]
                self.variables[role, node] = derivatives.held(variables)

    @property
    def has_gradients(self) -> bool:
        return any(map(derivatives.attached, self.variables.values()))

    def follow(self, before: "SceneState | None") -> dict[str, set]:
        """Set `forms`, and give the objects with other variables than before by their roles.

        before: an earlier state, whose form objects without a change have; None: all have changed.
        """
        known = {} if before is None else before.variables
        changed, forms = {role: set() for role in ROLES}, {} if before is None else before.forms
        for (role, node), variables in self.variables.items():
            if not derivatives.same_variables(variables, known.get((role, node), ())):
                changed[role].add(node)
        for node, values in self.values.items():
            is_same = node in forms and all(node not in nodes for nodes in changed.values())
            if is_same and all_same(values, before.values[node]):
                self.forms[node] = forms[node]
            else:
                of_roles = [self.variables.get((role, node), []) for role in ROLES]
                self.forms[node] = Form(values, of_roles)
        return changed

    def arrays(self, node) -> list:
        """The variables of an object, also those that follow from its parameters."""
        of_roles = [self.variables.get((role, node), []) for role in ROLES]
        derived = derivatives.flatten(vars(node)) if node in self.plugins else []
        return sum(of_roles, [v for array in derived for v in derivatives.variables(array)])

    def __eq__(self, other):
        return (
            self.is_known
            and list(self.values) == list(other.values)
            and all(map(all_same, self.values.values(), other.values.values()))
            and self.variables.keys() == other.variables.keys()
            and all(
                map(derivatives.same_variables, self.variables.values(), other.variables.values())
            )
        )


def is_recordable(node) -> bool:
    """Whether `dr.freeze` can record an object of Mitsuba."""
    kind = node.class_name().partition("[")[0]
    return kind in RECORDABLE and not (kind == "MeshAttribute" and OF_VERTICES in str(node))


def same(a, b) -> bool:
    """Whether two values are the same object, or equal numbers, texts or arrays of NumPy's."""
    if a is b or type(a) is not type(b):
        return a is b
    return np.array_equal(a, b) if isinstance(a, np.ndarray) else isinstance(a, PLAIN) and a == b


def all_same(some, others) -> bool:
    """Whether two lists have the same values."""
    return len(some) == len(others) and all(map(same, some, others))


class Form:
    """All that a recording has of a scene and its tables, but for the entries of arrays.

    `==` tells whether it is the same. unrecorded: the tables with numbers that no recording has,
    which their class names `UNRECORDED`.
    """

    def __init__(self, *parts):
        self.leaves, self.unrecorded = [], []
        self.add(parts)

    def add(self, part) -> None:
        kind = type(part)
        branches = branching(kind)
        if branches is None:
            self.leaves.append(part)
        elif dr.is_array_v(kind):
            self.leaves += kind, dr.width(part)
        else:
            if hasattr(kind, "UNRECORDED"):
                self.unrecorded.append(part)
            entries = branches(part)
            self.leaves += kind, len(entries)
            for entry in entries:
                self.add(entry)

    def __eq__(self, other):
        return all_same(self.leaves, other.leaves)


@cache
def branching(kind: type):
    """Function that gives the parts of an object of a type for its `Form`; None if it has none."""
    if dr.is_array_v(kind):
        return dr.width
    if issubclass(kind, (tuple, list)):
        return list
    if issubclass(kind, dict):
        return lambda part: [*part, *part.values()]
    if issubclass(kind, mi.Object) or not kind.__module__.startswith(TABLES):
        return None
    unrecorded = getattr(kind, "UNRECORDED", ())
    return lambda part: [
        entry for item in vars(part).items() if item[0] not in unrecorded for entry in item
    ]

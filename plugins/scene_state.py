"""The state of a scene: all that a path tracer's tables and kernels depend on."""

import drjit as dr

from mi_lcair.plugins.derivatives import (
    Deriving,
    attached,
    flatten,
    held,
    members,
    same_variables,
    variables,
)

PACKAGE = __name__.partition(".")[0] + "."
# Mitsuba's objects of which `dr.freeze` finds all arrays. Others may end the process while it
# records: a bitmap texture does.
RECORDABLE = {"Scene", "PLYMesh", "SmoothDiffuse", "UniformSpectrum", "MeshAttribute"}


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
            elif node.class_name().partition("[")[0] not in RECORDABLE:
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


def same(a, b) -> bool:
    """Whether two values are the same object, or equal numbers or texts."""
    return a is b or (type(a) is type(b) and isinstance(a, (bool, int, float, str)) and a == b)

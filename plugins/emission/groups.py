"""Groups and facet types of a scene's surfaces, found by the pointer to the surface's emitter."""

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.plugins.emission.source import OTHER
from mi_lcair.plugins.emission.triangles import pointer_id
from mi_lcair.plugins.emitters.thermal_emitter import facet_type_of, groups_of, is_thermal


class Groups:
    """The group and the facet type of each emitter of a scene.

    labels: the groups of the thermal emitters, and OTHER if the scene has other emitters or shapes
    that do not emit.
    """

    def __init__(self, scene, emitters):
        labels = {group for emitter in emitters for group in groups_of(emitter)}
        if not all(is_thermal(shape.emitter()) for shape in scene.shapes()):
            labels.add(OTHER)
        self.labels = sorted(labels)
        number = {label: k for k, label in enumerate(self.labels)}
        types = [facet_type_of(emitter) for emitter in emitters]
        self.number = table_by_pointer(
            emitters, [number[groups_of(emitter)[0]] for emitter in emitters], number.get(OTHER, 0)
        )
        self.is_background = table_by_pointer(emitters, [of != "model" for of in types])
        self.is_sky = table_by_pointer(emitters, [of == "sky" for of in types])


def table_by_pointer(emitters, values, otherwise=0) -> mi.UInt32:
    """Integers of emitters, for `at_pointer`; `otherwise` stands for a null pointer."""
    ids = [pointer_id(mi.EmitterPtr(emitter)) for emitter in emitters]
    table = np.full(max(ids, default=0) + 1, otherwise, dtype=np.uint32)
    table[ids] = values
    table = mi.UInt32(table)
    dr.make_opaque(table)
    return table


def at_pointer(table: mi.UInt32, emitter: mi.EmitterPtr) -> mi.UInt32:
    """The integers of emitter pointers in a `table_by_pointer`."""
    return dr.gather(mi.UInt32, table, dr.reinterpret_array(mi.UInt32, emitter))

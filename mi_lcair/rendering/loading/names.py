"""Names of a scene's objects that have no id in the scene file."""

import mitsuba as mi

from mi_lcair.rendering.loading.nodes import properties, references


def name_objects(state) -> None:
    """Give each shape, sensor and emitter of a parsed scene that has no id a name.

    It is `sensor`, or the name of the plugin. Later ones of a name are numbered from 2. Mitsuba
    would name them by their address in memory, so that the names of parameters would differ
    between processes.
    """
    taken = {node.props.id() for node in state.nodes}
    last = {}  # the last number that was given to each name
    kinds = (mi.ObjectType.Shape, mi.ObjectType.Sensor, mi.ObjectType.Emitter)
    for child in references(properties(state.root)):
        node = state.nodes[child]
        if node.props.id() or node.type not in kinds:
            continue
        name = "sensor" if node.type == mi.ObjectType.Sensor else node.props.plugin_name()
        numbered = name
        while numbered in taken:
            last[name] = last.get(name, 1) + 1
            numbered = f"{name}_{last[name]}"
        taken.add(numbered)
        node.props.set_id(numbered)

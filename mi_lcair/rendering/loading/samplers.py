"""Samplers of a scene file's sensors: `lattice` where none is named."""

import mitsuba as mi

from mi_lcair.rendering.loading.nodes import properties, references

KNOWN = ("lattice", "independent")
INDEPENDENT = "sampler 'independent' may need ten times as many paths as lattice"


def add_samplers(state) -> None:
    """Give each sensor of a parsed scene that names no sampler the sampler `lattice`.

    Mitsuba would give it `independent`.
    """
    samplers = {k for k, node in enumerate(state.nodes) if node.type == mi.ObjectType.Sampler}
    for k in range(len(state.nodes)):
        node = state.nodes[k]
        if node.type == mi.ObjectType.Sensor and not samplers & set(references(properties(node))):
            added = mi.parser.SceneNode()
            added.type, added.props = mi.ObjectType.Sampler, mi.Properties("lattice")
            added.file_index, added.offset = node.file_index, node.offset
            # Set before the append, which may move all nodes in memory and leave `node` invalid
            node.props["_sampler"] = mi.Properties.ResolvedReference(len(state.nodes))
            state.nodes.append(added)


def remarks_on_samplers(state) -> list[str]:
    """Remarks on the samplers that a scene file names, one line each."""
    named = {node.props.plugin_name() for node in state.nodes if node.type == mi.ObjectType.Sampler}
    lines = [
        f"sampler '{name}' is replaced by lattice, which has known standard errors"
        for name in sorted(named - set(KNOWN))
    ]
    if "independent" in named:
        lines.append(INDEPENDENT)
    return lines

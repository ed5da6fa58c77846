"""Tests of the samplers that a scene's sensors get."""

import mitsuba as mi
import pytest

from mi_lcair.rendering.loading.parsing import add_samplers, properties, references


@pytest.mark.parametrize("after", range(40))
def test_each_sensor_gets_its_sampler(after):
    """However many nodes the scene has: a longer list of nodes may lie elsewhere in memory."""
    bsdf = '<bsdf type="diffuse"/>'
    text = f'<scene version="3.0.0">{bsdf}<sensor type="orthographic"/>{after * bsdf}</scene>'
    state = mi.parser.parse_string(mi.parser.ParserConfig(mi.variant()), text)
    before = len(state.nodes)
    add_samplers(state)
    assert state.nodes[before].props.plugin_name() == "lattice"
    sensors = [node for node in state.nodes if node.type == mi.ObjectType.Sensor]
    assert [references(properties(sensor)) for sensor in sensors] == [[before]]

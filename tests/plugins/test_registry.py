"""The registry of the plugins agrees with the files and with Mitsuba."""

from pathlib import Path

import mitsuba as mi
import pytest

from mi_lcair import plugins
from mi_lcair.plugins import PLUGINS, bound_to_variant

KINDS = {"bsdf": mi.BSDF, "emitter": mi.Emitter, "integrator": mi.Integrator, "sampler": mi.Sampler}


@pytest.mark.parametrize("name", PLUGINS)
def test_a_plugin_is_the_class_with_its_name(name):
    plugin = PLUGINS[name]
    assert issubclass(plugin.type, KINDS[plugin.kind]) and plugin.type.__module__ == plugin.module


def test_every_plugin_with_an_example_of_xml_is_in_the_registry():
    files = Path(plugins.__file__).parent.rglob("*.py")
    examples = {path.stem for path in files if f' type="{path.stem}">' in path.read_text()}
    assert examples and examples <= {*PLUGINS}


def test_modules_are_loaded_again_after_those_that_they_use():
    """All that hold classes of Mitsuba are, base classes before what is derived from them."""
    order = [name.removeprefix("mi_lcair.plugins.") for name in bound_to_variant()]
    assert order.index("bsdfs.reflection_bsdf") < order.index("bsdfs.material")
    assert order.index("emission.triangles") < order.index("emission.emitter_table")
    assert order.index("emission.emitter_table") < order.index("integrators.bounce_path")
    assert "paths.column_kinds" not in order  # has no class of Mitsuba, and stays the same

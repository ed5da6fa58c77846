"""The state of a scene changes with each of its parameters, and with nothing else."""

import drjit as dr
import mitsuba as mi
import pytest

from mi_lcair.api.intensities import signature
from mi_lcair.plugins.derivatives import nodes
from mi_lcair.plugins.paths.scene_state import SceneState
from mi_lcair.rendering.scene import load
from tests.plugins.small_scenes import SCENES


@pytest.mark.parametrize("name", SCENES)
def test_each_parameter_changes_the_state(name):
    scene = load(name, **SCENES[name])
    signature(scene, spp=1)
    state = SceneState(nodes(scene.mi))
    assert SceneState(nodes(scene.mi)) == state
    parameters, count = mi.traverse(scene.mi), 0
    for key, value in parameters:
        if not (dr.is_jit_v(value) and dr.depth_v(value) == 1 and dr.width(value)):
            continue
        before = SceneState(nodes(scene.mi))
        # The same number as another variable, without the callbacks of `parameters.update`
        parameters[key] = value * dr.opaque(type(value), 1)
        assert SceneState(nodes(scene.mi)) != before, key
        count += 1
    assert count >= 5


def test_attributes_of_plugins_change_the_state():
    scene = load("two_plates")
    state = SceneState(nodes(scene.mi))
    scene.set_lobe("mirror")
    assert SceneState(nodes(scene.mi)) != state
    scene.set_lobe("brdf")
    assert SceneState(nodes(scene.mi)) == state
    assert SceneState(nodes(scene.mi), 1, "none") == SceneState(nodes(scene.mi), 1, "none")
    assert SceneState(nodes(scene.mi), 1, "none") != SceneState(nodes(scene.mi), 1, "tail")
    assert SceneState(nodes(scene.mi), 1) != SceneState(nodes(scene.mi), True)


def test_gradients_change_the_state():
    scene = load("cavity")
    parameters = mi.traverse(scene.mi)
    key = next(name for name, _ in parameters if name.endswith("reflectance.value"))
    state = SceneState(nodes(scene.mi))
    dr.enable_grad(parameters[key])
    attached = SceneState(nodes(scene.mi))
    assert attached != state and attached.has_gradients and not state.has_gradients

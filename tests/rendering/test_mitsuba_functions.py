"""Mitsuba's own functions on a scene that `load` returns."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

import mi_lcair

KEY = "emitter.emitter.temperature"


@pytest.fixture
def scene():
    return mi_lcair.load("two_plates", resolution=8)


def test_traverse_lists_the_parameters_of_the_scene(scene):
    assert mi.traverse(scene).keys() == mi.traverse(scene.mi).keys()
    assert mi.traverse(node=scene.mi.shapes()[0]).keys()


def test_an_update_reaches_every_render(scene):
    before = mi_lcair.signature(scene, spp=64).target.intensity
    parameters = mi.traverse(scene)
    parameters[KEY] = 400.0
    parameters.update()
    after = mi_lcair.signature(scene, spp=64).target.intensity
    assert after / before == pytest.approx(2.0**-4, rel=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("arguments", ["positional", "named"])
def test_render_gives_mitsubas_image_and_its_gradient(scene, arguments):
    parameters = mi.traverse(scene)
    parameters[KEY] = mi.Float(500.0)
    dr.enable_grad(parameters[KEY])
    parameters.update()
    image = (
        mi.render(scene, parameters, spp=256)
        if arguments == "positional"
        else mi.render(scene=scene, params=parameters, spp=256)
    )
    mean = dr.mean(image, axis=None)
    dr.backward(mean)
    # In the total band the radiance is proportional to the fourth power of the temperature
    assert dr.grad(parameters[KEY])[0] == pytest.approx(4 * mean.array[0] / 500, rel=0.02)
    with dr.suspend_grad():
        assert np.array_equal(mi.render(scene, spp=16), mi.render(scene.mi, spp=16))

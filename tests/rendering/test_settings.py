"""Settings change in one way and are put back exactly; what a render derives stays with it."""

from pathlib import Path

import mitsuba as mi
import numpy as np
import pytest

import mi_lcair
from mi_lcair.errors import InputError
from mi_lcair.plugins.paths.launch import Launch
from mi_lcair.rendering.scene import checked
from mi_lcair.rendering.settings import changed


def settings(scene):
    integrator = scene.mi.integrator()
    return (
        integrator.max_bounces,
        integrator.emitter_sampling,
        integrator.closure,
        integrator.ambient_temperature,
        [surface.lobe for surface in scene.surfaces()],
    )


def two_of_one_name():
    """Two spheres whose unlike materials have the same name, one of them on a lower rung."""
    shapes = {
        f"ball_{k}": {
            "type": "sphere",
            "center": [3.0 * k, 0.0, 0.0],
            "bsdf": {
                "type": "sandford_robertson",
                "material": "gloss_black",
                "band": "MWIR",
                "lobe": lobe,
            },
            "emitter": {"type": "thermal", "band": "MWIR", "temperature": 300.0},
        }
        for k, lobe in enumerate(("mirror", "brdf"))
    }
    return checked(
        mi.load_dict(
            {
                "type": "scene",
                "integrator": {"type": "bounce_path"},
                "sensor": {"type": "orthographic"},
                **shapes,
            },
            optimize=False,
        ),
        Path("x.xml"),
        {},
    )


@pytest.mark.parametrize("failing", [False, True])
def test_settings_are_put_back(failing):
    scene = two_of_one_name()
    before = settings(scene)
    assert sorted(before[-1]) == ["brdf", "mirror"]
    ambient = {"closure": "ambient", "ambient_temperature": 300.0}
    try:
        with changed(scene, lobe="diffuse", max_bounces=2, emitter_sampling=True, **ambient):
            assert settings(scene) == (2, True, "ambient", 300.0, ["diffuse", "diffuse"])
            if failing:
                raise KeyError
    except KeyError:
        pass
    assert settings(scene) == before


@pytest.mark.parametrize(
    "change, message",
    [
        ({"max_bounces": -1}, "max_bounces = -1"),
        ({"max_bounces": 1, "closure": "tail"}, "must be >= 2"),
        ({"lobe": {"tin": "mirror"}}, "unknown material 'tin'"),
        ({"lobe": {"gloss_black": "glossy"}}, "lobe 'glossy'"),
        ({"maxbounces": 3}, "unknown setting 'maxbounces'"),
    ],
)
def test_unusable_settings_change_nothing(change, message):
    scene = two_of_one_name()
    before = settings(scene)
    with pytest.raises(InputError, match=message), changed(scene, **change):
        pass
    assert settings(scene) == before


def test_a_render_leaves_nothing_in_the_integrator():
    """Neither while it runs nor afterwards: what one render derives cannot reach another one."""
    scene = mi_lcair.load("open_box", resolution=4, max_bounces=3)
    integrator = scene.mi.integrator()
    before = dict(vars(integrator))
    with scene.prepared(), changed(scene, closure="tail"):
        mi_lcair.render(scene, spp=2)
        assert vars(integrator) == before | {"closure": "tail"}
    assert vars(integrator) == before


def test_what_a_render_derives_does_not_change():
    """Settings that change later do not reach a tracer that is already made, and nobody sets it."""
    scene = mi_lcair.load("open_box", resolution=4, max_bounces=3)
    with scene.prepared() as tracer:
        launch = Launch(columns=4, rows=4, seed=1, randomisations=1, points=16, windows=16)
        first = tracer.trace(scene.sensor(0), launch)
        with changed(scene, max_bounces=0):
            second = tracer.trace(scene.sensor(0), launch)
        with pytest.raises(AttributeError, match="max_bounces"):
            tracer.max_bounces = 0
    np.testing.assert_array_equal(first.radiance, second.radiance)

"""Shapes that Mitsuba has merged."""

import mitsuba as mi
import numpy as np
import pytest

import mi_lcair
from mi_lcair.rendering.loading.origin import extent
from mi_lcair.rendering.views import depth


def test_passive_rectangles_of_one_bsdf_have_an_extent():
    """`mi.load_dict` merges them into a mesh whose box is invalid, and left out of the scene's."""
    T = mi.ScalarTransform4f()
    film = {"type": "hdrfilm", "width": 4, "height": 4, "pixel_format": "luminance"}
    floor, wall = (
        {
            "type": "rectangle",
            "to_world": T.translate([0, 0, height]),
            "bsdf": {"type": "ref", "id": "grey"},
        }
        for height in (0, 2)
    )
    scene = mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "bounce_path"},
            "sensor": {"type": "perspective", "film": film},
            "grey": {"type": "grey", "emissivity": 0.3},
            "floor": floor,
            "wall": wall,
            "lamp": {
                "type": "rectangle",
                "to_world": T.translate([0, 0, 1]),
                "emitter": {"type": "thermal", "temperature": 300.0, "band": "LWIR"},
            },
        }
    )
    assert len(scene.shapes()) == 2
    loaded = mi_lcair.load(scene)
    np.testing.assert_allclose(extent(loaded.mi), [[-1, -1, 0], [1, 1, 2]])
    assert depth(loaded) == pytest.approx(2 * np.sqrt(12), rel=1e-12)

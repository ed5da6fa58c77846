"""A thermal emitter on a surface that reflects all radiation emits nothing; a warning says so."""

from pathlib import Path

import mitsuba as mi
import pytest

from mi_lcair.rendering.scene import checked
from tests.plugins.conftest import plate  # noqa: F401, a fixture
from tests.plugins.small_scenes import GREY, SQUARE, camera, with_emitter

WHITE = {"type": "diffuse", "reflectance": {"type": "uniform", "value": 1.0}}
MATERIAL = {"type": "sandford_robertson", "material": "diffuse", "band": "LWIR"}


@pytest.mark.parametrize(
    "bsdf, given, what",
    [
        (MATERIAL, {}, "material diffuse reflects all radiation"),
        (WHITE, {}, "its BSDF reflects all radiation"),
        ({"type": "twosided", "bsdf": WHITE}, {}, "its BSDF reflects all radiation"),
        (WHITE, {"emissivity": 0.0}, "its BSDF reflects all radiation"),
        (WHITE, {"emissivity": 0.5}, None),
        (GREY, {}, None),
    ],
)
def test_remark(plate, bsdf, given, what):
    shape = with_emitter(plate("terrain", SQUARE, bsdf, 300.0, group="terrain"), **given)
    lamp = plate("lamp", [[x, y, 9] for x, y, _ in SQUARE], GREY, 400.0)
    loaded = mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "bounce_path"},
            "sensor": camera(2),
            "terrain": shape,
            "lamp": lamp,
        },
        optimize=False,
    )
    dark = [note for note in checked(loaded, Path("x.xml"), {}).notes if "emits nothing" in note]
    assert len(dark) == (what is not None)
    if what:
        assert dark[0].startswith("group terrain, shape 'terrain': ") and what in dark[0]

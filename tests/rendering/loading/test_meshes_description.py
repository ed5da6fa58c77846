"""What a loaded scene tells about itself in one line."""

from dataclasses import replace

import pytest

import mi_lcair
from mi_lcair import InputError
from mi_lcair.rendering.loading.meshes import LONGEST


def test_one_line():
    scene = mi_lcair.load("cavity", opening=8, resolution=32)
    assert repr(scene) == (
        "<Scene cavity: band total; groups cavity; materials none; "
        "sensors orthographic 32 x 32; parameters opening=8, resolution=32>"
    )


def test_no_flood():
    """Of many parameters and of long texts only the beginning is shown."""
    many = {f"p{k}": k for k in range(15)}
    line = repr(replace(mi_lcair.load("cavity"), parameters=many))
    assert "p7=7 and 7 more" in line and len(line) <= LONGEST
    line = repr(replace(mi_lcair.load("cavity"), parameters={name: 100 * name for name in many}))
    assert len(line) <= LONGEST and "\n" not in line and line.endswith(">")


@pytest.mark.parametrize(
    "text, message",
    [
        ("cavty", "unknown bundled scene 'cavty'; known: cavity,"),
        ("cavty.xml", "no such file; the nearest bundled scene is 'cavity'"),
        ("zzz.xml", "scene 'zzz.xml': no such file$"),
        ("a340_landing/position_1", "it is a scenario, which contrast, image and budget take"),
        (
            "<scene version='3.0.0'> </scene>",
            "mi.load_string loads XML text, and mi_lcair.load takes its scene",
        ),
    ],
)
def test_scenes_that_do_not_exist(text, message):
    with pytest.raises(InputError, match=message):
        mi_lcair.load(text)

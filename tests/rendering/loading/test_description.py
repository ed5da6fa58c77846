"""What a loaded scene tells about itself in one line and in a notebook."""

import re
from dataclasses import replace

import pytest

import mi_lcair
from mi_lcair import InputError
from mi_lcair.rendering.loading.description import LONGEST


def test_one_line():
    scene = mi_lcair.load("cavity", opening=8, resolution=32)
    assert repr(scene) == (
        "<Scene cavity: band total; groups cavity; materials none; "
        "sensors orthographic 32 x 32; parameters opening=8, resolution=32>"
    )


def test_no_flood():
    """Of many parameters and long texts only the beginning is shown, and no text is markup."""
    many = {f"parameter_{k}": "<b>" * 100 for k in range(15)}
    scene = replace(mi_lcair.load("cavity"), parameters=many)
    line, page = repr(scene), scene._repr_html_()
    assert len(line) <= LONGEST and "\n" not in line and line.endswith(">")
    assert len(page) < 2500 and "and 7 more" in page
    assert "&lt;b&gt;" in page and "<b>" not in page
    names = re.findall(r"<th[^>]*>(\w+)</th>", page)
    assert names == ["band", "groups", "materials", "sensors", "parameters"]


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

"""Remark on reflections that escape to where nothing emits, with closed forms of its size."""

import re

import mitsuba as mi
import pytest

import mi_lcair
from mi_lcair.sections import Remarks
from tests.plugins.small_scenes import GREY, camera, scene

PATH = {"type": "bounce_path", "max_bounces": 1}
PLATE = {
    "type": "rectangle",
    "bsdf": GREY,
    "emitter": {"type": "thermal", "band": "LWIR", "temperature": 300.0},
}
UPRIGHT = mi.ScalarTransform4f().rotate([0, 1, 0], 90)
SIDE = {**camera(4, 1.0, origin=(20, 0, 0))}
SIDE["to_world"] = mi.ScalarTransform4f().look_at(origin=[20, 0, 0], target=[0, 0, 0], up=[0, 0, 1])


def share(sensor=None, **shapes):
    """The share that the remark states [percent]; 0 without a remark."""
    made = mi_lcair.load(scene(PATH, sensor or camera(4, 1.0), **shapes))
    found = [re.match(r"([\d.]+) % of the target's reflections", note) for note in made.notes]
    return next((float(match[1]) for match in found if match), 0.0)


@pytest.mark.parametrize("turned, expected", [(0, False), (180, True)])
def test_a_plate_from_behind(turned, expected):
    """A plate that is two-sided has no back."""
    place = mi.ScalarTransform4f().rotate([1, 0, 0], turned)
    for bsdf, has_back in ((GREY, True), ({"type": "twosided", "grey": GREY}, False)):
        plate = {**PLATE, "bsdf": bsdf, "to_world": place}
        notes = mi_lcair.load(scene(PATH, camera(4, 1.0), plate=plate)).notes
        remarks = [note for note in notes if "are backs of one-sided surfaces" in note]
        assert len(remarks) == (expected and has_back)
        assert not remarks or remarks[0].startswith("100 %")


def sky(**others):
    return {"type": "sky", "band": "LWIR", **others}


def test_plate_in_a_void():
    assert share(plate=PLATE) == 100


@pytest.mark.parametrize(
    "around, expected",
    [
        ({}, 50),
        ({"ground_temperature": 288.0}, 0),
        ({"sky": "none", "ground_temperature": 288.0}, 50),
    ],
)
def test_upright_plate_sees_half_of_sky_and_ground(around, expected):
    plate = {**PLATE, "to_world": UPRIGHT}
    assert share(SIDE, plate=plate, sky=sky(**around)) == pytest.approx(expected, abs=3)


def test_plate_below_a_disc():
    """A disc of radius r at distance h from a point takes the share r^2 / (r^2 + h^2)."""
    lid = {**PLATE, "type": "disk", "to_world": mi.ScalarTransform4f().translate([0, 0, -1])}
    small = camera(4, 0.02, origin=(0, 0, -0.5))
    small["to_world"] = mi.ScalarTransform4f().look_at(
        origin=[0, 0, -0.5], target=[0, 0, 0], up=[0, 1, 0]
    ) @ mi.ScalarTransform4f().scale([0.01, 0.01, 1])
    floor = {**PLATE, "to_world": mi.ScalarTransform4f().rotate([1, 0, 0], 180).scale(10)}
    assert share(small, plate=floor, lid=lid) == pytest.approx(50, abs=3)


def test_black_surfaces_reflect_nothing():
    black = {**PLATE, "bsdf": {"type": "diffuse", "reflectance": {"type": "uniform", "value": 0.0}}}
    assert share(plate=black) == 0


def test_once_and_in_json():
    made = mi_lcair.load(scene(PATH, camera(4, 1.0), plate=PLATE))
    result = mi_lcair.signature(made, spp=4).as_dict()
    (remark,) = [line for line in result["remarks"] if "see nothing (0 K)" in line]
    assert remark.startswith("100 % of the target's reflections") and "an emitter sky" in remark


def test_an_image_of_nothing():
    away = {
        **camera(4, 1.0),
        "to_world": mi.ScalarTransform4f().look_at([0, 0, 5], [0, 0, 9], [0, 1, 0]),
    }
    for sensor, expected in ((away, True), (camera(4, 1.0), False)):
        render = mi_lcair.render(mi_lcair.load(scene(PATH, sensor, plate=PLATE)), spp=2)
        remarks = [fact for fact in render.facts() if isinstance(fact, Remarks)]
        assert any("0 everywhere" in line for fact in remarks for line in fact.lines) == expected

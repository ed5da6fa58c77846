"""The derivative with respect to the emissivity of a grey surface is whole: it holds the emitted
and the reflected radiance."""

import numpy as np
import pytest

import mi_lcair
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.sensitivity.parameters import set_values

EMITTER = """<emitter type="thermal"> <string name="band" value="LWIR"/>
    <float name="temperature" value="{T}"/> <string name="group" value="{group}"/>
    <string name="facet_type" value="{kind}"/> </emitter>"""
NAMED = """<bsdf type="material"> <string name="material" value="{}"/>
    <string name="band" value="LWIR"/> </bsdf>"""
NUMBER = '<bsdf type="grey" id="paint"> <float name="emissivity" value="{}"/> </bsdf>'
ROOM = """<scene version="3.0.0">
    <integrator type="bounce_path"> <integer name="max_bounces" value="4"/> </integrator>
    <sensor type="orthographic">
        <transform name="to_world"> <scale x="2" y="2"/>
        <lookat origin="0, -2, 4" target="0, 0, 0" up="0, 1, 0"/> </transform>
        <film type="hdrfilm"> <integer name="width" value="16"/> <integer name="height" value="16"/>
        <string name="pixel_format" value="luminance"/> <rfilter type="box"/> </film>
        <sampler type="lattice"> <integer name="sample_count" value="64"/> </sampler>
    </sensor>
    <shape type="rectangle"> {paint} {plate} </shape> {second}
    <shape type="sphere"> <float name="radius" value="20"/> <boolean name="flip_normals"
        value="true"/> {black} {room} </shape>
</scene>"""
# A second plate of the same material, at a right angle to the first
SECOND = """<shape type="rectangle"> <ref id="paint"/> <transform name="to_world">
    <rotate x="1" angle="90"/> <translate y="1" z="1"/> </transform> {plate} </shape>"""
NAME = {NAMED: "{}.emissivity", NUMBER: "paint.emissivity"}


def load(tmp_path, material, emissivity, plate=310, room=260, second=""):
    parts = {
        "paint": material.format(emissivity),
        "plate": EMITTER.format(T=plate, group="plate", kind="model"),
        "black": NAMED.format("blackbody"),
        "room": EMITTER.format(T=room, group="room", kind="sky"),
    }
    path = tmp_path / "room.xml"
    path.write_text(ROOM.format(second=second.format(**parts), **parts))
    return mi_lcair.load(path), NAME[material].format(emissivity)


@pytest.mark.slow
@pytest.mark.parametrize("material", [NAMED, NUMBER])
@pytest.mark.parametrize("emissivity", [0, 0.08, 0.92, 1])
def test_plate_in_a_black_room(tmp_path, material, emissivity):
    """I = A cos(theta) (epsilon L(T) + (1 - epsilon) L(T_room))."""
    scene, name = load(tmp_path, material, emissivity)
    hot, cold = (in_band_radiance(scene.band, T) for T in (310, 260))
    result = mi_lcair.sensitivities(scene, [name], spp=64)
    area = 4 * np.cos(np.arctan(0.5))
    exact = area * (emissivity * hot + (1 - emissivity) * cold)
    assert result.value == pytest.approx(exact, rel=1e-3)
    assert result.derivative[0] == pytest.approx(area * (hot - cold), rel=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("emissivity", [0.3, 0.85])
def test_corner_of_two_plates(tmp_path, emissivity):
    """The plates reflect each other. Central differences on the same paths."""
    scene, name = load(tmp_path, NUMBER, emissivity, second=SECOND)
    slope = mi_lcair.sensitivities(scene, [name], spp=1024).derivative[0]
    intensity, step = {}, 0.01
    for sign in (-1, 1):
        set_values(scene, {name: emissivity + sign * step})
        intensity[sign] = mi_lcair.sensitivities(scene, [name], spp=1024).value
    assert slope == pytest.approx((intensity[1] - intensity[-1]) / (2 * step), rel=1e-3)

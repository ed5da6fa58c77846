"""Scenes far from their origin: moved there in double precision, or refused."""

import numpy as np
import pytest

import mi_lcair
from mi_lcair.errors import InputError
from tests.rendering.loading.scene_text import HALVES, SQUARE, mesh, write, write_ply

PLACES = (0.0, 1e3, 1e4, 1e5, 1e7)


def plates(tmp_path, away, sampling="false"):
    """The scene two_plates, 0.2 m in size, moved by `away` m along each axis by its transforms."""
    text = mi_lcair.scenes.path("two_plates").read_text()
    folder = mi_lcair.scenes.path("two_plates").parent
    text = text.replace("meshes/", f"{folder}/meshes/")
    place = f'<translate x="{away!r}" y="{away!r}" z="{-away!r}"/> </transform>'
    text = text.replace("</transform>", place)
    text = text.replace(
        '<boolean name="face_normals" value="true"/>',
        f'<boolean name="face_normals" value="true"/> <transform name="to_world"> {place}',
    )
    path = tmp_path / "scene.xml"
    path.write_text(text)
    return mi_lcair.load(path, resolution=32, emitter_sampling=sampling)


@pytest.mark.slow
@pytest.mark.parametrize("sampling", ["false", "true"])
def test_the_same_picture_anywhere(tmp_path, sampling):
    """At 1 km single precision lost 1 % of the intensity, at 100 km all of it."""
    images = [mi_lcair.render(plates(tmp_path, away, sampling), spp=64) for away in PLACES]
    for away, image in zip(PLACES, images, strict=True):
        assert image.mean == pytest.approx(images[0].mean, rel=2e-4), away


def test_where_it_was_is_kept(tmp_path):
    """`origin` tells the file's coordinates of the loaded scene's origin; a remark says so."""
    assert plates(tmp_path, 0.0).origin == (0, 0, 0)
    scene = plates(tmp_path, 1e4)
    assert np.allclose(scene.origin, [1e4, 1e4, -1e4], atol=0.3)
    assert any("it was moved there" in remark for remark in scene.remarks)
    corner = np.array(scene.mi.bbox().min, dtype=float) + scene.origin
    assert np.allclose(corner, [1e4, 1e4 - 0.05, -1e4], atol=1e-6)


SHAPES = """
    <shape type="sphere"> <point name="center" x="{0}" y="1" z="2"/> \
<float name="radius" value="0.5"/> </shape>
    <shape type="sphere"> <point name="center" x="1" y="0" z="0"/> \
<float name="radius" value="0.5"/>
        <transform name="to_world"> <rotate z="1" angle="90"/> <translate x="{0}"/> \
</transform> </shape>
    <shape type="cylinder"> <point name="p0" x="{0}" y="0" z="0"/> \
<point name="p1" x="{0}" y="0" z="2"/> </shape>
    <shape type="shapegroup" id="parts"> <shape type="sphere"/> </shape>
    <shape type="instance"> <ref id="parts"/> <transform name="to_world"> \
<translate x="{0}" z="4"/> </transform> </shape>
    <shape type="rectangle"> <transform name="to_world"> <translate x="{0}" y="3"/> </transform>
        <emitter type="thermal"> <string name="band" value="LWIR"/> \
<float name="temperature" value="300"/> </emitter> </shape>
    <emitter type="point"> <point name="position" x="{0}" y="2" z="2"/> \
<float name="intensity" value="1"/> </emitter>
    <emitter type="spot"> <transform name="to_world"> \
<lookat origin="{0}, 2, 2" target="{0}, 0, 0" up="0, 0, 1"/> </transform> </emitter>
    <integrator type="bounce_path"/>
    <sensor type="radiancemeter"> <point name="origin" x="{0}" y="3" z="2"/> \
<vector name="direction" x="0" y="0" z="-1"/>
        <film type="hdrfilm"> <integer name="width" value="1"/> \
<integer name="height" value="1"/> <rfilter type="box"/> </film> </sensor>
"""


@pytest.mark.slow
def test_every_kind_of_place(tmp_path):
    """Centres, ends, positions and transforms of shapes, lights and sensors are all moved; the
    parts of a group are not.
    """
    scenes = [
        mi_lcair.load(write(tmp_path, SHAPES.replace("{0}", repr(x)))) for x in (0.0, 123456.0)
    ]
    near, far = (
        [np.array([s.bbox().min, s.bbox().max]) for s in one.mi.shapes()] for one in scenes
    )
    shift = np.array(scenes[1].origin) - [123456, 0, 0]
    for a, b in zip(near, far, strict=True):
        assert np.allclose(a, b + shift, atol=1e-4)
    images = [mi_lcair.render(scene, spp=16) for scene in scenes]
    assert images[0].mean > 0
    assert images[1].mean == pytest.approx(images[0].mean, rel=1e-4)


def test_a_mesh_far_from_its_own_origin(tmp_path):
    """Its coordinates in the file have lost their digits; no transform brings them back."""
    far = np.array(SQUARE) * 0.1 + [1e4, 0, 0]
    write_ply(tmp_path / "plate.ply", far, HALVES)
    thermal = """<emitter type="thermal"> <string name="band" value="LWIR"/>
        <float name="temperature" value="300"/> </emitter>"""
    back = '<transform name="to_world"> <translate x="-10000"/> </transform>'
    sensor = '<integrator type="bounce_path"/> <sensor type="orthographic"/>'
    for place in ("", back):
        with pytest.raises(
            InputError, match="plate.ply: its vertices lie 10000.1 m from the origin"
        ):
            mi_lcair.load(write(tmp_path, sensor, mesh(place + thermal)))

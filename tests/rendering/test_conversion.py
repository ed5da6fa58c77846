"""Scenes that were written for Mitsuba, made thermal and compared with Mitsuba's own integrator.

The files are in the style of public scenes. [[...]] is only in the file for Mitsuba: its lights.
{{.75}} is only in the reference: an emitter `area` with .75 of the radiance of a blackbody.
"""

import re

import mitsuba as mi
import numpy as np
import pytest

import mi_lcair
from mi_lcair.errors import InputError
from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.rendering.conversion import thermal_scene

B = in_band_radiance(band("LWIR"), 300.0)
RUNS = 8  # independent images of Mitsuba
GREY = '<rgb name="reflectance" value="{0}, {0}, {0}"/>'.format
FILM = (
    '<film type="hdrfilm"> <integer name="width" value="12"/> <integer name="height" value="8"/> '
    '<rfilter type="box"/> </film> <sampler type="stratified"> <integer name="sample_count" '
    'value="$spp"/> <boolean name="jitter" value="true"/> </sampler>'
)
CAMERA = f"""<default name="spp" value="256"/>
    <sensor type="perspective" id="camera"> <float name="fov" value="50"/> {FILM}
    <transform name="to_world"> <lookat origin="0, -4, 1" target="0, 0, .6" up="0, 0, 1"/>
    </transform> </sensor>"""
FLOOR = """<shape type="rectangle" id="floor"> <ref id="white"/> {{.3}}
    <transform name="to_world"> <scale value="2"/> </transform> </shape>"""
WHITE = f'<bsdf type="diffuse" id="white"> {GREY(0.7)} </bsdf>'
PATH = '<integrator type="path"> <integer name="max_depth" value="5"/> </integrator>'
BALL = """<shape type="sphere" id="ball"> <point name="center" x="0" y="0" z=".8"/>
    <float name="radius" value=".5"/>{}</shape>"""
LIGHTS = """[[ <emitter type="constant"/> <emitter type="point" id="bulb"/> <emitter type="spot"/>
    <emitter type="directional"> <vector name="direction" x="0" y="0" z="-1"/> </emitter>
    <emitter type="projector"> <texture type="bitmap" name="irradiance">
        <string name="filename" value="grey.png"/> </texture> </emitter> ]]"""


def scene(*parts):
    return f'<scene version="3.0.0">{"".join(parts)}</scene>'


INCLUDES = {
    "scene.xml": scene(
        '<default name="wall" value=".5"/> <path value="data"/>',
        f'<bsdf type="diffuse" id="painted"> {GREY("$wall")} </bsdf>',
        '<alias id="painted" as="wall"/>',
        '[[ <emitter type="area" id="lamp"> <float name="radiance" value="7"/> </emitter> ]]',
        '<include filename="room.xml"/> <include filename="camera.xml"/>',
    ),
    "data/room.xml": scene(WHITE, FLOOR, '<include filename="inner/ball.xml"/>'),
    "data/inner/ball.xml": scene(
        BALL.format('<ref id="painted"/> [[<ref id="lamp"/>]] {{.5}}'),
        '<shape type="obj"> <string name="filename" value="wall.obj"/> <ref id="wall"/> {{.5}}',
        '<boolean name="face_normals" value="true"/> </shape>',
    ),
    "camera.xml": scene(PATH, CAMERA),
    "data/wall.obj": "v -2 2 0\nv 2 2 0\nv 2 2 3\nv -2 2 3\nf 1 2 3 4\n",
}
CBOX = {
    "scene.xml": scene(
        *(PATH, WHITE, CAMERA, FLOOR, LIGHTS),
        '<bsdf type="twosided" id="red"> <bsdf type="diffuse">',
        f'{GREY(0.2)} </bsdf> </bsdf> <shape type="cube"> <ref id="red"/> {{{{.8}}}}',
        '<transform name="to_world"> <scale value=".3"/> <rotate z="1" angle="30"/>',
        '<translate x=".8" z=".31"/> </transform> </shape>',
        BALL.format(f'<bsdf type="diffuse"> {GREY(0.4)} </bsdf> {{{{.6}}}}'),
        '<shape type="rectangle"> <ref id="white"/> {{.3}}',
        '[[<emitter type="area"> <rgb name="radiance" value="18, 10, 2"/> </emitter>]]',
        '<transform name="to_world"> <rotate x="1" angle="180"/> <translate z="2"/> </transform>',
        "</shape>",
    )
}
INSTANCES = {
    "scene.xml": scene(
        *(PATH, CAMERA, WHITE, FLOOR),
        '<shape type="shapegroup" id="group"> <shape type="cube"> <transform name="to_world">',
        '<scale value=".3"/> </transform> <ref id="white"/> </shape>',
        '<shape type="sphere"> <point name="center" x="0" y="0" z=".6"/>',
        '<float name="radius" value=".3"/> <ref id="white"/> </shape> </shape>',
        *(
            f'<shape type="instance"> <ref id="group"/> <transform name="to_world"> <rotate z="1" '
            f'angle="{40 * x}"/> <translate x="{x}" z=".4"/> </transform> </shape>'
            for x in (-1, 1)
        ),
    )
}
# Mitsuba cannot light up instances, so that the reference has them one by one
PLACED = scene(
    *(PATH, CAMERA, WHITE, FLOOR),
    *(
        f'<shape type="{shape}"> <ref id="white"/> {{{{.3}}}} <transform name="to_world"> {own} '
        f'<rotate z="1" angle="{40 * x}"/> <translate x="{x}" z=".4"/> </transform> </shape>'
        for x in (-1, 1)
        for shape, own in (
            ("cube", '<scale value=".3"/>'),
            ("sphere", '<scale value=".3"/> <translate z=".6"/>'),
        )
    ),
)
NESTED = {
    "scene.xml": scene(
        *(PATH, CAMERA, WHITE),
        '<bsdf type="bumpmap" id="bark"> <texture type="bitmap" name="bump">',
        '<string name="filename" value="grey.png"/> <boolean name="raw" value="true"/> </texture>',
        '<bsdf type="diffuse"/> </bsdf> <bsdf type="blendbsdf" id="mixed">',
        '<float name="weight" value=".5"/> <ref id="white"/> <bsdf type="diffuse"/> </bsdf>',
        '<bsdf type="dielectric" id="glass"/>',
        *(
            f'<shape type="rectangle"> <ref id="{name}"/> {{{{{emissivity}}}}} <transform '
            f'name="to_world"> <rotate x="1" angle="{turn}"/> <translate x="{x}" z="{z}"/> '
            "</transform> </shape>"
            for name, emissivity, turn, x, z in (
                *(("white", 0.3, 0, -1, 0), ("glass", 0.9, 0, 1, 0)),
                *(("bark", 0.6, 80, -1, 1.2), ("mixed", 0.6, 80, 1, 1.2)),
            )
        ),
    )
}
# The given emissivity is that of the whole sheet with its holes, as it is for `area`. A large black
# surface is behind, because Mitsuba drops paths that have passed nothing but holes
MASKED = {
    "scene.xml": scene(
        *(PATH, CAMERA, WHITE),
        '<bsdf type="mask" id="lace"> <float name="opacity" value=".4"/> <ref id="white"/> </bsdf>',
        '<shape type="rectangle"> <ref id="lace"/> {{.9}} </shape> <shape type="rectangle"> {{1}}',
        f'<bsdf type="diffuse"> {GREY(0)} </bsdf> <transform name="to_world"> ',
        '<scale value="50"/> <translate z="-.1"/> </transform> </shape>',
    )
}
MEDIUM = {
    "scene.xml": scene(
        '<integrator type="volpath"> <integer name="max_depth" value="3"/> </integrator>',
        *(CAMERA, CAMERA.partition("/>")[2].replace('"camera"', '"second"'), WHITE, FLOOR),
        '[[ <medium type="homogeneous" id="fog"/> ]]',
        '[[ <shape type="cube"> <bsdf type="null"/> <ref name="interior" id="fog"/> </shape> ]]',
        BALL.format(f'<bsdf type="diffuse"> {GREY(0.5)} </bsdf> {{{{.5}}}}'),
    )
}
TEXTURED = {
    "scene.xml": scene(
        *(PATH, CAMERA, WHITE),
        '<texture type="bitmap" id="picture"> <string name="filename" value="grey.png"/>',
        '<string name="filter_type" value="nearest"/> </texture>',
        '<bsdf type="twosided"><bsdf type="diffuse" id="painted">',
        '<ref name="reflectance" id="picture"/> </bsdf></bsdf>',
        FLOOR.replace("white", "painted").replace("{{.3}}", "{{emitted.exr}}"),
        BALL.format('<ref id="white"/> {{.3}}'),
    )
}
GLASS = {
    "scene.xml": scene(
        *(PATH, CAMERA, WHITE, FLOOR, BALL.format('<bsdf type="dielectric"/> {{.9}}')),
    )
}
CASES = {
    "includes": (INCLUDES, {}),
    "values": (INCLUDES, {"parameters": {"wall": ".5", "spp": "64"}}),
    "cbox": (CBOX, {}),
    "instances": (INSTANCES, {}),
    "nested": (NESTED, {"emissivity": ["dielectric=.9", ".6"]}),
    "glass": (GLASS, {"emissivity": ["ball=.9"]}),
    "masked": (MASKED, {"emissivity": ["lace=.9"]}),
    "medium": (MEDIUM, {}),
    "textured": (TEXTURED, {}),
}


def lit(match):
    """The emitter `area` of a mark."""
    value = (
        f'<float name="radiance" value="{float(match[1]) * B}"/>'
        if "x" not in match[1]
        else (
            f'<texture type="bitmap" name="radiance"> <string name="filename" value="{match[1]}"/> '
            '<boolean name="raw" value="true"/> <string name="filter_type" value="nearest"/> '
            "</texture>"
        )
    )
    return f'<emitter type="area"> {value} </emitter>'


def written(folder, files):
    """The scene, and the reference beside it."""
    grey = np.linspace(20, 230, 12).reshape(3, 4, 1)
    linear = ((grey.astype(np.uint8) / 255 + 0.055) / 1.055) ** 2.4  # sRGB above .04
    for name, text in files.items():
        for top, of_lights, of_marks in (("stock", r"\1", ""), ("reference", "", lit)):
            changed = re.sub(r"\[\[(.*?)\]\]", of_lights, text, flags=re.DOTALL)
            path = folder / top / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(re.sub(r"\{\{(.*?)\}\}", of_marks, changed))
            mi.Bitmap(grey.astype(np.uint8)).write(str(folder / top / "grey.png"))
            mi.Bitmap(((1 - linear) * B).astype(np.float32)).write(
                str(folder / top / "emitted.exr")
            )
    return folder / "stock" / "scene.xml", folder / "reference" / "scene.xml"


def stock_image(path):
    """Image of Mitsuba and its standard error."""
    made = mi.load_file(str(path))
    images = [np.array(mi.render(made, seed=seed, spp=128))[..., 0] for seed in range(RUNS)]
    return np.mean(images, axis=0), np.std(images, axis=0, ddof=1) / np.sqrt(RUNS)


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_images_are_those_of_mitsuba(tmp_path, case):
    files, options = CASES[case]
    path, reference = written(tmp_path, files)
    if case == "instances":
        reference.write_text(re.sub(r"\{\{(.*?)\}\}", lit, PLACED))
    thermal_scene(path, tmp_path / "thermal", 300, **options)
    ours = mi_lcair.render(tmp_path / "thermal" / "scene.xml", spp=1024)
    image, error = stock_image(reference)
    assert image.max() > 0.2 * B
    both = np.hypot(error, ours.channels["stderr.Y"]) + 1e-5 * B
    off = (ours.channels["Y"] - image) / both
    assert abs(off.mean()) < 3 / np.sqrt(off.size), (off.mean(), off)
    assert np.mean(abs(off) > 3) < 0.08 and abs(off).max() < 9, off  # of 8 images, Student's t


def room(*inside):
    """A closed isothermal room around these shapes."""
    wall = '<shape type="cube"> <boolean name="flip_normals" value="true"/> <bsdf type="diffuse">'
    place = '<transform name="to_world"> <scale value="5"/> </transform> </shape>'
    depth = '<integrator type="path"/>'
    return scene(depth, CAMERA, wall, GREY(0.4), "</bsdf>", place, *inside)


@pytest.mark.slow
@pytest.mark.parametrize(
    "bsdf",
    [
        '<bsdf type="conductor"> <string name="material" value="Cu"/> </bsdf>',
        '<bsdf type="principled"> <float name="metallic" value=".6"/> </bsdf>',
        '<bsdf type="roughplastic"/>',
    ],
)
def test_an_isothermal_room_is_a_blackbody(tmp_path, bsdf):
    """Emissivities that follow from reflectances: whatever a surface reflects, it does not emit."""
    path = tmp_path / "room.xml"
    path.write_text(room(BALL.format(bsdf)))
    thermal_scene(path, tmp_path / "thermal", 300)
    image = mi_lcair.render(tmp_path / "thermal" / "scene.xml", spp=256).channels["Y"]
    assert image.mean() == pytest.approx(B, rel=3e-3)


def test_names_and_files_are_kept(tmp_path):
    path, _ = written(tmp_path, INCLUDES)
    remarks = thermal_scene(path, tmp_path / "away" / "thermal", 310, parameters={"spp": "9"})
    made = mi_lcair.load(tmp_path / "away" / "thermal" / "scene.xml", temperature=320)
    assert {shape.id() for shape in made.mi.shapes()} == {"floor", "ball", "obj"}
    assert {shape.emitter().first_temperatures[0] for shape in made.mi.shapes()} == {320}
    assert made.mi.sensors()[0].id() == "camera"
    assert made.mi.sensors()[0].sampler().sample_count() == 9
    assert made.mi.integrator().max_bounces == 4
    assert any("lamps (1) have the same temperature" in remark for remark in remarks)
    assert any("$-parameters became numbers: spp, wall" in remark for remark in remarks)
    assert not any("left out" in remark or "limit" in remark for remark in remarks)


def test_what_is_left_out_is_told(tmp_path):
    path, _ = written(tmp_path, {"scene.xml": CBOX["scene.xml"].replace(PATH, "")})
    remarks = " ".join(thermal_scene(path, tmp_path / "thermal", 300))
    assert "left out: constant, point, spot, directional, projector; put" in remarks
    assert "has no limit of reflections; max_bounces is 30" in remarks and "share" not in remarks
    path, _ = written(tmp_path, MEDIUM)
    remarks = " ".join(thermal_scene(path, tmp_path / "thermal", 300, overwrite=True))
    assert "mediums are left out: homogeneous" in remarks
    made = mi_lcair.load(tmp_path / "thermal" / "scene.xml")
    assert len(made.mi.shapes()) == 2 and len(made.sensors) == 2


def test_the_share_of_surfaces_with_a_given_emissivity(tmp_path):
    """A sheet that fills the left half of the image."""
    sensor = CAMERA.replace("perspective", "orthographic").replace(
        '<float name="fov" value="50"/>', ""
    )
    sheet = '<shape type="rectangle"> <bsdf type="thindielectric"/> <transform name="to_world">'
    turned = (
        '<rotate x="1" angle="90"/> <scale value="9"/> <translate x="9"/> </transform> </shape>'
    )
    path = tmp_path / "half.xml"
    path.write_text(scene(PATH, sensor, sheet, turned))
    remarks = " ".join(thermal_scene(path, tmp_path / "thermal", 300, emissivity=["0.8"]))
    assert re.search(r"are (49|50|51) % of the first sensor's image", remarks), remarks


@pytest.mark.parametrize(
    "files, options, message",
    [
        (
            {"scene.xml": INSTANCES["scene.xml"].replace("cube", "sdfgrid")},
            {},
            "sdfgrid: its instances cannot become shapes",
        ),
        (NESTED, {}, r"bsdf glass \(SmoothDielectric\) transmits.* each of glass, bark, mixed"),
        (NESTED, {"emissivity": [".6", "brass=.1"]}, "unknown shape or BSDF 'brass'"),
        (NESTED, {"emissivity": ["glass=lots"]}, "'glass=lots': must be NUMBER or NAME=NUMBER"),
        (NESTED, {"emissivity": ["glass=1.5"]}, "'glass=1.5' = 1.5; must lie in 0..1"),
        (INCLUDES, {"parameters": {"walls": "1"}}, "unknown parameter of scene.xml 'walls'"),
        ({"scene.xml": scene(PATH, FLOOR)}, {}, '"white"'),
        ({"scene.xml": scene('<include filename="no.xml"/>')}, {}, "no.xml"),
        ({"scene.xml": scene(PATH, CAMERA)}, {}, "at least one shape"),
        ({"scene.xml": '<bsdf version="3.0.0" type="diffuse"/>'}, {}, "must be a <scene>"),
    ],
)
def test_refused_with_nothing_written(tmp_path, files, options, message):
    path, _ = written(tmp_path, files)
    with pytest.raises(InputError, match=message) as refusal:
        thermal_scene(path, tmp_path / "thermal", 300, **options)
    assert "\n" not in str(refusal.value) and not (tmp_path / "thermal").exists()


def test_a_band_of_a_file(tmp_path, monkeypatch):
    """The response stays where it is, as meshes do."""
    path, _ = written(tmp_path, INCLUDES)
    (tmp_path / "response.csv").write_text("wavelength_um,response\n8,1\n9,1\n")
    monkeypatch.chdir(tmp_path)
    thermal_scene(path, "thermal", 300, "response.csv")
    monkeypatch.chdir("/")
    made = mi_lcair.load(tmp_path / "thermal" / "scene.xml")
    assert made.band.upper_um == 9

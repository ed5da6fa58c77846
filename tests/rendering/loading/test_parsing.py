"""What can hang while Mitsuba makes the objects of a scene, in processes that can be ended."""

import re
import subprocess
import sys

import mitsuba as mi
import numpy as np
import pytest

import mi_lcair
from mi_lcair.errors import InputError
from mi_lcair.rendering.images.files import write_exr
from mi_lcair.rendering.loading.remarks import remarks_on_triangles
from tests.rendering.loading.scene_text import (
    FACETS,
    HALVES,
    PAINT,
    PATH,
    SENSOR,
    SQUARE,
    THERMAL,
    mesh,
    shape,
    write,
    write_ply,
)

# What a scene file must not say: each case is one line that names the place and what would be
# --------------------------------------------------------------------------------------------
# right, before Mitsuba, which would end the process or pass over it in silence, sees it.

PLACE = r"scene\.xml \(line \d+, col \d+\): "


def refused(path, message, **parameters):
    with pytest.raises(InputError, match=message) as caught:
        mi_lcair.load(path, **parameters)
    assert str(caught.value).isprintable() and "Traceback" not in str(caught.value)


def texture(name: str, kind: str, inside: str = "") -> str:
    return f'<texture type="{kind}" name="{name}">{inside}</texture>'


def diffuse(value: str) -> str:
    return f'<bsdf type="diffuse">{value}</bsdf>'


def placed(operation: str) -> str:
    return f'<transform name="to_world">{operation}</transform>'


@pytest.mark.parametrize(
    "element, message",
    [
        # Mitsuba ends the process
        (shape(diffuse(texture("reflectance", "bitmap")) + THERMAL), "bitmap: lacks its filename"),
        (
            shape(PAINT + re.sub("<float.*?/>", texture("temperature", "bitmap"), THERMAL)),
            "bitmap: lacks its filename",
        ),
        (shape('<bsdf type="blendbsdf"/>' + THERMAL), "blendbsdf: needs 2 bsdf inside"),
        (shape(diffuse(texture("reflectance", "volume")) + THERMAL), "volume: needs 1 volume"),
        ("<shape type='rectangle'>" * 5000 + "</shape>" * 5000, "nested more than 40 deep"),
        # values that Mitsuba takes
        (shape(diffuse('<float name="reflectance" value="1.5"/>')), "reflectance = 1.5; .*0..1"),
        (shape(diffuse('<float name="reflectance" value="nan"/>')), "reflectance = nan"),
        (shape(diffuse('<spectrum name="reflectance" value="-1"/>')), "reflectance = -1"),
        (shape(diffuse('<rgb name="reflectance" value="2, 0, 0"/>')), "reflectance = 2"),
        (
            shape(diffuse(texture("reflectance", "uniform", '<float name="value" value="350"/>'))),
            "reflectance = 350",
        ),
        (
            shape('<bsdf type="roughconductor"> <float name="alpha" value="-1"/> </bsdf>'),
            "alpha = -1; must be positive",
        ),
        (
            shape(
                '<bsdf type="roughconductor"> '
                '<float name="specular_reflectance" value="3"/> </bsdf>'
            ),
            "specular_reflectance = 3",
        ),
        (
            shape(PAINT + '<emitter type="area"> <float name="radiance" value="-5"/> </emitter>'),
            "area: radiance = -5",
        ),
        (
            shape(PAINT + '<emitter type="area"> <float name="radiance" value="1e39"/> </emitter>'),
            "area: radiance = 1e\\+39; must lie in 0..1e\\+15",
        ),
        ('<emitter type="constant"> <float name="radiance" value="1e20"/> </emitter>', "1e\\+20"),
        (shape(PAINT + '<float name="radius" value="0"/>', "sphere"), "radius = 0"),
        (shape(PAINT + '<float name="radius" value="nan"/>', "sphere"), "radius = nan"),
        (shape(PAINT + placed('<scale value="0"/>')), "flattens to nothing"),
        (shape(PAINT + placed('<rotate x="1" z="1" angle="60"/>')), "axis that is not of length 1"),
        (
            shape(PAINT + placed('<scale x="nan"/>')),
            "to_world: largest number of the transform = nan m; must lie in",
        ),
        (
            shape(PAINT + placed('<translate x="1e30"/>')),
            "transform = 1e\\+30 m; must lie in 0..1e\\+09",
        ),
        (
            SENSOR.replace("</film>", '</film> <float name="far_clip" value="inf"/>'),
            "far_clip = inf",
        ),
        (
            SENSOR.replace(
                "</film>",
                '</film> <sampler type="independent"> '
                '<integer name="sample_count" value="0"/> </sampler>',
            ),
            "sample_count = 0; must lie in 1..",
        ),
        (
            shape(PAINT + THERMAL.replace("300", "")),
            '<float name="temperature"> has an empty value',
        ),
        (shape(PAINT + THERMAL.replace("300", " ")), "has an empty value"),
        (shape(PAINT + placed('<translate x=""/>')), "<translate> has an empty x"),
        # what Mitsuba passes over
        (
            shape(PAINT + placed(f'<translate x="1">{shape(PAINT + THERMAL)}</translate>')),
            "<shape> inside <translate> is not read",
        ),
        (THERMAL, "thermal: belongs to no shape"),
        (shape(PAINT.replace("LWIR", "MWIR") + THERMAL), "band MWIR differs from LWIR"),
        (shape(PAINT.replace("LWIR", "7-12")), "band 7-12 differs from LWIR"),
        (shape(PAINT + THERMAL.replace("<float name", "<string name")), "is a string; .*a float"),
        (
            '<integrator type="bounce_path"> '
            '<string name="emitter_sampling" value="no"/> </integrator>',
            "'no' is a string; it must be a boolean or 'auto'",
        ),
        (
            shape(
                PAINT
                + THERMAL.replace("</emitter>", '<float name="to_world" value="1"/> </emitter>')
            ),
            '"to_world" has the wrong type',
        ),
        (shape('<bsdf type="hair"/>'), "hair: works only in spectral variants"),
    ],
)
def test_refused(tmp_path, element, message):
    others = [shape(PAINT + THERMAL)]
    if "integrator" not in element:
        others.append(PATH)
    if "sensor" not in element:
        others.append(SENSOR)
    refused(write(tmp_path, *others, element), f"{PLACE}.*{message}")


@pytest.mark.parametrize(
    "band, given", [("8-12", "LWIR"), ("lwir", "LWIR"), ("response.csv", "response.csv")]
)
def test_one_band_by_several_names(tmp_path, band, given):
    (tmp_path / "response.csv").write_text("wavelength_um,response\n8,1\n12,1\n")
    scene = mi_lcair.load(
        write(
            tmp_path,
            PATH,
            SENSOR,
            shape(PAINT + THERMAL.replace("LWIR", given)).replace("LWIR", band, 1),
        )
    )
    assert scene.band.lower_um == 8


def test_a_parameter_without_a_value_is_empty(tmp_path):
    path = write(
        tmp_path,
        '<default name="T" value="300"/>',
        PATH,
        SENSOR,
        shape(PAINT + THERMAL.replace("300", "$T")),
    )
    assert mi_lcair.load(path)
    refused(path, "has an empty value", T="")


def test_shapes_without_bsdf_are_remarked(tmp_path):
    """Mitsuba's default is a grey of 0.5 on what does not emit, and black on what does."""
    scene = mi_lcair.load(write(tmp_path, PATH, SENSOR, shape(THERMAL), shape(""), shape(PAINT)))
    remarks = [remark for remark in scene.remarks if "has no BSDF" in remark]
    assert [re.search("reflects (.*)", remark)[1] for remark in remarks] == [
        "nothing",
        "half of what arrives",
    ]


@pytest.mark.parametrize("kind", ["sphere", "ply", "obj", "obj with normals"])
def test_mirrored_shapes_that_turn_inside_out_are_remarked(tmp_path, kind):
    """The remark stands exactly where the sensor, above, sees no emission."""
    corners = "v -1 -1 0\nv 1 -1 0\nv 1 1 0\n"
    write_ply(tmp_path / "plate.ply", SQUARE, HALVES)
    (tmp_path / "plate.obj").write_text(f"{corners}f 1 2 3\n")
    (tmp_path / "up.obj").write_text(f"{corners}vn 0 0 1\nf 1//1 2//1 3//1\n")
    names = {"ply": "plate.ply", "obj": "plate.obj", "obj with normals": "up.obj"}
    file = f'<string name="filename" value="{names[kind]}"/>' if kind in names else ""
    for scale, flipped in ((1, False), (-1, False), (-1, True)):
        place = f'<transform name="to_world"><scale x="{scale}"/><translate z="3"/></transform>'
        flip = '<boolean name="flip_normals" value="true"/>' if flipped else ""
        eye = '<transform name="to_world"><lookat origin="0,0,9" target="0,0,0"/></transform>'
        sensor = SENSOR.replace("<film", f"{eye}<film", 1)
        inside = file + place + flip + PAINT + THERMAL
        scene = mi_lcair.load(write(tmp_path, PATH, sensor, shape(inside, kind.split()[0])))
        is_remarked = any("turns it inside out" in remark for remark in scene.remarks)
        is_dark = mi_lcair.signature(scene, spp=8).scene.intensity == 0
        assert is_remarked == (is_dark and not flipped)


# ---------------------------------------------------------------- Meshes


def plate(tmp_path, faces=HALVES, **attributes):
    write_ply(tmp_path / "plate.ply", SQUARE, faces, **attributes)
    return lambda emitter, bsdf=PAINT: write(tmp_path, PATH, SENSOR, mesh(bsdf + emitter))


def test_facet_temperatures(tmp_path):
    assert mi_lcair.load(plate(tmp_path, temperature=[300, 310])(FACETS))


def test_missing_attribute(tmp_path):
    """It would read 0, and the facets would emit nothing."""
    path = plate(tmp_path, temperature=[300, 310])(
        FACETS.replace("face_temperature", "face_temprature")
    )
    refused(
        path, "mesh attribute 'face_temprature', which the shape does not have.*face_temperature"
    )
    refused(
        write(tmp_path, PATH, SENSOR, shape(PAINT + FACETS)),
        "which the shape does not have; .*none",
    )


def test_attribute_of_a_reflectance(tmp_path):
    reflectance = """<bsdf type="diffuse"> <texture type="mesh_attribute" name="reflectance">
        <string name="name" value="vertex_shade"/> </texture> </bsdf>"""
    refused(
        plate(tmp_path)(THERMAL, reflectance), "reflectance names the mesh attribute 'vertex_shade'"
    )


@pytest.mark.parametrize("temperature", [-5, 0, 1e10, np.nan])
def test_impossible_facet_temperatures(tmp_path, temperature):
    refused(plate(tmp_path, temperature=[300, temperature])(FACETS), "temperature of facet 1 = ")


@pytest.mark.parametrize("index", [4, 5, 10**6, 2**31 - 1, -1])
def test_corner_that_is_no_vertex(tmp_path, index):
    """Mitsuba drops the facet, takes vertex 0 or dies."""
    path = plate(tmp_path, [[0, 1, 2], [0, 2, index]])(THERMAL)
    refused(path, f"{PLACE}.*plate.ply: face 1 names vertex {index}; the mesh has 4")


def test_damaged_obj(tmp_path):
    """Mitsuba drops the second face."""
    (tmp_path / "plate.obj").write_text("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nf 1 3 4x\n")
    path = write(
        tmp_path, PATH, SENSOR, mesh(PAINT + THERMAL, "plate.obj").replace('"ply"', '"obj"')
    )
    refused(path, "plate.obj, line 6: a face must be indices")


# ---------------------------------------------------------------- Thin sheets


def test_thin_sheets_are_remarked(tmp_path):
    """Two-sided facets back to back, and one on the other: which is seen is left to rounding."""
    write_ply(tmp_path / "plate.ply", SQUARE, [*HALVES, [0, 2, 1]])
    scene = mi_lcair.load(write(tmp_path, PATH, SENSOR, mesh(PAINT + THERMAL)))
    assert not any("triangles" in remark for remark in scene.remarks)
    both = f'<bsdf type="twosided">{PAINT}</bsdf>'
    scene = mi_lcair.load(write(tmp_path, PATH, SENSOR, mesh(both + THERMAL)))
    assert any("1 pair of triangles" in r and "back to back" in r for r in scene.remarks)
    smaller = placed('<scale value="0.5"/>')
    write_ply(tmp_path / "plate.ply", SQUARE, HALVES)
    scene = mi_lcair.load(
        write(tmp_path, PATH, SENSOR, mesh(PAINT + THERMAL), mesh(smaller + PAINT + THERMAL))
    )
    assert any("2 pairs of triangles" in r and "one on the other" in r for r in scene.remarks)
    apart = placed('<translate z="0.001"/>')
    scene = mi_lcair.load(
        write(tmp_path, PATH, SENSOR, mesh(PAINT + THERMAL), mesh(apart + PAINT + THERMAL))
    )
    assert not any("triangles" in remark for remark in scene.remarks)


def test_triangles_are_compared_once_for_each_state_of_the_scene(tmp_path, monkeypatch):
    """Remarks are asked for often. They follow the values of the scene: here a facet comes to lie
    on another one, leaves it, and comes back.
    """
    apart = placed('<translate z="0.5"/>')
    write_ply(tmp_path / "plate.ply", SQUARE, HALVES)
    scene = mi_lcair.load(
        write(tmp_path, PATH, SENSOR, mesh(PAINT + THERMAL), mesh(apart + PAINT + THERMAL))
    )
    calls = []
    monkeypatch.setattr(
        "mi_lcair.rendering.loading.remarks.remarks_on_triangles",
        lambda loaded: (calls.append(1), remarks_on_triangles(loaded))[1],
    )
    overlap = lambda: any("triangles" in remark for remark in scene.remarks)
    assert not overlap() and not overlap() and len(calls) == 1
    parameters = mi.traverse(scene.mi)
    (key,) = [
        key
        for key in parameters.keys()  # noqa: SIM118 SceneParameters is no dict
        if key.endswith("vertex_positions") and parameters[key].numpy()[2] > 0.4
    ]
    high = parameters[key].numpy().copy()
    low = high.copy()
    low[2::3] -= 0.5
    for number, (values, expected) in enumerate(((low, True), (high, False), (low, True)), 2):
        parameters[key] = values
        parameters.update()
        assert overlap() is expected and overlap() is expected and len(calls) == number


# ---------------------------------------------------------------- Misspelt names


@pytest.mark.parametrize(
    "element, message",
    [
        (
            '<emitter type="sun"> <float name="azimut_deg" value="1"/> '
            '<float name="elevation_deg" value="1"/> <string name="band" value="MWIR"/> </emitter>',
            "unknown property of sun 'azimut_deg'; known: azimuth_deg",
        ),
        (
            shape(PAINT + THERMAL.replace('"temperature"', '"temperatur"')),
            "unknown property of thermal 'temperatur'; known: temperature",
        ),
        (
            shape('<bsdf type="material"> <string name="materal" value="blackbody"/> </bsdf>'),
            "unknown property of material 'materal'; known: material",
        ),
        (
            shape('<bsdf type="sandford_robertson"> <float name="epsilom" value="0.1"/> </bsdf>'),
            "unknown property of sandford_robertson 'epsilom'; known: epsilon",
        ),
    ],
)
def test_a_misspelt_property_is_named_with_the_one_that_is_meant(tmp_path, element, message):
    refused(write(tmp_path, PATH, SENSOR, element), PLACE + message)


def test_a_name_that_is_like_no_other_is_left_to_mitsuba(tmp_path):
    element = shape(PAINT + THERMAL.replace("</emitter>", '<float name="x" value="1"/></emitter>'))
    refused(write(tmp_path, PATH, SENSOR, element), "unreferenced property")


# ---------------------------------------------------------------- Sun


@pytest.mark.parametrize("elevation, is_remarked", [(-20, True), (0, True), (20, False)])
def test_a_sun_below_the_horizon_is_remarked(tmp_path, elevation, is_remarked):
    sun = (
        f'<emitter type="sun"> <float name="elevation_deg" value="{elevation}"/> '
        '<float name="azimuth_deg" value="60"/> <string name="band" value="LWIR"/> </emitter>'
    )
    scene = mi_lcair.load(write(tmp_path, PATH, SENSOR, shape(PAINT + THERMAL), sun))
    assert any("below the horizon" in remark for remark in scene.remarks) is is_remarked


@pytest.mark.parametrize(
    "properties, remarked",
    [
        ('<string name="sky" value="250"/> GROUND', "ground in the dark beside"),
        (
            '<string name="sky" value="clear"/> GROUND',
            "a sky without scattered sunlight and ground in the dark beside the emitter sun; "
            'add <float name="sun_elevation_deg" value="20"/> <float name="sun_azimuth_deg" '
            'value="60"/>',
        ),
        ('<string name="sky" value="250"/>', ""),
        ('<string name="sky" value="overcast"/> GROUND', ""),
        (
            '<string name="sky" value="250"/> GROUND <float name="sun_elevation_deg" value="20"/>',
            "",
        ),
    ],
)
def test_a_sky_by_night_beside_a_sun_is_remarked(tmp_path, properties, remarked):
    """Its grey ground is dark, and a clear sky scatters no sunlight."""
    ground = (
        '<float name="ground_temperature" value="290"/> '
        '<float name="ground_emissivity" value="0.7"/> '
        '<float name="sun_azimuth_deg" value="60"/>'
    )
    sky = f'<emitter type="sky"> <string name="band" value="LWIR"/> {properties} </emitter>'
    sky = sky.replace("GROUND", ground)
    sun = (
        '<emitter type="sun"> <float name="elevation_deg" value="20"/> '
        '<float name="azimuth_deg" value="60"/> <string name="band" value="LWIR"/> </emitter>'
    )
    scene = mi_lcair.load(write(tmp_path, PATH, SENSOR, shape(PAINT + THERMAL), sun, sky))
    of_sky = [remark for remark in scene.remarks if "sun_elevation_deg" in remark]
    assert len(of_sky) == bool(remarked) and all(remarked in remark for remark in of_sky)


# Scenes far from their origin: moved there in double precision, or refused
# -------------------------------------------------------------------------

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
    assert any("it was moved to the origin" in remark for remark in scene.remarks)
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


ONE_THREAD = """
import sys, drjit, mi_lcair, mitsuba
drjit.set_thread_count(1)
mi_lcair.load(sys.argv[1])
print(drjit.thread_count())
"""

COLLECTING = """
import sys, drjit, mi_lcair, mitsuba as mi

class Litter(mi.BSDF):
    def __init__(self, properties):
        super().__init__(properties)
        scene = scenes.pop()
        scene.moved["itself"] = scene  # only a collection of garbage frees it
        del scene
        [[] for _ in range(100_000)]  # begins a collection

mi.register_bsdf("litter", Litter)
scenes = [mi_lcair.load("two_plates") for _ in range(8)]
drjit.set_thread_count(4)
try:
    mi_lcair.load(sys.argv[1])
except mi_lcair.InputError as error:
    print(error)
"""


def run(script, path) -> str:
    return subprocess.check_output([sys.executable, "-c", script, path], text=True)


def test_an_exr_file_with_one_thread(tmp_path):
    """Mitsuba alone would wait for ever."""
    write_exr(tmp_path / "texture.exr", {"Y": np.full((2, 2), 0.5)}, {})
    texture = (
        '<bsdf type="diffuse"> <texture type="bitmap" name="reflectance">'
        '<string name="filename" value="texture.exr"/> </texture> </bsdf>'
    )
    path = write(tmp_path, PATH, SENSOR, shape(PAINT + THERMAL), shape(texture))
    assert run(ONE_THREAD, path) == "1\n"


def test_garbage_of_scenes_while_one_is_loaded(tmp_path):
    """A thread of Mitsuba would wait for the loading thread, and that one for it."""
    littering = [shape('<bsdf type="litter"/>') for _ in range(8)]
    path = write(tmp_path, PATH, SENSOR, shape(PAINT + THERMAL), *littering)
    assert "Litter::sample" in run(COLLECTING, path)  # made, and refused only when it is used

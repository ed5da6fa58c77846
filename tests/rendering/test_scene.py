"""Loading: whatever makes a scene unusable is one InputError that says what, where and what would
be right.
"""

import re
import subprocess
import sys
from pathlib import Path

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

import mi_lcair
from mi_lcair.errors import InputError
from mi_lcair.plugins.paths.launch import Launch
from mi_lcair.rendering.scene import changed, checked

SENSOR = (
    '<sensor type="orthographic"><film type="hdrfilm"><integer name="width" value="4"/>'
    '<integer name="height" value="4"/></film></sensor>'
)
PATH = '<integrator type="bounce_path"/>'
THERMAL = (
    '<emitter type="thermal"><string name="band" value="$band"/>'
    '<float name="temperature" value="300"/></emitter>'
)


def write(tmp_path, *elements):
    path = tmp_path / "scene.xml"
    path.write_text(
        '<scene version="3.0.0"><default name="band" value="LWIR"/>'
        + "".join(elements)
        + "</scene>"
    )
    return path


def shape(inside, kind="rectangle"):
    return f'<shape type="{kind}">{inside}</shape>'


def bsdf(material="gloss_black", **properties):
    strings = "".join(
        f'<string name="{name}" value="{value}"/>' for name, value in properties.items()
    )
    return (
        f'<bsdf type="sandford_robertson"><string name="material" value="{material}"/>'
        f'<string name="band" value="$band"/>{strings}</bsdf>'
    )


def parameters(**numbers):
    floats = "".join(f'<float name="{name}" value="{value}"/>' for name, value in numbers.items())
    return f'<bsdf type="sandford_robertson">{floats}</bsdf>'


def test_loads(tmp_path):
    scene = mi_lcair.load(write(tmp_path, PATH, SENSOR, shape(bsdf() + THERMAL)), band="MWIR")
    assert (scene.name, scene.band.name, scene.groups, scene.parameters) == (
        tmp_path.name,
        "MWIR",
        ["self"],
        {"band": "MWIR"},
    )  # a file scene.xml is named after its folder


@pytest.mark.parametrize("given", ["", '<string name="pixel_format" value="rgba"/>'])
def test_no_warning_about_a_film_of_colours(tmp_path, caplog, given):
    """The renderer has radiances, whatever the film of a user's scene is for."""
    sensor = SENSOR.replace('type="hdrfilm">', f'type="hdrfilm">{given}')
    mi_lcair.load(write(tmp_path, PATH, sensor, shape(bsdf() + THERMAL)), band="MWIR")
    assert (given in sensor) and not caplog.records


@pytest.mark.slow
@pytest.mark.parametrize(
    "elements, given, message",
    [
        (
            [PATH, SENSOR, shape(bsdf() + THERMAL)],
            {"bnad": "MWIR"},
            "unknown parameter of scene.xml 'bnad'; known: band",
        ),
        (
            ['<integrator type="bounce_pat"/>', SENSOR],
            {},
            'line 1.*"bounce_pat" not found.*nearest known are: bounce_path',
        ),
        (
            [PATH, SENSOR, shape(bsdf("gloss_blak") + THERMAL)],
            {},
            "line 1.*unknown material 'gloss_blak'; known: gloss_black",
        ),
        (
            [PATH, SENSOR, shape(bsdf() + THERMAL)],
            {"band": "MWR"},
            "unknown band 'MWR'; known: MWIR",
        ),
        (
            [PATH, SENSOR, shape(bsdf() + THERMAL)],
            {"band": "SWIR"},
            "gloss_black.*not measured for band SWIR.*allow_band",
        ),
        (
            [PATH, SENSOR, shape(parameters(epsilon=0.9, rho_d=0.3, b=0.1, e=0.1) + THERMAL)],
            {},
            r"epsilon \+ rho_d = 1.2; must be at most G\(b\) = 0.96",
        ),
        (
            [PATH, SENSOR, shape(parameters(epsilon=-0.1, rho_d=0.3, b=0.1, e=0.1) + THERMAL)],
            {},
            "epsilon = -0.1; must be 0 or more",
        ),
        (
            [PATH, SENSOR, shape(parameters(epsilon=0.1, rho_d=0.3, b=1.5, e=0.1) + THERMAL)],
            {},
            "b = 1.5; must lie in 0..1",
        ),
        (
            [PATH, SENSOR, shape(parameters(epsilon=0.1, rho_d=0.3, b=0.5, e=0) + THERMAL)],
            {},
            "e = 0; must be positive and at most 1",
        ),
        (
            [PATH, SENSOR, shape(parameters(epsilon=0.1, rho_d=0.3, b=0.5) + THERMAL)],
            {},
            "give `material` and `band`, or e",
        ),
        (
            [PATH, SENSOR, shape(bsdf(lobe="mirrored") + THERMAL)],
            {},
            "unknown lobe 'mirrored'; known: ",
        ),
        (
            [PATH, SENSOR, shape(bsdf(emissivity="none.csv") + THERMAL)],
            {},
            "none.csv.*cannot be read",
        ),
        (
            [PATH, SENSOR, shape(bsdf() + THERMAL.replace("300", "0"))],
            {},
            "temperature = 0 K; must be positive",
        ),
        ([PATH, SENSOR, shape(bsdf() + THERMAL.replace("300", "nan"))], {}, "nan"),
        (
            [PATH, SENSOR, shape('<string name="filename" value="gone.ply"/>' + THERMAL, "ply")],
            {},
            'gone.ply": file not found',
        ),
        (
            [PATH, SENSOR, shape('<bsdf type="mask"><bsdf type="diffuse"/></bsdf>' + THERMAL)],
            {},
            "MaskBSDF hides the emissivity",
        ),
        (
            [PATH, SENSOR, shape('<bsdf type="dielectric"/>' + THERMAL)],
            {},
            "transmits.*give the thermal emitter an `emissivity`",
        ),
        ([SENSOR, shape(bsdf() + THERMAL)], {}, "integrator must be bounce_path"),
        ([PATH, shape(bsdf() + THERMAL)], {}, "has no sensor"),
        (
            [
                PATH,
                '<sensor type="orthographic"><film type="hdrfilm">'
                '<integer name="width" value="0"/></film></sensor>',
                shape(bsdf() + THERMAL),
            ],
            {},
            "the film of sensor 0 has no pixels",
        ),
        ([PATH, SENSOR, shape(bsdf())], {}, "no thermal emitter names a band"),
        (
            [PATH, SENSOR, shape(bsdf() + THERMAL), shape(THERMAL.replace("$band", "SWIR"))],
            {},
            "mixes bands: LWIR, SWIR",
        ),
        (
            [
                '<integrator type="bounce_path">'
                '<integer name="max_bounces" value="-1"/></integrator>',
                SENSOR,
            ],
            {},
            "max_bounces = -1",
        ),
        (
            [
                '<integrator type="bounce_path"><string name="closure" value="tale"/></integrator>',
                SENSOR,
            ],
            {},
            "unknown closure 'tale'",
        ),
        (
            [
                '<integrator type="bounce_path"><integer name="bounces" value="1"/></integrator>',
                SENSOR,
            ],
            {},
            "unknown property of bounce_path 'bounces'; known: max_bounces",
        ),
    ],
)
def test_refuses(tmp_path, elements, given, message):
    path = write(tmp_path, *elements)
    with pytest.raises(InputError, match=message) as caught:
        mi_lcair.load(path, **given)
    assert "\n" not in str(caught.value) and "Traceback" not in str(caught.value)


@pytest.mark.parametrize(
    "name, message",
    [
        ("two_plate", "unknown bundled scene 'two_plate'; known: two_plates"),
        ("gone.xml", "scene 'gone.xml': no such file"),
    ],
)
def test_unknown_scene(name, message):
    with pytest.raises(InputError, match=message):
        mi_lcair.load(name)


def test_not_xml(tmp_path):
    path = tmp_path / "scene.xml"
    path.write_text("temperature: 300 K")
    with pytest.raises(InputError, match="scene.xml: is not XML"):
        mi_lcair.load(path)


def test_facet_without_temperature(tmp_path):
    """A facet whose temperature is not positive: which one."""
    flat = mi.Mesh("plate", 4, 2)
    values = mi.traverse(flat)
    values["vertex_positions"], values["faces"] = (
        [0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0],
        [0, 1, 2, 0, 2, 3],
    )
    values.update()
    flat.add_attribute("face_temperature", 1, [300.0, -5.0])
    flat.write_ply(str(tmp_path / "plate.ply"))
    texture = (
        '<texture type="mesh_attribute" name="temperature">'
        '<string name="name" value="face_temperature"/></texture>'
    )
    emitter = f'<emitter type="thermal"><string name="band" value="$band"/>{texture}</emitter>'
    path = write(
        tmp_path,
        PATH,
        SENSOR,
        shape('<string name="filename" value="plate.ply"/>' + emitter, "ply"),
    )
    with pytest.raises(InputError, match="temperature of facet 1 = -5 K"):
        mi_lcair.load(path)


def test_files_beside_the_scene(tmp_path):
    """Materials, emissivities and bands named in a scene are found beside it, whatever the working
    folder.
    """
    (tmp_path / "own.toml").write_text(
        '[paint.LWIR]\nepsilon = 0.5\nrho_d = 0.1\nb = 0.2\ne = 0.3\nsource = "test"\n'
    )
    (tmp_path / "measured.csv").write_text("theta_deg,emissivity\n0,0.7\n80,0.6\n")
    path = write(
        tmp_path,
        PATH,
        SENSOR,
        shape(bsdf("paint", materials="own.toml", emissivity="measured.csv") + THERMAL),
    )
    assert mi_lcair.load(path).band.name == "LWIR"


def test_saturation_is_remarked(tmp_path):
    """Parameters with which the raw model reflects more than arrives near grazing: said when the
    scene loads.
    """
    scene = mi_lcair.load(
        write(
            tmp_path,
            PATH,
            SENSOR,
            shape(parameters(epsilon=0.05, rho_d=0.02, b=0.05, e=0.3) + THERMAL),
        )
    )
    assert any("would reflect more than 100 % beyond" in remark for remark in scene.remarks)
    assert not mi_lcair.load("furnace").remarks


def test_set_lobe():
    scene = mi_lcair.load("furnace", resolution=8)
    scene.set_lobe("mirror", "bare_aluminum")
    assert mi_lcair.render(scene, spp=8).mean > 0
    with pytest.raises(InputError, match="unknown material 'tin'; known: "):
        scene.set_lobe("mirror", "tin")
    with pytest.raises(InputError, match="^cavity: no lobe can be set; no surface has a refl"):
        mi_lcair.load("cavity", resolution=8).set_lobe("mirror")


def test_the_lobe_of_a_material_when_the_scene_is_loaded():
    """It is that of `set_lobe`; the parameters of the scene name it."""
    given = {"lobe.bare_aluminum": "mirror", "resolution": "8"}
    scene = mi_lcair.load("furnace", **given)
    assert {surface.material: surface.lobe for surface in scene.surfaces()}[
        "bare_aluminum"
    ] == "mirror"
    assert {surface.lobe for surface in scene.surfaces()} == {"mirror", "brdf"}
    assert scene.parameters == given
    later = mi_lcair.load("furnace", resolution=8)
    later.set_lobe("mirror", "bare_aluminum")
    assert later.fingerprint == scene.fingerprint
    for wrong, message in (
        ("lobe.tin", "unknown material 'tin'"),
        ("lob.tin", "unknown parameter"),
    ):
        with pytest.raises(InputError, match=message):
            mi_lcair.load("furnace", **{wrong: "mirror"})
    with pytest.raises(InputError, match="unknown lobe 'shiny'"):
        mi_lcair.load("furnace", **{"lobe.bare_aluminum": "shiny"})


@pytest.mark.slow
@pytest.mark.parametrize("use", ["load('two_plates')", "signature('two_plates', spp=4)"])
def test_other_variants_are_refused(use):
    """Also if the variant was set before the import, when no module of ours is loaded yet."""
    code = f"import mitsuba as mi; mi.set_variant('scalar_rgb'); import mi_lcair; mi_lcair.{use}"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert result.stderr.splitlines()[-1] == (
        "mi_lcair.errors.InputError: variant scalar_rgb cannot render thermal scenes; set one of "
        "llvm_ad_mono, cuda_ad_mono, metal_ad_mono"
    )


# Settings change in one way and are put back exactly; what a render derives stays with it
# ----------------------------------------------------------------------------------------


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


@pytest.mark.parametrize("model", ["microfacet", "sandford_robertson"])
def test_kernels_are_the_same_in_each_run(tmp_path, model):
    """None reads an array as it is aligned, as NumPy's are by chance.

    Dr.Jit compiles another kernel where it is not aligned, which took a second or more.
    """
    numbers = {
        "microfacet": {"alpha": 0.213, "gamma": 2.04, "n": 3.1, "k": 2.2, "rho_d": 0.19},
        "sandford_robertson": {"epsilon": 0.213, "rho_d": 0.11, "b": 0.52, "e": 0.31},
    }
    given = "".join(f'<float name="{name}" value="{v}"/>' for name, v in numbers[model].items())
    path = write(tmp_path, SENSOR, PATH, shape(f'<bsdf type="{model}">{given}</bsdf>{THERMAL}'))
    dr.kernel_history_clear()
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        mi_lcair.signature(mi_lcair.load(path), spp=4)
        kernels = dr.kernel_history([dr.KernelType.JIT])
    assert len(kernels) > 10
    unaligned = re.compile(r"load <\d+ x \w+>, ptr %\w+_p3, align 1,")
    assert [k["hash"] for k in kernels if unaligned.search(k["ir"].getvalue())] == []

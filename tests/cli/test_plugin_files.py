"""Plugins of the user: --plugin, [plugins] of a scenario, and derivatives by their numbers."""

from pathlib import Path

import numpy as np
import pytest

import mi_lcair
from mi_lcair.errors import InputError
from mi_lcair.rendering.loading.parsing import run_plugin_files

DATA = Path(__file__).parents[1] / "data"
TINTED, GLOW = DATA / "tinted.py", DATA / "glow.py"
SCENE = """<scene version="3.0.0">
  <integrator type="bounce_path"><integer name="max_bounces" value="2"/></integrator>
  <sensor type="orthographic">
    <transform name="to_world"><scale x="0.5" y="0.5"/>
      <lookat origin="0,0,5" target="0,0,0" up="0,1,0"/></transform>
    <film type="hdrfilm"><integer name="width" value="8"/><integer name="height" value="8"/>
      <string name="pixel_format" value="luminance"/></film>
  </sensor>
  <bsdf type="$kind" id="paint">$number</bsdf>
  <shape type="rectangle"><ref id="paint"/><emitter type="thermal">
    <string name="band" value="LWIR"/><float name="temperature" value="300"/></emitter></shape>
  <shape type="rectangle"><transform name="to_world"><rotate y="1" angle="-120"/>
      <translate x="1.5" z="1"/></transform>
    <bsdf type="diffuse"/>
    <emitter type="thermal"><string name="band" value="LWIR"/>
      <float name="temperature" value="400"/><string name="group" value="side"/></emitter></shape>
</scene>
"""
# A plate at 60 degrees that glows, beside a diffuse one under a sloping sky
EMITTERS = """<scene version="3.0.0">
  <integrator type="bounce_path"><integer name="max_bounces" value="1"/></integrator>
  <sensor type="orthographic">
    <transform name="to_world"><scale x="0.5" y="0.5"/>
      <lookat origin="0,0,5" target="0,0,0" up="0,1,0"/></transform>
    <film type="hdrfilm"><integer name="width" value="4"/><integer name="height" value="4"/>
      <string name="pixel_format" value="luminance"/><rfilter type="box"/></film>
  </sensor>
  <shape type="rectangle"><transform name="to_world">$place</transform>
    <bsdf type="diffuse"><spectrum name="reflectance" value="0.4"/></bsdf>$emitter</shape>$sky
</scene>
"""
PLATE = {
    "glow": (
        '<scale value="2"/><rotate y="1" angle="60"/>',
        '<emitter type="glow" id="glow"><float name="radiance" value="3"/>'
        '<float name="exponent" value="2"/></emitter>',
        '<shape type="rectangle"><transform name="to_world"><translate x="9"/></transform>'
        '<emitter type="thermal"><string name="band" value="LWIR"/>'
        '<float name="temperature" value="300"/></emitter></shape>',
    ),
    "sky": (
        '<scale value="1"/>',
        '<emitter type="thermal"><string name="band" value="LWIR"/>'
        '<float name="temperature" value="1"/></emitter>',
        '<emitter type="sloping_sky"><string name="band" value="LWIR"/>'
        '<float name="exponent" value="2"/></emitter>',
    ),
}
SCENARIO = """[target]
scene = "own.xml"
[observer]
range_m = 1000
azimuth_deg = 0
elevation_deg = 90
[atmosphere]
table = "vacuum"
[background]
temperature = 280
[sensor]
band = "LWIR"
nei = 1e-10
[render]
spp = 16
max_bounces = 2
[plugins]
files = ["tinted.py"]
"""
CAMERA = """[camera]
focal_length_mm = 500
f_number = 2
pitch_um = 15
width = 16
height = 12
integration_time_ms = 1
well_Me = 100
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with the plugin, a scene that uses it, and the same scene with Mitsuba's diffuse."""
    monkeypatch.chdir(tmp_path)
    Path("tinted.py").write_text(TINTED.read_text())
    diffuse = '<spectrum name="reflectance" value="0.3"/>'
    for name, kind, number in (
        ("own.xml", "tinted", '<float name="tint" value="0.3"/>'),
        ("diffuse.xml", "diffuse", diffuse),
    ):
        Path(name).write_text(SCENE.replace("$kind", kind).replace("$number", number))
    return tmp_path


def test_an_own_bsdf_has_the_derivatives_of_the_same_one_of_mitsuba(folder):
    run_plugin_files(["tinted.py"])
    own = mi_lcair.sensitivities("own.xml", ["paint.tint", "self.temperature"], spp=256)
    known = mi_lcair.sensitivities("diffuse.xml", ["paint.reflectance"], spp=256)
    assert own.method == ("difference", "linear")
    error = np.hypot(own.error[1], known.error[1])
    assert error < 1e-2 * abs(known.derivative[0])
    assert abs(own.derivative[0] - known.derivative[0]) < 4 * error
    parameter = mi_lcair.parameters("own.xml")["paint.tint"]
    assert parameter.kind == "plugin" and parameter.value == pytest.approx(0.3)


def test_images_of_the_derivative_are_those_of_the_same_one_of_mitsuba(folder):
    run_plugin_files(["tinted.py"])
    own = mi_lcair.derivative_images("own.xml", ["paint.tint"], spp=64)
    known = mi_lcair.derivative_images("diffuse.xml", ["paint.reflectance"], spp=64)
    assert own.method == ("difference",)
    expected = known.derivative.mean()
    assert own.derivative.mean() == pytest.approx(expected, rel=0.02) and expected < 0


def test_the_option_plugin_serves_a_budget(folder, run):
    Path("sigma.toml").write_text('[sigma]\n"paint.tint" = 0.02\n')
    result = run("budget", "own.xml", "-u", "sigma.toml", "--spp", "64", "--plugin", "tinted.py")
    assert "paint.tint" in result.stdout


def test_a_scenario_names_its_plugins(folder):
    Path("scenario.toml").write_text(SCENARIO)
    with pytest.raises(
        InputError, match=r"tinted.py' is a program.* mi_lcair.trust\('.*tinted.py'"
    ):
        mi_lcair.contrast("scenario.toml")
    mi_lcair.trust("tinted.py")
    result = mi_lcair.contrast("scenario.toml")
    assert result.rows or result.entries()


@pytest.mark.parametrize("command", ["contrast", "show", "report", "image"])
def test_a_scenario_runs_no_program_unasked(folder, run, refused, command):
    Path("scenario.toml").write_text(SCENARIO + CAMERA)
    Path("tinted.py").write_text(
        f"import pathlib\npathlib.Path({str(folder / 'ran')!r}).touch()\n" + TINTED.read_text()
    )
    output = {"image": ["-o", "a.exr"], "report": ["-o", "a.html"], "show": ["-o", "a.png"]}
    call = command, "scenario.toml", *output.get(command, [])
    message = refused(*call)
    assert "tinted.py' is a program" in message and "--plugin" in message
    assert not Path("ran").exists()
    run(*call, "--plugin", "tinted.py")
    assert Path("ran").exists()


@pytest.mark.parametrize(
    "text, message",
    [
        (None, "no Python file"),
        ("import mitsuba\nclass A(mitsuba.BSDF):\n    x = y\n", r"NameError.*\(own.py, line 3\)"),
        ("def f(:\n", "SyntaxError"),
    ],
)
def test_unusable_files_are_refused_in_one_line(tmp_path, text, message):
    file = tmp_path / "own.py"
    if text is not None:
        file.write_text(text)
    with pytest.raises(InputError, match=message) as caught:
        run_plugin_files([file])
    assert "\n" not in str(caught.value)


def test_mitsubas_other_bsdfs_have_numbers(folder):
    number = '<float name="alpha" value="0.2"/>'
    scene = Path("rough.xml")
    scene.write_text(SCENE.replace("$kind", "roughconductor").replace("$number", number))
    parameters = mi_lcair.parameters(str(scene))
    assert "paint.alpha" in parameters
    result = mi_lcair.sensitivities(str(scene), ["paint.alpha"], spp=16)
    assert np.isfinite(result.derivative[0]) and 0 < result.error[1] < np.inf


@pytest.mark.parametrize(
    "kind, derivatives",
    [
        # 3 cos(60)^2 seen directly, on 1 m^2
        ("glow", {"glow.radiance": 0.25, "glow.exponent": 0.75 * np.log(0.5)}),
        # 0.4 times the irradiance 2 pi / (n + 2), divided by pi
        ("sky", {"sky.scale": 0.2, "sky.exponent": -0.8 / 16}),
    ],
)
def test_own_emitters_have_derivatives(folder, run, kind, derivatives):
    """Closed forms, for an emitter in the style of Mitsuba's tutorial and for one of a group."""
    Path("glow.py").write_text(GLOW.read_text())
    text = EMITTERS
    for name, part in zip(("$place", "$emitter", "$sky"), PLATE[kind]):
        text = text.replace(name, part)
    Path("own_emitter.xml").write_text(text)
    run_plugin_files(["glow.py"])
    scene = mi_lcair.load("own_emitter.xml")
    assert derivatives.keys() <= mi_lcair.parameters(scene).keys()
    names = list(derivatives)
    result = mi_lcair.sensitivities(scene, names, spp=512)
    assert result.derivative == pytest.approx(list(derivatives.values()), rel=0.02)
    Path("sigma.toml").write_text("[sigma]\n" + "".join(f'"{name}" = 0.1\n' for name in names))
    command = ["budget", "own_emitter.xml", "-u", "sigma.toml", "--spp", "256"]
    printed = run(*command, "--plugin", "glow.py").stdout
    assert all(name in printed for name in names)

"""What the public functions take: a scene in every form, "1%", an atmosphere by name."""

import shutil
from pathlib import Path

import mitsuba as mi
import numpy as np
import pytest

import mi_lcair
from mi_lcair import InputError, scenes
from mi_lcair.declared import fraction
from mi_lcair.detection.scenario import Scenario
from mi_lcair.fitting.scatterometer.reading import read, read_directional
from mi_lcair.physics.atmosphere import atmosphere
from mi_lcair.rendering.scene import of_mitsuba

SMALL = {"resolution": 8, "spp": 16}
TEMPERATURE = "plate.temperature"
SIGMA = {"sigma": {TEMPERATURE: 1.0}}
FUNCTIONS = {
    "render": lambda scene, **p: mi_lcair.render(scene, **p).mean,
    "signature": lambda scene, **p: mi_lcair.signature(scene, **p).target.intensity,
    "trend": lambda scene, **p: mi_lcair.trend(scene, [0], [90], spp=4, **p).columns()[
        "intensity_W_sr"
    ][0],
    "audit": lambda scene, **p: mi_lcair.audit(scene, paths=64, **p).total["emitted"],
    "parameters": lambda scene, **p: mi_lcair.parameters(scene, **p)[TEMPERATURE],
    "sensitivities": lambda scene, **p: mi_lcair.sensitivities(
        scene, [TEMPERATURE], **p
    ).derivative[0],
    "derivative_images": lambda scene, **p: mi_lcair.derivative_images(
        scene, [TEMPERATURE], **p
    ).radiance.mean(),
    "budget": lambda scene, **p: mi_lcair.budget(scene, SIGMA, **p).value,
}


@pytest.fixture
def scene():
    return mi_lcair.load("two_plates", **SMALL)


@pytest.fixture
def plain():
    """The same scene as Mitsuba loads it: its parameters are those of the file."""
    texts = {name: str(value) for name, value in SMALL.items()}
    return mi.load_file(str(scenes.path("two_plates")), optimize=False, **texts)


# Scenes
# ------------------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("name", FUNCTIONS)
def test_functions_take_a_scene_in_every_form(name, scene, plain):
    function, path = FUNCTIONS[name], scenes.path("two_plates")
    expected = function(scene)
    for form in (path, str(path)) if name == "render" else ("two_plates",):
        assert function(form, parameters=SMALL) == expected
    assert function(plain) == pytest.approx(expected, rel=1e-6) if name != "parameters" else True
    with pytest.raises(InputError, match=r"the scene is loaded, so that its \$-parameters \(spp\)"):
        function(scene, parameters={"spp": 4})
    with pytest.raises(InputError, match="unknown bundled scene 'two_plats'; known: two_plates"):
        function("two_plats")


def test_a_scene_of_mitsuba(plain):
    scene = mi_lcair.load(plain)
    assert (scene.mi, scene.path, scene.parameters) == (plain, None, {})
    assert (scene.band.name, scene.groups) == ("total", ["other", "plate"])
    assert scene.fingerprint == mi_lcair.load(plain).fingerprint
    with pytest.raises(InputError, match=r"its \$-parameters \(spp\) are set; mi.load_file takes"):
        mi_lcair.load(plain, spp=4)


def test_a_changed_scene_of_mitsuba_is_another_scene(plain):
    """Nothing is kept by the identity of Mitsuba's object."""
    before, old = mi_lcair.load(plain).fingerprint, mi_lcair.signature(plain, spp=16)
    parameters = mi.traverse(plain)
    parameters["emitter.emitter.temperature"] = 400.0
    parameters.update()
    new = mi_lcair.signature(plain, spp=16)
    assert new.target.intensity == pytest.approx(old.target.intensity / 16, rel=1e-5)
    assert mi_lcair.load(plain).fingerprint != before


def test_equal_scenes_of_mitsuba_have_one_fingerprint(plain):
    path = str(scenes.path("two_plates"))
    texts = {name: str(value) for name, value in SMALL.items()}
    same = mi.load_file(path, optimize=False, **texts)
    more = mi.load_file(path, optimize=False, **texts | {"max_bounces": "2"})
    prints = [of_mitsuba(loaded).fingerprint for loaded in (plain, same, more)]
    assert prints[0] == prints[1] != prints[2]


def test_a_scene_of_mitsuba_with_another_integrator():
    loaded = mi.load_dict(
        {"type": "scene", "integrator": {"type": "path"}, "sensor": {"type": "orthographic"}}
    )
    with pytest.raises(
        InputError, match="must be bounce_path, not PathIntegrator: <integrator type=.*mi.load_dict"
    ):
        mi_lcair.render(loaded)


@pytest.mark.parametrize("other", [None, 3, {"type": "scene"}])
def test_what_is_no_scene(other):
    with pytest.raises(InputError, match="is no scene; give a Scene, the name of a bundled scene"):
        mi_lcair.render(other)


def test_a_shape_is_no_scene(scene):
    with pytest.raises(InputError, match="Mesh is no scene"):
        mi_lcair.signature(scene.mi.shapes()[0])


# Tolerances, atmospheres
# ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("text, value", [("1%", 0.01), ("0.5 %", 0.005), ("0.02", 0.02)])
def test_fractions(text, value):
    assert fraction(text) == value
    assert fraction(value) == value


@pytest.mark.parametrize("text", ["", "%", "1 percent", "100%", "0", "-1%", "1%%", "nan"])
def test_what_is_no_fraction(text):
    with pytest.raises(InputError, match="is not a fraction between 0 and 1, such as 0.01 or 1%"):
        fraction(text)


@pytest.mark.parametrize("name", ["render", "signature", "trend", "sensitivities"])
def test_tolerances_in_percent(name, scene):
    function = {
        "render": mi_lcair.render,
        "signature": mi_lcair.signature,
        "trend": lambda scene, **options: mi_lcair.trend(scene, [0], [90], **options),
        "sensitivities": lambda scene, **o: mi_lcair.sensitivities(scene, [TEMPERATURE], **o),
    }[name]
    values = lambda tolerance: str(vars(function(scene, tolerance=tolerance)).get("paths"))
    assert values("3%") == values(0.03)
    with pytest.raises(InputError, match="'3 per cent' is not a fraction"):
        function(scene, tolerance="3 per cent")


def test_atmospheres_by_name_and_path(scene, tmp_path):
    air = atmosphere("midlat_summer")
    path, file = air.path(1000.0), tmp_path / "air.csv"
    columns = path.wavelengths_um, path.transmittance, path.radiance
    file.write_text(
        "range_km,wavelength_um,transmittance,path_radiance_W_m2_sr_um\n"
        + "".join("1,{!r},{!r},{!r}\n".format(*map(float, row)) for row in zip(*columns))
    )
    view = mi_lcair.load("two_plates", **SMALL, band="LWIR")
    images = [
        mi_lcair.render(view, atmosphere=own, range_m=1000.0).channels["apparent.Y"]
        for own in (air, "midlat_summer", file, str(file))
    ]
    assert all(np.allclose(image, images[0], rtol=1e-5) for image in images[1:])
    with pytest.raises(InputError, match="unknown atmosphere 'midlat_sumer'; known: midlat_summer"):
        mi_lcair.render(view, atmosphere="midlat_sumer")


# Scenarios and measurements
# ------------------------------------------------------------------------------------------------

QUICK = {"render.resolution": 8, "render.max_bounces": [1]}
SCENARIO = "a340_landing/position_1"


@pytest.mark.slow
def test_scenarios_take_changes():
    read = Scenario.read(SCENARIO, **QUICK, **{"render.spp": 4, "sensor.band": "LWIR"})
    given = mi_lcair.contrast(SCENARIO, parameters=QUICK | {"sensor.band": "LWIR"}, spp=4)
    assert given.as_dict()["rows"] == mi_lcair.contrast(read).as_dict()["rows"]
    with pytest.raises(InputError, match="is already read, so that render.spp cannot be changed"):
        mi_lcair.contrast(read, spp=4)
    with pytest.raises(InputError, match="spp sets a fixed number of samples; tolerances"):
        mi_lcair.contrast(SCENARIO, spp=4, tolerance="1%")
    assert Scenario.read(SCENARIO, **{"render.tolerance": 0.05}).render.tolerance == 0.05
    with pytest.raises(InputError, match="'5 percent' is not a fraction"):
        mi_lcair.contrast(SCENARIO, tolerance="5 percent")
    with pytest.raises(InputError, match=r"has no table \[camera\]"):
        mi_lcair.image(SCENARIO, parameters=QUICK, spp=4)


@pytest.mark.slow
def test_budget_of_a_scenario_takes_sampling():
    uncertain = {"sigma": {"plume.temperature": 5.0}}
    budget = mi_lcair.budget(SCENARIO, uncertain, parameters=QUICK, spp=4)
    read = Scenario.read(SCENARIO, **QUICK, **{"render.spp": 4})
    assert budget.value == mi_lcair.budget(read, uncertain).value
    with pytest.raises(InputError, match="sensor is one of a scene; a scenario has its observer"):
        mi_lcair.budget(SCENARIO, uncertain, sensor=1)
    with pytest.raises(InputError, match="is already read"):
        mi_lcair.budget(read, uncertain, spp=4)


@pytest.mark.slow
def test_fit_takes_files(tmp_path):
    paint = tmp_path / "paint.csv"
    rows = [
        (source, observer, 0.1 + 0.4 * np.exp(-(((observer - source) / 8) ** 2)))
        for source in (20, 40, 60)
        for observer in range(0, 80, 4)
    ]
    paint.write_text(
        "# band_um: 8 12\n# theta_r_positive: specular\ntheta_i_deg,theta_r_deg,brdf\n"
        + "".join(f"{source},{observer},{value:.6g}\n" for source, observer, value in rows)
    )
    shine = tmp_path / "shine.csv"
    shine.write_text("theta_deg,emissivity\n0,0.6\n30,0.6\n60,0.55\n")
    options = {"model": "sandford_robertson", "form": "thesis", "starts": 4}
    files = mi_lcair.fit(str(paint), emissivity=shine, **options)
    data = mi_lcair.fit(read(paint), emissivity=read_directional(shine, "emissivity"), **options)
    assert files.parameters == data.parameters
    with pytest.raises(InputError, match="no_such.csv"):
        mi_lcair.fit(tmp_path / "no_such.csv")


def test_the_folder_of_an_import_is_its_scene(tmp_path, monkeypatch):
    """A folder with the name of a bundled scene does not stand for it."""
    for name in ("own", "cavity"):
        (tmp_path / name).mkdir()
        shutil.copy(scenes.path("two_plates"), tmp_path / name / "scene.xml")
    monkeypatch.chdir(tmp_path)
    for folder in ("own", Path("own")):
        assert scenes.file_of(folder) == Path("own/scene.xml")
    with pytest.raises(InputError, match="': is a folder without scene.xml; name the scene's file"):
        scenes.file_of(tmp_path)
    assert scenes.file_of("cavity") == scenes.path("cavity")


@pytest.mark.parametrize(
    "name, reason",
    [
        ("box.obj", "it is a model, of which mi-lcair import makes a scene"),
        ("box.toml", "a scenario is for contrast, image and budget"),
    ],
)
def test_files_of_another_kind(name, reason):
    with pytest.raises(InputError, match=f"{name}' is no scene: {reason}"):
        mi_lcair.load(scenes.FOLDER / "examples" / name)


@pytest.mark.parametrize(
    "what, reason",
    [
        ("cavity", "'cavity' is a scene and no scenario"),
        ("own/scene.xml", "'own/scene.xml' is a scene and no scenario"),
        ("box.obj", "'box.obj' is a model and no scenario"),
        (3, "int is no scenario; a scenario is a TOML file"),
    ],
)
def test_a_scene_is_no_scenario(what, reason):
    with pytest.raises(InputError, match=reason):
        mi_lcair.contrast(what)


@pytest.mark.parametrize(
    "name, given, message",
    [
        (
            "cavity",
            {"opening": "wide"},
            "file not found; parameter opening = wide: number of facets",
        ),
        ("cavity", {"resolution": 2.5}, 'value "2.5"; parameter resolution = 2.5: pixels along'),
        ("furnace", {"temperature": "300 K"}, 'value "300 K"; parameter temperature = 300 K: temp'),
    ],
)
def test_a_value_of_a_parameter_that_mitsuba_cannot_use(name, given, message):
    """What the file does with a parameter is no matter of its user."""
    with pytest.raises(InputError, match=message):
        mi_lcair.load(name, **given)


def test_a_parameter_of_a_file_has_no_description(tmp_path):
    shutil.copy(scenes.path("two_plates"), tmp_path / "own.xml")
    with pytest.raises(InputError, match=r'value "x"; parameter resolution = x$'):
        mi_lcair.load(tmp_path / "own.xml", resolution="x", spp=3)


def test_no_temperature_and_no_image():
    with pytest.raises(InputError, match="^'37C' is no temperature in K, such as 310.4, and no"):
        mi_lcair.temperature("37C", band="LWIR", emissivity=1)


@pytest.mark.parametrize("value", [1, 5.0, False])
def test_a_number_that_may_be_in_percent(value, scene):
    """5 for 5 % would otherwise be reached by any render."""
    with pytest.raises(InputError, match=f"^{value} is not a fraction between 0 and 1, such as"):
        mi_lcair.signature(scene, tolerance=value)


@pytest.mark.parametrize("angles", ["0:360:90", 30, [None]])
def test_angles_of_a_trend(angles, scene):
    for given in ({"azimuths_deg": angles}, {"azimuths_deg": [0], "elevations_deg": angles}):
        with pytest.raises(
            InputError, match=f"^{list(given)[-1]} = .* is not a sequence of angles"
        ):
            mi_lcair.trend(scene, **given)


def test_one_name_without_brackets(scene):
    with pytest.raises(InputError, match=r"one text; give a sequence of names: \['plate"):
        mi_lcair.sensitivities(scene, TEMPERATURE)
    with pytest.raises(InputError, match="^names = 3 must be a sequence such as"):
        mi_lcair.sensitivities(scene, 3)

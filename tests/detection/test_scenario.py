"""Tests of scenarios: their defaults, changes by key, and the message for each mistake."""

from pathlib import Path

import numpy as np
import pytest

from mi_lcair import scenes
from mi_lcair.detection.flight_path import Moments
from mi_lcair.detection.scenario import (
    Background,
    RenderTable,
    Scenario,
    TargetModel,
    in_folder,
    placed,
)
from mi_lcair.errors import InputError
from tests.detection.disc_scenario import TOML


@pytest.fixture
def written(tmp_path):
    def write(text):
        (tmp_path / "my.toml").write_text(text)
        return tmp_path / "my.toml"

    return write


def test_heading(written):
    """Its name and the first comment, or the name alone."""
    assert Scenario.read(written(TOML)).heading == "my: A disc."
    bare = "\n".join(line for line in TOML.splitlines() if not line.startswith("#"))
    assert Scenario.read(written(bare)).heading == "my"


def test_defaults(written, tmp_path):
    scenario = Scenario.read(written(TOML))
    assert (scenario.name, scenario.title, scenario.target.scene) == (
        "my",
        "A disc.",
        str(tmp_path / "disc.xml"),
    )
    assert (
        scenario.render.max_bounces,
        scenario.render.resolution,
        scenario.render.spp,
        scenario.render.seed,
    ) == ((), 256, 64, 0)
    assert (
        scenario.atmosphere.table == "vacuum"
        and scenario.observer.range_m == 1000.0
        and scenario.scene_parameters() == {}
    )
    assert scenario.sensor.detector().snr == 10 and scenario.sensor.detector().nei is None


def test_files_lie_beside_the_scenario_and_those_of_changes_beside_the_caller(
    written, tmp_path, monkeypatch
):
    (tmp_path / "tape7").write_text("")
    (tmp_path / "skin.json").write_text("")
    (tmp_path / "r.csv").write_text("wavelength_um,response\n3.5,0\n4,1\n4.5,0\n")
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    text = (
        TOML.replace('"vacuum"', '"tape7"').replace(
            'band = "MWIR"', 'band = "MWIR"\nresponse = "r.csv"'
        )
        + '[target.parameters]\nfinish = "skin.json"\nsky = "midlat_summer_clear"\nflag = '
        "true\ncount = 3\n"
    )
    scenario = Scenario.read(written(text), **{"background.sky": "here.csv"})
    assert scenario.atmosphere.table == str(tmp_path / "tape7") and scenario.sensor.response == str(
        tmp_path / "r.csv"
    )
    assert scenario.scene_parameters() == {
        "finish": str(tmp_path / "skin.json"),
        "sky": "midlat_summer_clear",
        "flag": "true",
        "count": "3",
    }
    assert scenario.background.sky == "here.csv" and scenario.background.temperature is None


def test_position_and_pose(written):
    scenario = Scenario.read(
        written(TOML),
        **{
            "observer.position_m": "[-1000, 500, -50]",
            "pose.pitch_deg": 10,
            "target.parameters.finish": "copper",
        },
    )
    assert scenario.observer.range_m == pytest.approx(np.sqrt(1000**2 + 500**2 + 50**2))
    assert (scenario.observer.azimuth_deg, scenario.observer.elevation_deg) == pytest.approx(
        (153.434949, -2.560639)
    )
    assert scenario.scene_parameters() == {"finish": "copper", "pitch_deg": "10.0"}


def test_changes_are_toml_or_text(written):
    scenario = Scenario.read(
        written(TOML),
        **{
            "sensor.band": "LWIR",
            "render.max_bounces": "[1, 4]",
            "sensor.nei": "1e-6",
            "observer.range_m": np.float64(700),
            "atmosphere.extrapolate": "true",
        },
    )
    assert (
        scenario.sensor.band,
        scenario.render.max_bounces,
        scenario.sensor.nei,
        scenario.atmosphere.extrapolate,
    ) == ("LWIR", (1, 4), 1e-6, True)
    assert Scenario.read(
        written(TOML), **{"sensor.band": "3-5", "render.max_bounces": 2}
    ).render.max_bounces == (2,)


def test_a_tolerance_instead_of_a_number_of_samples(written):
    text = TOML + "[render]\nspp = 8\n"
    render = Scenario.read(written(text), **{"render.tolerance": 0.02}).render
    assert (render.spp, render.tolerance, render.has_tolerance) == (None, 0.02, True)
    assert render.allowed(-5) == 0.02 * 5
    both = Scenario.read(
        written(text), **{"render.tolerance": 0.02, "render.tolerance_W_m2": 1}
    ).render
    assert both.allowed(5) == 1 and both.allowed(500) == 10
    with pytest.raises(InputError, match="spp and tolerance_W_m2 cannot be combined"):
        Scenario.read(written(text + "tolerance_W_m2 = 1e-8\n"))
    fixed = Scenario.read(written(TOML + "[render]\ntolerance = 0.1\n"), **{"render.spp": 8})
    assert (fixed.render.spp, fixed.render.tolerance) == (8, None)
    assert not fixed.render.has_tolerance and fixed.render.allowed(5) == 0


@pytest.mark.slow
@pytest.mark.parametrize(
    "changes, message",
    [
        ({"sensor.bnad": "LWIR"}, r"unknown key of \[sensor\] 'bnad'; known: band"),
        ({"senzor.band": "LWIR"}, "unknown table 'senzor'; known: sensor"),
        ({"render": 3}, "render is no entry; name TABLE.KEY"),
        ({"sensor.band.x": 3}, "'band' is not a table"),
        ({"observer.range_m": 0}, r"\[observer\]: range_m = 0; must be positive"),
        ({"observer.range_m": -5}, "range_m = -5; must be positive"),
        ({"observer.range_m": "nan"}, r"\[observer\]: range_m = nan; must be a finite number"),
        ({"observer.range_m": "far"}, "range_m = 'far'; must be a finite number"),
        ({"observer.elevation_deg": 91}, "elevation_deg = 91; must lie in -90..90"),
        ({"observer.position_m": "[1, 2]"}, "position_m = .*; give 3 numbers"),
        ({"observer.position_m": "[0, 0, 0]"}, "range_m = 0; must be positive"),
        ({"observer.height_m": 100_001}, "height_m = 100001; must lie in 0..100000"),
        ({"background.sun_elevation_deg": 0.9}, "sun_elevation_deg = 0.9; must lie in 1..90"),
        ({"background.sun_elevation_deg": 91}, "sun_elevation_deg = 91; must lie in 1..90"),
        ({"background.ground_emissivity": 1.2}, "ground_emissivity = 1.2; must be positive"),
        ({"sensor.nei": -1}, "nei = -1"),
        ({"sensor.nei": 1e-310}, "nei = 1e-310; must be 0, or of a size within 1e-30..1e.12"),
        ({"observer.range_m": 1e300}, "range_m = 1e.300; must be 0, or of a size within"),
        ({"observer.range_m": 10**400}, "range_m = 10.* ... .*; must be a finite number"),
        ({"sensor.snr": 0}, "snr = 0"),
        ({"sensor.optics_transmittance": 1.5}, "optics_transmittance = 1.5"),
        ({"sensor.field_of_view_deg": "inf"}, "must be a finite number"),
        ({"sensor.band": "total"}, "band total has no wavelengths"),
        ({"sensor.band": "MWR"}, "unknown band 'MWR'; known: MWIR"),
        ({"sensor.band": 4}, r"\[sensor\]: band = 4; must be a text"),
        ({"sensor.response": "one_row.csv"}, "needs two rows"),
        ({"sensor.response": "wide.csv"}, "response wide 2-9 um is not within band MWIR 3-5 um"),
        ({"sensor.response": "none.csv"}, "No such file"),
        ({"sensor.band": "wide.csv"}, "is a response; give it as response"),
        ({"background.temperature": 0}, "temperature = 0 K; must be positive"),
        ({"atmosphere.extrapolate": 1}, "extrapolate = 1; must be true or false"),
        ({"render.spp": 1}, "spp = 1; must lie in 2.."),
        ({"render.tolerance": 0}, "tolerance: '0.0' is not a fraction between 0 and 1"),
        ({"render.tolerance": 1.5}, "tolerance: '1.5' is not a fraction"),
        ({"render.tolerance": "1 W"}, "tolerance: '1 W' is not a fraction"),
        ({"render.tolerance_W_m2": -1.0}, "tolerance_W_m2 = -1; must be positive"),
        ({"render.tolerance": 0.1, "render.max_spp": 1}, "max_spp = 1; must lie in 2.."),
        ({"render.max_spp": 8}, "max_spp needs tolerance, tolerance_W_m2 or to_noise"),
        ({"render.max_bounces": "[]"}, r"max_bounces = \[\]; give at least one number"),
        ({"render.max_bounces": "[1, -1]"}, "max_bounces = -1; must lie in 0..10000"),
        ({"render.max_bounces": "[1, 2.5]"}, "max_bounces = 2.5; must be a whole number"),
        ({"render.resolution": 0}, "resolution = 0"),
        ({"render.spp": 2**31 + 1}, "spp = 2147483649; must lie in 2..2147483648"),
        ({"atmosphere.humidity": 0.5}, "humidity is weather of a clear air, but table = 'vacuum'"),
        ({"render.seed": 2**32}, "seed = 4294967296"),
        ({"target.parameters.band": "LWIR"}, r"band is given in \[sensor\]"),
        ({"target.parameters.pitch_deg": 4}, r"pitch_deg is given in \[pose\]"),
        ({"target.parameters.size": "[1, 2]"}, "must be a text or a number"),
    ],
)
def test_mistakes(written, tmp_path, monkeypatch, changes, message):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "one_row.csv").write_text("wavelength_um,response\n4,1\n")
    (tmp_path / "wide.csv").write_text("wavelength_um,response\n2,1\n9,1\n")
    with pytest.raises(InputError, match=message) as error:
        Scenario.read(written(TOML), **changes)
    assert str(error.value).startswith(f"scenario '{tmp_path / 'my.toml'}': ") and "\n" not in str(
        error.value
    )


@pytest.mark.parametrize(
    "left_out, message",
    [
        ('scene = "disc.xml"\n', r"\[target\]: scene is missing"),
        (
            "azimuth_deg = 0\n",
            "azimuth_deg is missing; give range_m, azimuth_deg and elevation_deg, or position_m",
        ),
        ('table = "vacuum"\n', r"\[atmosphere\]: table is missing"),
        ('[atmosphere]\ntable = "vacuum"\n', r"\[atmosphere\]: table is missing"),
        ("temperature = 294\n", "sky and temperature are missing; give one"),
        ('band = "MWIR"\n', r"\[sensor\]: band is missing"),
    ],
)
def test_what_is_missing(written, left_out, message):
    with pytest.raises(InputError, match=message):
        Scenario.read(written(TOML.replace(left_out, "")))


@pytest.mark.parametrize(
    "extra, message",
    [
        ("temperature = 294", "temperature and sky cannot be combined; give one"),
        ("= 4", "Invalid|Expected"),
        ("[observer]\nposition_m = [1, 2, 3]", "Cannot declare|twice"),
    ],
)
def test_what_is_too_much(written, extra, message):
    with pytest.raises(InputError, match=message):
        Scenario.read(
            written(TOML.replace("temperature = 294", f'sky = "us_standard_clear"\n{extra}'))
        )
    placed = TOML.replace(
        "range_m = 1000\nazimuth_deg = 0\nelevation_deg = 0\n", "position_m = [30, 40, 0]\n"
    )
    assert Scenario.read(written(placed)).observer.range_m == 50
    polar = {"observer.range_m": 7, "observer.azimuth_deg": 1, "observer.elevation_deg": 2}
    assert Scenario.read(written(placed), **polar).observer.range_m == 7
    with pytest.raises(InputError, match="azimuth_deg is missing"):
        Scenario.read(written(placed), **{"observer.range_m": 7})
    with pytest.raises(InputError, match="position_m and range_m cannot be combined"):
        Scenario.read(written(TOML.replace("[atmosphere]", "position_m = [1, 2, 3]\n[atmosphere]")))


def test_no_such_file(tmp_path):
    with pytest.raises(InputError, match="No such file"):
        Scenario.read(tmp_path / "none.toml")
    with pytest.raises(
        InputError,
        match="unknown scenario 'a340_landing/position1'; known: a340_landing/position_1",
    ):
        Scenario.read("a340_landing/position1")


def test_bundled():
    names = ("approach", "position_1", "position_2", "position_3")
    known = [f"a340_landing/{name}" for name in names]
    assert scenes.scenarios() == scenes.scenarios("a340_landing") == known
    assert scenes.scenarios("cavity") == []
    for name in scenes.scenarios():
        scenario = Scenario.read(name)
        assert (
            scenario.name == name
            and scenario.title == scenes.scenario_title(name)
            and scenario.target.scene == name.partition("/")[0]
        )


@pytest.mark.parametrize(
    "sun,located",
    [
        ("45,60,sun.csv", "45,60,/scenes/sun.csv"),
        ("45,60,low, red.csv", "45,60,/scenes/low, red.csv"),
        ("45.5,60", None),
        ("45", None),
    ],
)
def test_the_file_of_a_sun_is_beside_the_scenario(sun, located):
    table = {"sun": sun, "sky": "sky.csv"}
    table = in_folder("surroundings", table, Path("/scenes"))
    assert table == {"sun": located or sun, "sky": "/scenes/sky.csv"}


def test_backgrounds_by_day(tmp_path):
    """A sky by day is one with scattered sunlight, or a table with azimuths from the sun."""
    header = "elevation_deg,azimuth_deg,wavelength_um,radiance_W_m2_sr_um"
    rows = [f"5,{azimuth},{x},1" for azimuth in (0, 90) for x in (3, 4)]
    (tmp_path / "sky.csv").write_text("\n".join([header, *rows]))
    ground = {"ground_temperature": 290.0, "ground_emissivity": 0.9, "sun_elevation_deg": 1.0}
    assert Background(daytime_sky="us_standard", **ground).by_day
    assert Background(sky=str(tmp_path / "sky.csv"), **ground).by_day
    assert not Background(sky="us_standard_clear", **ground).by_day
    assert not Background(ground_temperature=290.0).by_day
    for missing in ({"sky": "us_standard_clear"}, {"ground_temperature": 290.0}):
        with pytest.raises(InputError, match="ground_emissivity needs "):
            Background(**missing, ground_emissivity=0.9)


@pytest.mark.parametrize(
    "words, message",
    [
        ('ground = "warm"', "ground warm: must be KELVIN"),
        ('sky = "cloudy"', "unknown sky table 'cloudy'"),
        ('sky = "overcast"\nsun = "30"', "an overcast sky hides the sun"),
        ('sun = "30"', "sky and ground are missing"),
    ],
)
def test_a_mistake_in_surroundings_names_their_table_once(written, words, message):
    text = TOML.replace("[background]\ntemperature = 294\n", f"[surroundings]\n{words}\n")
    with pytest.raises(InputError) as error:
        Scenario.read(written(text))
    assert f": [surroundings]: {message}" in str(error.value)


def test_ground_of_surroundings_without_a_sky_is_black(written):
    text = TOML.replace("[background]\ntemperature = 294\n", '[surroundings]\nground = "280,0.8"\n')
    background = Scenario.read(written(text)).background
    assert (background.ground_temperature, background.ground_emissivity) == (280.0, 1.0)
    text = text.replace('ground = "280,0.8"', 'ground = "280,0.8"\nsky = "250"')
    assert Scenario.read(written(text)).background.ground_emissivity == 0.8


@pytest.mark.parametrize("air", ["midlat_summer", "us_standard", "vacuum"])
def test_the_clear_air_of_the_path_is_that_of_the_sky(air, written):
    text = TOML.replace("[background]\ntemperature = 294\n", '[surroundings]\nsky = "clear"\n')
    changes = {"atmosphere.table": air}
    assert Scenario.read(written(text), **changes).surroundings.atmosphere == (
        "us_standard" if air == "vacuum" else air
    )
    changes["surroundings.atmosphere"] = "us_standard"
    assert Scenario.read(written(text), **changes).surroundings.atmosphere == "us_standard"


def test_a_scene_is_no_scenario():
    for source in ("my.xml", "cavity"):
        with pytest.raises(InputError, match="is a scene and no scenario"):
            Scenario.read(source)


def test_samples_of_an_image():
    assert RenderTable(spp=8).of_image().spp == 8
    assert RenderTable(tolerance_W_m2=1e-9).of_image().spp == 64
    to_noise = RenderTable(to_noise=True, max_spp=128).of_image()
    assert (to_noise.spp, to_noise.tolerance, to_noise.max_spp) == (None, None, 128)
    assert RenderTable(spp=8).of_render().spp == 8
    with pytest.raises(InputError, match="to_noise chooses the samples of a camera's image only"):
        RenderTable(to_noise=True).of_render()


def test_one_moment_of_a_flight():
    """Heights above the ground; angles that are 0 at all moments are no parameters."""
    moments = Moments(
        time_s=np.array([0.0, 1.0]),
        position_m=np.array([[0.0, 1.0, 500.0], [3.0, 4.0, 620.0]]),
        attitude_deg=np.array([[10.0, 0.0, 0.0], [0.0, 0.0, 5.0]]),
        observer_m=np.array([[10.0, 1.0, 500.0], [3.0, -16.0, 620.0]]),
        ground_m=120.0,
        temperatures={},
    )
    parts = placed(TargetModel("cavity"), moments, 1)
    assert parts["target"].height_m == 500
    assert (parts["observer"].range_m, parts["observer"].azimuth_deg) == (20, -90)
    pose = parts["pose"]
    assert (pose.yaw_deg, pose.pitch_deg, pose.roll_deg) == (0.0, None, 5.0)


def test_plugins_and_parameters_of_motions(written, tmp_path):
    """Files of plugins lie beside the scenario; the name of a parameter may have a dot."""
    text = TOML + '[plugins]\nfiles = ["own.py"]\n'
    changes = {"target.parameters.model.yaw_deg": 20, "render.resolution": 1}
    scenario = Scenario.read(written(text), **changes)
    assert list(scenario.plugins.files) == [str(tmp_path / "own.py")]
    assert scenario.target.parameters == {"model.yaw_deg": 20}
    assert scenario.render.resolution == 1

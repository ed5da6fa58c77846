"""[surroundings] of a scenario: what the target reflects, and what is behind it."""

import numpy as np
import pytest

from mi_lcair.api.scenarios import contrast
from mi_lcair.detection.contrast import unlit_sky
from mi_lcair.detection.setting import setting_of
from mi_lcair.errors import InputError
from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.physics.surroundings import SunlitTable
from tests.detection.disc_scenario import AREA, disc, write_disc
from tests.physics.surroundings.test_sunlit_table import SUN, WAVELENGTHS, write

MWIR = band("MWIR")
EMISSIVITY = 0.6


@pytest.fixture
def folder(tmp_path):
    """The disc, grey, in a scenario without a background."""
    file = write_disc(tmp_path)
    text = (tmp_path / "disc.xml").read_text()
    (tmp_path / "disc.xml").write_text(text.replace('"blackbody"', f'"{EMISSIVITY}"'))
    file.write_text(file.read_text().replace("[background]\ntemperature = 294\n", ""))
    return tmp_path


def radiance(temperature):
    return float(in_band_radiance(MWIR, temperature))


@pytest.mark.parametrize("elevation, behind", [(10, 300.0), (-10, 250.0)])
def test_contrast_between_sky_and_ground(folder, elevation, behind):
    """An upright diffuse disc reflects half of the sky and half of the ground."""
    words = {"surroundings__sky": 250, "surroundings__ground": 300}
    scenario = disc(folder, **words, observer__elevation_deg=elevation, render__spp=256)
    (row,) = contrast(scenario).rows
    around = (radiance(250.0) + radiance(300.0)) / 2
    seen = EMISSIVITY * radiance(400.0) + (1 - EMISSIVITY) * around
    area = AREA * np.cos(np.radians(elevation))
    expected = (seen - radiance(behind)) * area / 1000**2
    assert row.total.value == pytest.approx(expected, rel=3e-3)


@pytest.mark.parametrize(
    "words, background",
    [
        ({"sky": "clear"}, {"sky": "us_standard_clear"}),
        ({"sky": "overcast", "atmosphere": "midlat_summer"}, {"sky": "midlat_summer_stratus"}),
        (
            {"sky": "clear", "sun": [40, 20]},
            {"daytime_sky": "us_standard", "sun_elevation_deg": 40, "sun_azimuth_deg": 20},
        ),
        (
            {"sky": "clear", "ground": [300, 0.7]},
            {"sky": "us_standard_clear", "ground_temperature": 300, "ground_emissivity": 0.7},
        ),
    ],
)
def test_they_are_the_background(folder, words, background):
    """What is behind the target is what [background] with the same sky and ground would be."""
    place = {"atmosphere__table": "us_standard", "observer__elevation_deg": -12}
    if "ground" in words:
        place |= {"observer__elevation_deg": 12, "target__height_m": 200}
    x = np.linspace(3.2, 4.8, 7)
    found, expected = (
        setting_of(disc(folder, **place, **{f"{table}__{key}": v for key, v in given.items()}))
        for table, given in (("surroundings", words), ("background", background))
    )
    at = [setting.backdrop.at_sensor(1000.0).at(x) for setting in (found, expected)]
    np.testing.assert_allclose(*at, rtol=1e-12)
    assert found.sun == expected.sun


@pytest.mark.parametrize("azimuth", [0, 200])
def test_a_sky_by_azimuth_is_behind_the_target(folder, azimuth):
    """The sensor looks away from its own azimuth, and the table counts from the sun's."""
    file, place = write(folder / "sky.csv", azimuths=(0, 40, 180)), {"observer__elevation_deg": -12}
    place |= {"observer__azimuth_deg": azimuth, "atmosphere__table": "us_standard"}
    behind = {"sun_azimuth_deg": 25, "sun_elevation_deg": SUN}
    expected = SunlitTable(file, SUN).at(12, azimuth + 180 - 25).at(WAVELENGTHS)
    for table, given in (
        ("surroundings", {"sky": file, "sun": [SUN, 25]}),
        ("background", {"sky": file, **behind}),
    ):
        given = {f"{table}__{key}": value for key, value in given.items()}
        setting = setting_of(scenario := disc(folder, **place, **given))
        values = setting.backdrop.at_sensor(1000.0).at(WAVELENGTHS)
        np.testing.assert_allclose(values, expected, rtol=1e-9)
        assert not unlit_sky(setting.view, scenario, setting.detector)


def test_emitters_replace_those_of_the_scene(folder):
    """The sky and the sun of the scene give way; the new ones are at the target's height."""
    text = (folder / "disc.xml").read_text()
    own = (
        '<emitter type="sky"> <string name="sky" value="200"/> <string name="band" value="$band"/>'
    )
    (folder / "disc.xml").write_text(text.replace("</scene>", f"{own} </emitter> </scene>"))
    words = {"surroundings__sky": "clear", "surroundings__sun": [30, 10]}
    words |= {"target__height_m": 4000, "atmosphere__table": "us_standard"}
    setting = setting_of(disc(folder, **words, observer__elevation_deg=-5))
    sky = next(e for e in setting.view.mi.emitters() if e.group == "sky")
    assert (sky.values["sky"], sky.height_m) == ("clear", pytest.approx(4000, abs=100))
    assert sorted(setting.view.groups) == ["self", "sky", "sun"]


@pytest.mark.parametrize(
    "changes, message",
    [
        ({"surroundings__sky": "clear", "background__temperature": 290}, "give one of them"),
        ({"surroundings__sun": 30}, "sky and ground are missing"),
        ({"surroundings__sky": "clear", "surroundings__ground": "288,3"}, "must lie in 0..1"),
        ({"surroundings__sky": "clear", "surroundings__height": 3}, "unknown key"),
        ({"surroundings__sky": True}, "must be a text"),
        ({}, "\\[background\\]: sky and temperature are missing"),
    ],
)
def test_bad_words(folder, changes, message):
    with pytest.raises(InputError, match=message):
        disc(folder, **changes)


def test_a_scene_with_its_own_sky(folder):
    text = (folder / "disc.xml").read_text()
    (folder / "disc.xml").write_text(
        text.replace(
            "</scene>",
            '<shape type="rectangle"> <bsdf type="diffuse"/> <emitter type="thermal"> <string '
            'name="band" value="$band"/> <float name="temperature" value="250"/> <string '
            'name="facet_type" value="sky"/> </emitter> </shape> </scene>',
        )
    )
    with pytest.raises(InputError, match="already has sky facets"):
        setting_of(disc(folder, surroundings__sky="clear", observer__elevation_deg=-5))


def test_a_sky_that_does_not_cover_the_band(folder):
    rows = "".join(f"{8 + k / 20},1\n" for k in range(81))
    (folder / "sky.csv").write_text(f"wavelength_um,radiance_W_m2_sr_um\n{rows}")
    with pytest.raises(InputError, match="does not cover band MWIR"):
        setting_of(disc(folder, surroundings__sky=str(folder / "sky.csv")))

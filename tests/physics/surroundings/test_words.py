"""Surroundings in words: what they mean, and words that mean nothing."""

import numpy as np
import pytest

from mi_lcair.errors import InputError
from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.physics.surroundings.words import Words

LWIR = band("LWIR")


def test_emitters():
    words = Words(sky="clear", ground="288,0.95", sun="40,120", atmosphere="midlat_summer")
    sky, sun = words.emitters("LWIR")
    assert (sky["sky"], sky["ground_temperature"], sky["ground_material"]) == ("clear", 288, "0.95")
    assert (sky["sun_elevation_deg"], sky["sun_azimuth_deg"], sun["azimuth_deg"]) == (40, 120, 120)
    assert sky["atmosphere"] == sun["air"] == "midlat_summer"
    (night,) = Words(ground="300,gloss_black").emitters("LWIR")
    assert (night["sky"], night["ground_material"]) == ("none", "gloss_black")


def test_at_height():
    around = Words(sky="270", ground="300,0.9").at_height(None)
    sky, ground = around.in_band_radiance(LWIR, [20.0, -20.0])
    assert sky == pytest.approx(in_band_radiance(LWIR, 270.0))
    assert ground == pytest.approx(0.9 * in_band_radiance(LWIR, 300.0) + 0.1 * sky)
    assert Words(sky="clear", sun="30").at_height(2000.0).horizon_deg < 0
    assert Words(sky="clear", sun="90").sun_parts == (90.0, 0.0)
    assert Words(sky="clear", sun="1").sun_parts == (1.0, 0.0)
    # The limits of a temperature, and ground of a material, which is black here
    assert Words(ground="0.5").ground_parts == (0.5, "1")
    assert Words(ground="1e5, gloss_black").ground_parts == (1e5, "gloss_black")
    painted = Words(ground="300,gloss_black").at_height(None).in_band_radiance(LWIR, -20.0)
    assert painted == pytest.approx(in_band_radiance(LWIR, 300.0))


@pytest.mark.parametrize(
    "words, file",
    [("clear", None), ("285.5", None), ("us_standard_stratus", None), ("sky.csv", "sky.csv")],
)
def test_sky_file(words, file, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    rows = "".join(f"{3 + k / 20},0.1\n" for k in range(41))
    (tmp_path / "sky.csv").write_text(f"wavelength_um,radiance_W_m2_sr_um\n{rows}")
    assert Words(sky=words).sky_file == file


def test_sun_of_a_file(tmp_path):
    """Its irradiance shines, and the ground reflects it: E sin(elevation) (1 - epsilon) / pi."""
    rows = "".join(f"{7 + k / 10},{0.4 + k / 100}\n" for k in range(61))
    file = tmp_path / "sun, low.csv"
    file.write_text(f"wavelength_um,irradiance_W_m2_um\n{rows}")
    words = Words(sky="250", ground="290,0.7", sun=f"30,120,{file}")
    sky, sun = words.emitters("LWIR")
    assert sun["air"] == sky["sun_file"] == str(file) and sun["azimuth_deg"] == 120
    by_day, by_night = (
        w.at_height(None).in_band_radiance(LWIR, -45.0)
        for w in (words, Words(sky="250", ground="290,0.7"))
    )
    irradiance = 4 * 0.7  # mean of .5 at 8 um and .9 at 12 um
    assert by_day - by_night == pytest.approx(0.5 * irradiance * 0.3 / np.pi, rel=1e-3)
    assert Words(sky="250", ground="290", sun="30,120,").sun_file is None
    with pytest.raises(InputError, match="sunlight"):
        Words(sky="250", ground="290", sun=f"30,120,{tmp_path / 'missing.csv'}")


@pytest.mark.parametrize(
    "words, message",
    [
        ({}, "sky and ground are missing"),
        ({"sun": "30"}, "sky and ground are missing"),
        ({"sky": "cloudy"}, "sky table 'cloudy'"),
        ({"ground": "warm"}, "must be KELVIN"),
        ({"ground": "-3"}, "must be KELVIN"),
        ({"ground": "nan"}, "must be KELVIN"),
        ({"ground": "1.02e5"}, "must be KELVIN"),
        ({"ground": "288,1.2"}, "must lie in 0..1"),
        ({"sky": "clear", "sun": "90.5"}, "elevation in 1..90"),
        ({"sky": "clear", "sun": "30,40,50"}, "ELEVATION,AZIMUTH"),
        ({"sky": "overcast", "sun": "30"}, "hides the sun"),
        ({"sky": "clear", "atmosphere": "mars"}, "mars"),
    ],
)
def test_bad_words(words, message):
    with pytest.raises(InputError, match=message):
        Words(**words)

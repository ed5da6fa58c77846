"""What arrives from sky and ground, against Planck's law, the air's own rays and quadrature."""

import numpy as np
import pytest

from mi_lcair.errors import InputError
from mi_lcair.physics.air.clear_air import SunDirection, clear_air
from mi_lcair.physics.air.levels import Weather, bands
from mi_lcair.physics.bands import Spectrum, band
from mi_lcair.physics.blackbody import in_band_radiance, spectral_radiance
from mi_lcair.physics.sky import spectrum
from mi_lcair.physics.surroundings import (
    Blackbody,
    Ground,
    Words,
    sky_of,
    surroundings,
    through_air,
)

MWIR, LWIR = band("MWIR"), band("LWIR")
AIR = clear_air("us_standard")


def mean_over_sky(radiance, nodes=60):
    """Mean over the hemisphere of radiance(elevation), weighted by the cosine to the zenith."""
    x, w = np.polynomial.legendre.leggauss(nodes)
    elevations = np.degrees(np.arcsin(np.sqrt((x + 1) / 2)))
    return sum(weight / 2 * radiance(e) for weight, e in zip(w, elevations))


def test_sky_of_night():
    """It is the air's own light, and between computed elevations within 0.3 %."""
    around = surroundings("clear")
    for elevation in (0.3, 2.0, 5.0, 23.0, 71.0):
        expected = AIR.sky(50.0, elevation).in_band_radiance(LWIR)
        assert around.at(elevation).in_band_radiance(LWIR) == pytest.approx(expected, rel=1e-12)
        assert around.in_band_radiance(LWIR, elevation) == pytest.approx(expected, rel=3e-3)


@pytest.mark.parametrize("height_m", [1000.0, 10_000.0])
def test_sky_from_a_height(height_m):
    """From 10 km, where rays below the horizontal pass denser air, within 2 %."""
    around = surroundings("clear", height_m=height_m)
    for above in (0.17, 0.9, 2.0, 3.0, 6.0, 30.0):
        elevation = around.horizon_deg + above
        for each in (MWIR, LWIR):
            expected = AIR.sky(height_m, elevation).in_band_radiance(each)
            assert around.in_band_radiance(each, elevation) == pytest.approx(expected, rel=2e-2)


@pytest.mark.parametrize("emissivity", [1.0, 0.7])
def test_ground_without_air_before_it(emissivity):
    around = surroundings("clear", Ground(300.0, emissivity))
    sky = mean_over_sky(lambda e: AIR.sky(0.0, e).in_band_radiance(LWIR))
    expected = emissivity * in_band_radiance(LWIR, 300.0) + (1 - emissivity) * sky
    for elevation in (-90.0, -20.0, -0.01):
        assert around.in_band_radiance(LWIR, elevation) == pytest.approx(expected, rel=1e-3)
        assert around.at(elevation).in_band_radiance(LWIR) == pytest.approx(expected, rel=1e-3)


def test_ground_in_the_sun():
    """White ground would reflect the sun's irradiance on it, divided by pi, and the sky's."""
    dark = surroundings("clear", Ground(300.0, 0.6)).in_band_radiance(MWIR, -30.0)
    lit = surroundings("clear", Ground(300.0, 0.6), 50.0).in_band_radiance(MWIR, -30.0)
    sun = AIR.sun(0.0, 50.0).in_band_radiance(MWIR) * np.sin(np.radians(50.0)) / np.pi
    azimuths = np.arange(5, 180, 10.0)

    def scattered(elevation):
        along = AIR.ray(0.0, elevation)
        light = [AIR.scattered(along, SunDirection(50.0, a)) for a in azimuths]
        return np.mean([part.in_band_radiance(MWIR) for part in light])

    expected = 0.4 * (sun + mean_over_sky(scattered, 12))
    assert lit - dark == pytest.approx(expected, rel=5e-3)


@pytest.mark.parametrize("height_m", [50.0, 3000.0])
def test_ground_through_air(height_m):
    """The black ground's light is dimmed by the air, which adds its own."""
    around = surroundings("clear", Ground(310.0), height_m=height_m)
    for elevation in (-70.0, -12.0, -3.0):
        along = AIR.ray(height_m, elevation)
        ground = spectral_radiance(bands().wavelengths_um, 310.0)
        arriving = ground * bands().transmittance(along.amounts[-1]) + AIR.emitted(along).radiance
        expected = MWIR.integral(bands().wavelengths_um, arriving)
        assert around.at(elevation).in_band_radiance(MWIR) == pytest.approx(expected, rel=1e-9)
        assert around.in_band_radiance(MWIR, elevation) == pytest.approx(expected, rel=8e-3)


@pytest.mark.parametrize("azimuth", [8.0, -75.0, 180.0, 250.0])
def test_sunlit_air_before_the_ground(azimuth):
    """The air before the ground scatters sunlight, more toward the sun than away from it."""
    around = surroundings("clear", Ground(300.0, 0.9), 35.0, height_m=2000.0)
    for elevation in (-4.0, -50.0):
        along = AIR.ray(2000.0, elevation)
        scattered = AIR.scattered(along, SunDirection(35.0, azimuth)).in_band_radiance(MWIR)
        night = AIR.emitted(along).in_band_radiance(MWIR)
        reflected = sum(
            light.scaled(factor).through(along.amounts[-1])
            for factor, light in (
                (0.1, around.sky.on_ground[0][1]),
                (0.1 * np.sin(np.radians(35)) / np.pi, AIR.sun(0.0, 35.0)),
            )
        )
        expected = night + scattered + MWIR.integral(bands().wavelengths_um, reflected)
        _, other = around.in_band_components(MWIR, elevation, azimuth)
        assert other == pytest.approx(expected, rel=4e-3)
        _, light = around.components(elevation, azimuth)
        assert light.in_band_radiance(MWIR) == pytest.approx(expected, rel=1e-9)


def test_only_grey_ground_and_air_add_to_what_the_ground_emits():
    """Air is before the ground as soon as the viewer is above it."""
    counts = {}
    for emissivity in (1.0, 0.5, 0.0):
        for height_m in (None, 0.0, 0.5):
            around = surroundings("250", Ground(300.0, emissivity), height_m=height_m)
            counts[emissivity, height_m] = len(around.components(-30.0))
    assert {key for key, count in counts.items() if count == 1} == {(1.0, None), (1.0, 0.0)}
    assert set(counts.values()) == {1, 2}
    white = surroundings("250", Ground(300.0, 0.0)).in_band_radiance(LWIR, -30.0)
    assert white == pytest.approx(in_band_radiance(LWIR, 250.0), rel=1e-6)


def test_directions_are_toward_the_sun_unless_stated():
    """Of the sky and of the air before the ground, which are brighter there."""
    around = surroundings("clear", Ground(300.0), 35.0, height_m=2000.0)
    for elevation in (30.0, -30.0):
        toward, beside = (around.in_band_radiance(MWIR, elevation, a) for a in (0.0, 2.0))
        assert around.in_band_radiance(MWIR, elevation) == toward > beside
        assert sum(around.in_band_components(MWIR, elevation)) == toward
        light = [around.at(elevation, a).in_band_radiance(MWIR) for a in (0.0, 2.0)]
        assert around.at(elevation).in_band_radiance(MWIR) == light[0] > light[1]
        parts = around.components(elevation)
        assert sum(part.in_band_radiance(MWIR) for part in parts) == pytest.approx(light[0])


def test_horizon_of_a_high_viewer():
    """From 5 km a sphere's horizon lies arccos(R / (R + h)) below the horizontal, 2.27 degrees,
    and refraction raises it a little; on both sides of it air alone is seen.
    """
    around = surroundings("clear", Ground(340.0), height_m=5000.0)
    dip = np.degrees(np.arccos(6371.23 / 6376.23))
    assert 0.9 * dip < -around.horizon_deg < dip
    above, below = around.in_band_radiance(LWIR, around.horizon_deg + np.array([0.01, -0.01]))
    assert below / above == pytest.approx(1, abs=0.2)


@pytest.mark.parametrize(
    "word, table", [("overcast", "us_standard_stratus"), ("us_standard_clear", "us_standard_clear")]
)
def test_words(word, table):
    around = surroundings(word)
    for elevation in (3.0, 40.0):
        expected = spectrum(table, elevation).in_band_radiance(LWIR)
        assert around.in_band_radiance(LWIR, elevation) == pytest.approx(expected, rel=3e-3)


def test_sky_of_one_temperature():
    """In any band; grey ground below a sky of its own temperature is black."""
    around = surroundings("280", Ground(280.0, 0.3))
    for name in ("SWIR", "3.4-4.1", "LWIR"):
        black = in_band_radiance(band(name), 280.0)
        assert around.in_band_radiance(band(name), 12.0) == pytest.approx(black, rel=1e-12)
    values = around.in_band_radiance(MWIR, np.array([-40.0, 40.0]))
    np.testing.assert_allclose(values, in_band_radiance(MWIR, 280.0), rtol=1e-12)


def test_sky_per_metre_of_wavelength(tmp_path):
    rows = "".join(f"{8 + k / 20},8e6\n" for k in range(81))
    (tmp_path / "sky.csv").write_text(f"wavelength_um,radiance_W_m2_sr_um\n{rows}")
    with pytest.raises(InputError, match="brighter than the sun's surface; .* sr.-1 um"):
        surroundings(str(tmp_path / "sky.csv"))


@pytest.mark.parametrize(
    "words, message",
    [
        ({"sky": "sunny"}, "sky table 'sunny'"),
        ({"sky": "-5"}, "must lie in 0..10000 K"),
        ({"sky": "overcast", "sun_elevation_deg": 40.0}, "hides the sun"),
        ({"sky": "clear", "sun_elevation_deg": 0.2}, "sun = 0.2 degrees"),
        ({"sky": "clear", "height_m": -3.0}, "ground = -3 m"),
        ({"sky": "clear", "atmosphere": "mars"}, "mars"),
    ],
)
def test_bad_words(words, message):
    with pytest.raises(InputError, match=message):
        surroundings(**words)


def test_missing_half():
    with pytest.raises(InputError, match="there is no ground"):
        surroundings("clear").at(-5.0)
    assert surroundings("clear").in_band_radiance(LWIR, -5.0) == 0
    with pytest.raises(InputError, match="does not cover band"):
        surroundings("clear").in_band_radiance(band("SWIR"), 5.0)


@pytest.mark.parametrize("sky", [270.0, None])
def test_ground_in_the_sun_below_a_sky_that_knows_none(sky):
    """It reflects the mean of the sky and sin(elevation) E / pi, whatever the sky is."""
    around = surroundings(sky, Ground(300.0, 0.9), 40.0)
    sun = np.sin(np.radians(40)) * AIR.sun(0.0, 40.0).in_band_radiance(MWIR) / np.pi
    above = 0.0 if sky is None else float(in_band_radiance(MWIR, sky))
    _, reflected = around.in_band_components(MWIR, -30.0)
    assert reflected == pytest.approx(0.1 * (above + sun), rel=2e-3)


# Surroundings in words: what they mean, and words that mean nothing
# ------------------------------------------------------------------

WORDS_LWIR = band("LWIR")


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
    sky, ground = around.in_band_radiance(WORDS_LWIR, [20.0, -20.0])
    assert sky == pytest.approx(in_band_radiance(WORDS_LWIR, 270.0))
    assert ground == pytest.approx(0.9 * in_band_radiance(WORDS_LWIR, 300.0) + 0.1 * sky)
    assert Words(sky="clear", sun="30").at_height(2000.0).horizon_deg < 0
    assert Words(sky="clear", sun="90").sun_parts == (90.0, 0.0)
    assert Words(sky="clear", sun="1").sun_parts == (1.0, 0.0)
    # The limits of a temperature, and ground of a material, which is black here
    assert Words(ground="0.5").ground_parts == (0.5, "1")
    assert Words(ground="1e5, gloss_black").ground_parts == (1e5, "gloss_black")
    painted = Words(ground="300,gloss_black").at_height(None).in_band_radiance(WORDS_LWIR, -20.0)
    assert painted == pytest.approx(in_band_radiance(WORDS_LWIR, 300.0))


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
        w.at_height(None).in_band_radiance(WORDS_LWIR, -45.0)
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
def test_bad_words_of_words(words, message):
    with pytest.raises(InputError, match=message):
        Words(**words)


# Skies by their words, and light of skies after more air
# -------------------------------------------------------

SKIES_LWIR = band("LWIR")
AMOUNTS = clear_air("us_standard").ray(50.0, 30.0, 2000.0).amounts[-1]
X = bands().wavelengths_um


def test_a_blackbody_times_a_factor():
    light = Blackbody.of(300.0).scaled(0.5).scaled(0.4)
    np.testing.assert_allclose(light.at([4.0, 9.0]), 0.2 * spectral_radiance([4.0, 9.0], 300.0))
    np.testing.assert_allclose(light.radiance, 0.2 * spectral_radiance(X, 300.0))
    assert light.in_band_radiance(SKIES_LWIR) == pytest.approx(
        0.2 * in_band_radiance(SKIES_LWIR, 300.0)
    )


def test_light_after_air():
    """All of a blackbody, a file between its wavelengths, and air after air."""
    transmittance = bands().transmittance(AMOUNTS)
    black = through_air(Blackbody.of(280.0), AMOUNTS)
    np.testing.assert_allclose(black.radiance, transmittance * spectral_radiance(X, 280.0))
    ends = X[[60, 90]]
    light = through_air(Spectrum("file", ends, np.array([2.0, 3.0])), AMOUNTS)
    np.testing.assert_allclose(
        light.radiance[60:91], np.interp(X[60:91], ends, [2, 3]) * transmittance[60:91]
    )
    assert not light.radiance[:60].any() and not light.radiance[91:].any()
    twice = through_air(light, 2 * AMOUNTS).radiance[75]
    expected = np.interp(X[75], ends, [2, 3]) * bands().transmittance(3 * AMOUNTS)[75]
    assert twice == pytest.approx(expected)


def test_a_table_down_to_the_horizon(tmp_path):
    """Its rows and, below the horizon and at the zenith, the nearest ones."""
    radiance = {0.0: 9.0, 2.5: 6.0, 90.0: 2.0}
    rows = [f"{e},{x:.1f},{L}" for e, L in radiance.items() for x in np.arange(7, 13, 0.1)]
    header = "elevation_deg,wavelength_um,radiance_W_m2_sr_um"
    (tmp_path / "sky.csv").write_text("\n".join([header, *rows]))
    sky = sky_of(str(tmp_path / "sky.csv"), "us_standard")
    elevations = np.array([-3.0, 0.0, 2.5, 90.0])
    expected = np.array([9.0, 9, 6, 2])
    assert [sky.at(elevation).at(9.0) for elevation in elevations] == pytest.approx(expected)
    (found,) = sky.in_band_components(SKIES_LWIR, elevations)
    np.testing.assert_allclose(found, 4 * expected, rtol=1e-6)


def test_weather_is_that_of_its_own_air():
    humid = Weather(humidity=0.9)
    skies = {
        word: [sky_of(word, "us_standard", weather=weather) for weather in (Weather(), humid)]
        for word in ("clear", "us_standard_clear", "midlat_summer_clear")
    }
    differ = {
        word: dry.at(30.0).in_band_radiance(SKIES_LWIR) != wet.at(30.0).in_band_radiance(SKIES_LWIR)
        for word, (dry, wet) in skies.items()
    }
    assert differ == {"clear": True, "us_standard_clear": True, "midlat_summer_clear": False}


def test_limits_of_a_temperature():
    assert sky_of("0.5", "us_standard").temperature == 0.5
    for word in ("0", "1e4", "1.02e4"):
        with pytest.raises(InputError, match="must lie in 0..10000 K"):
            sky_of(word, "us_standard")

"""Skies by their words, and light of skies after more air."""

import numpy as np
import pytest

from mi_lcair.errors import InputError
from mi_lcair.physics.air.bands import bands
from mi_lcair.physics.air.clear_air import clear_air
from mi_lcair.physics.air.levels import Weather
from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import in_band_radiance, spectral_radiance
from mi_lcair.physics.spectrum import Spectrum
from mi_lcair.physics.surroundings.skies import Blackbody, sky_of, through_air

LWIR = band("LWIR")
AMOUNTS = clear_air("us_standard").ray(50.0, 30.0, 2000.0).amounts[-1]
X = bands().wavelengths_um


def test_a_blackbody_times_a_factor():
    light = Blackbody.of(300.0).scaled(0.5).scaled(0.4)
    np.testing.assert_allclose(light.at([4.0, 9.0]), 0.2 * spectral_radiance([4.0, 9.0], 300.0))
    np.testing.assert_allclose(light.radiance, 0.2 * spectral_radiance(X, 300.0))
    assert light.in_band_radiance(LWIR) == pytest.approx(0.2 * in_band_radiance(LWIR, 300.0))


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
    (found,) = sky.in_band_components(LWIR, elevations)
    np.testing.assert_allclose(found, 4 * expected, rtol=1e-6)


def test_weather_is_that_of_its_own_air():
    humid = Weather(humidity=0.9)
    skies = {
        word: [sky_of(word, "us_standard", weather=weather) for weather in (Weather(), humid)]
        for word in ("clear", "us_standard_clear", "midlat_summer_clear")
    }
    differ = {
        word: dry.at(30.0).in_band_radiance(LWIR) != wet.at(30.0).in_band_radiance(LWIR)
        for word, (dry, wet) in skies.items()
    }
    assert differ == {"clear": True, "us_standard_clear": True, "midlat_summer_clear": False}


def test_limits_of_a_temperature():
    assert sky_of("0.5", "us_standard").temperature == 0.5
    for word in ("0", "1e4", "1.02e4"):
        with pytest.raises(InputError, match="must lie in 0..10000 K"):
            sky_of(word, "us_standard")

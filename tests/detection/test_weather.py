"""Weather of a scenario: its quantities, and the light of sun and sky that crosses its air."""

from dataclasses import replace

import mitsuba as mi
import numpy as np
import pytest

from mi_lcair.detection.setting import setting_of
from mi_lcair.detection.weather import QUANTITIES, AirOfLight, in_weather, weather_quantities
from mi_lcair.physics.air.levels import Weather, levels
from mi_lcair.physics.bands import band
from mi_lcair.physics.sun.daytime_sky import clear_sky
from mi_lcair.physics.sun.sunlight import sunlight
from tests.detection.disc_scenario import disc, write_disc

mi.set_variant("llvm_ad_mono")

MWIR = band("MWIR")
DAY = {
    "surroundings__sky": "clear",
    "surroundings__ground": "290",
    "surroundings__sun": "30,10",
    "observer__elevation_deg": 20,
    "target__height_m": 1500,
}
HUMID = {"temperature": 300.0, "humidity": 0.9, "visibility": 8.0, "co2": 425.0}


def setting(folder, weather, **changes):
    write_disc(folder)
    air = {f"atmosphere__{name}": value for name, value in weather.items()}
    table = {"atmosphere__table": "us_standard"}
    return setting_of(disc(folder, **{**DAY, **table, **air, **changes}))


def lamps(scene):
    """Sun and sky of a scene."""
    sky, sun = sorted(scene.mi.emitters(), key=lambda emitter: emitter.group)[-2:]
    return sun, sky


def test_light_at_the_target_has_the_weather(tmp_path):
    """Sun and sky at the target, 1500 m above the ground, are those of humid and hazy air."""
    scene = setting(tmp_path, HUMID).view
    sun, sky = lamps(scene)
    expected = sunlight("us_standard", 30.0, height_m=1500.0, weather=Weather(**HUMID))
    plain = sunlight("us_standard", 30.0, height_m=1500.0)
    assert sun.scale[0] == pytest.approx(expected.in_band_radiance(MWIR), rel=1e-6)
    assert sun.scale[0] < 0.85 * plain.in_band_radiance(MWIR)
    above = clear_sky("us_standard", 30.0, 1500.0, Weather(**HUMID))
    up = mi.Vector3f(float(np.cos(np.radians(40))), 0.0, float(np.sin(np.radians(40))))
    with scene.prepared():
        radiance = sky.along(up, mi.Bool(True))[0][0]
    assert radiance == pytest.approx(sum(above.in_band_components(MWIR, 40.0, 10.0)), rel=3e-3)


def test_light_of_another_atmosphere_keeps_its_weather(tmp_path):
    """Weather is that of [atmosphere]; sun and sky of another model atmosphere stay as they are."""
    other = {"surroundings__atmosphere": "midlat_summer"}
    sun, sky = lamps(setting(tmp_path, HUMID, **other).view)
    assert sun.weather == sky.weather == Weather()
    assert sun.scale[0] == pytest.approx(
        sunlight("midlat_summer", 30.0, height_m=1500.0).in_band_radiance(MWIR), rel=1e-6
    )


def test_sources_in_another_weather(tmp_path):
    """They are those of the scene after its light has changed; a factor of a source stays."""
    made = setting(tmp_path, {})
    with made.view.prepared(by_spectrum=True) as tracer:
        before = [source for source in tracer.emitters.sources.list if source.name is not None]
    half = [source if source.spectrum is None else halved(source) for source in before]
    light = AirOfLight(1500.0, "us_standard", Weather(**HUMID))
    changed, changed_half = (light.sources(made.view, sources) for sources in (before, half))
    light.shine_on(made.view)
    with made.view.prepared(by_spectrum=True) as tracer:
        after = [source for source in tracer.emitters.sources.list if source.name is not None]
    assert len(before) > 20 and [s.name for s in changed] == [s.name for s in after]
    for source, other, other_half, old in zip(after, changed, changed_half, before):
        assert other.in_band == pytest.approx(source.in_band, rel=1e-5, abs=1e-12)
        if source.spectrum is None:
            assert other is other_half is old
            continue
        assert other_half.in_band == pytest.approx(other.in_band / 2, rel=1e-6)
        np.testing.assert_allclose(
            other.spectrum.radiance, source.spectrum.radiance, rtol=1e-5, atol=1e-9
        )
        np.testing.assert_allclose(
            other_half.spectrum.radiance, other.spectrum.radiance / 2, rtol=1e-6
        )
    assert sum(abs(a.in_band / b.in_band - 1) > 0.05 for a, b in zip(after, before)) > 5


def halved(source):
    return replace(source, in_band=source.in_band / 2, spectrum=source.spectrum.scaled(0.5))


def test_quantities(tmp_path):
    """They are the present values in the air, and `in_weather` sets their entries."""
    write_disc(tmp_path)
    scenario = disc(tmp_path, atmosphere__table="midlat_summer", atmosphere__humidity=0.5)
    known = weather_quantities(scenario.atmosphere)
    ground = levels("midlat_summer")
    assert list(known) == list(QUANTITIES)
    values = [known[name].value for name in QUANTITIES]
    expected = [ground.temperature[0], 0.5, ground.pressure[0], 23.0, 330.0]
    assert values == pytest.approx(expected)
    assert known["scenario.air_temperature"].unit == "K" and known["scenario.co2"].upper == 2000
    changed = in_weather(scenario, {"scenario.visibility": 9.0, "scenario.air_pressure": 990.0})
    assert changed.atmosphere.weather == Weather(humidity=0.5, visibility=9.0, pressure=990.0)
    assert not weather_quantities(disc(tmp_path).atmosphere)

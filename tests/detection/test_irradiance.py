"""Irradiances of a blackbody through grey air before a background, against closed forms."""

from dataclasses import replace

import mitsuba as mi
import numpy as np
import pytest
from scipy.special import stdtrit

from mi_lcair.detection.irradiance import (
    QUANTITIES,
    AirOfLight,
    Backdrop,
    Irradiance,
    RenderError,
    in_weather,
    weather_quantities,
)
from mi_lcair.detection.setting import setting_of
from mi_lcair.physics.air.clear_air import clear_air
from mi_lcair.physics.air.levels import Weather, levels
from mi_lcair.physics.atmosphere import atmosphere
from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import in_band_radiance, spectral_radiance
from mi_lcair.physics.sun import clear_sky, sunlight
from mi_lcair.plugins.emission.source import Source
from mi_lcair.signatures.effective_areas import EffectiveAreas
from tests.detection.disc_scenario import disc, write_disc
from tests.detection.test_detection_range import (
    AIR,
    AREA,
    BACKDROP,
    DEPTH,
    HOT,
    LWIR,
    SKY,
    L,
    grey_air,
)

RANGE = 700.0
TAU = np.exp(-DEPTH * RANGE)
COLD = 280.0
# Covariances [m^4] of the effective areas of two sources and of the projected area
COVARIANCE = np.array([[0.04, -0.01, 0.02], [-0.01, 0.09, 0.03], [0.02, 0.03, 0.05]])
L_COLD = float(in_band_radiance(LWIR, COLD))


def two_sources(**more):
    """Effective areas of 10 and 4 m^2 at 330 and 280 K, of a target of 15 m^2."""
    areas = EffectiveAreas(
        band=LWIR,
        sources=[Source("hot", "330 K", L[HOT], HOT), Source("cold", "280 K", L_COLD, COLD)],
        amounts=np.array([[AREA, 4.0, 15.0], [99.0, 99.0, 15.0]]),
        error=np.zeros((2, 2)),
        covariance=np.array([COVARIANCE, 9 * COVARIANCE]),  # of the target, and of the whole scene
        nodes_um=np.empty(0),
    )
    return Irradiance(areas, RenderError(**more), LWIR, grey_air(), BACKDROP)


def test_terms_through_grey_air():
    terms = two_sources().at(grey_air().path(RANGE))
    intensity = L[HOT] * AREA + L_COLD * 4
    assert terms["intensity"].value == pytest.approx(intensity, rel=1e-6)
    assert terms["target"].value == pytest.approx(TAU * intensity / RANGE**2, rel=1e-5)
    path, background = (1 - TAU) * L[AIR] * 15 / RANGE**2, L[SKY] * 15 / RANGE**2
    assert terms["path"].value == pytest.approx(path, rel=1e-5)
    assert terms["background"].value == pytest.approx(background, rel=1e-6)
    total = TAU * intensity / RANGE**2 + path - background
    assert terms["total"].value == pytest.approx(total, rel=1e-4)


def test_groups_are_parts_of_the_target():
    """Each has the error of its own effective area; together they are the target."""
    groups = two_sources().by_group(grey_air().path(RANGE))
    assert {name: list(part) for name, part in groups.items()} == {
        name: ["intensity", "target"] for name in ("hot", "cold")
    }
    for part, radiance, area, variance in zip(groups.values(), (L[HOT], L_COLD), (AREA, 4), (4, 9)):
        intensity, error = radiance * area, radiance * np.sqrt(variance / 100)
        assert part["intensity"].pair == pytest.approx((intensity, error), rel=1e-6)
        at_sensor = TAU / RANGE**2
        assert part["target"].pair == pytest.approx(
            (at_sensor * intensity, at_sensor * error), rel=1e-5
        )


def test_errors_follow_from_the_covariance():
    """The square root of g C g, with g the derivative with respect to each area."""
    terms = two_sources().at(grey_air().path(RANGE))
    for name, gradient in (
        ("intensity", [L[HOT], L_COLD, 0]),
        ("target", np.array([TAU * L[HOT], TAU * L_COLD, 0]) / RANGE**2),
        ("path", np.array([0, 0, (1 - TAU) * L[AIR]]) / RANGE**2),
        (
            "total",
            np.array([TAU * L[HOT], TAU * L_COLD, (1 - TAU) * L[AIR] - L[SKY]]) / RANGE**2,
        ),
    ):
        expected = np.sqrt(gradient @ COVARIANCE @ gradient)
        assert terms[name].standard_error == pytest.approx(expected, rel=1e-4)
    assert two_sources().projected_area.pair == (15.0, pytest.approx(np.sqrt(0.05)))


def test_half_widths():
    """Student's factor times the standard error, and a source of 0.3 W/sr that no path has hit."""
    path = grey_air().path(RANGE)
    error = two_sources().at(path)["total"].standard_error
    assert two_sources().half_width(path) == pytest.approx(1.959964 * error, rel=1e-6)
    assert two_sources().least_half_width(path) == 0
    result = two_sources(degrees_of_freedom=4, missed=0.3, systematic=0.01)
    missed = 0.3 * TAU / RANGE**2
    assert result.half_width(path) == pytest.approx(stdtrit(4, 0.975) * error + missed, rel=1e-5)
    target = result.at(path)["target"].value
    least = stdtrit(4, 0.975) * 0.01 * target
    assert result.least_half_width(path) == pytest.approx(least, rel=1e-9)


def test_spectra_integrate_to_the_terms():
    result, path = two_sources(), grey_air().path(RANGE)
    terms = result.at(path)
    for name, spectrum in result.spectral(path).items():
        assert result.in_band(spectrum) == pytest.approx(terms[name].value, rel=1e-9)
    assert result.in_band(result.background(path)) == pytest.approx(L[SKY], rel=1e-6)


def test_many_temperatures_as_one_spectrum():
    """The errors of the spectrum and of the projected area are common, with opposite signs."""
    nodes = np.polynomial.chebyshev.chebpts1(24) * 2 + 10
    spectrum = spectral_radiance(nodes, HOT) * AREA
    deviation = np.append(0.02 * spectrum, -0.2)
    covariance = np.array([np.outer(deviation, deviation), np.eye(25)])
    areas = EffectiveAreas(
        band=LWIR,
        sources=[],
        amounts=np.array([np.append(spectrum, 15.0), np.append(7 * spectrum, 15.0)]),
        error=np.zeros((2, 0)),
        covariance=covariance,
        nodes_um=nodes,
    )
    assert areas.intensity() == pytest.approx((L[HOT] * AREA, 0.02 * L[HOT] * AREA), rel=1e-5)
    terms = Irradiance(areas, RenderError(), LWIR, grey_air(), BACKDROP).at(grey_air().path(RANGE))
    target = TAU * L[HOT] * AREA / RANGE**2
    assert terms["target"].pair == pytest.approx((target, 0.02 * target), rel=1e-4)
    rest = ((1 - TAU) * L[AIR] - L[SKY]) / RANGE**2
    error = abs(0.02 * target - 0.2 * rest)
    assert terms["total"].pair == pytest.approx((target + 15 * rest, error), rel=1e-3)


@pytest.mark.parametrize("nodes", [[], [3.2, 4.0, 4.8]])
def test_reflected_sunlight_with_one_row_for_many_temperatures(nodes):
    """Absorbers of both paths add, for any effective area of the sun."""
    air, mwir = atmosphere("us_standard"), band("MWIR")
    light, nodes = clear_air("us_standard").sun(50.0, 45.0), np.array(nodes)
    areas = EffectiveAreas(
        band=mwir,
        sources=[Source("sun", light.name, 1.0, spectrum=light)],
        amounts=np.array([[AREA, *np.zeros(len(nodes)), 15.0]] * 2),
        error=np.zeros((2, 1)),
        covariance=np.zeros((2, len(nodes) + 2, len(nodes) + 2)),
        nodes_um=nodes,
    )
    path = air.path(2000.0)
    target = Irradiance(areas, RenderError(), mwir, air, BACKDROP).at(path)["target"]
    expected = AREA * mwir.integral(path.wavelengths_um, light.through(path.amounts)) / 2000.0**2
    assert target.value == pytest.approx(expected, rel=5e-3)


def test_a_background_with_a_path_of_its_own():
    """Ground at 700 m + 300 m: dimmed, with the radiance of the air before it."""
    air = grey_air()
    ground = Backdrop(
        "ground",
        lambda x: spectral_radiance(x, 300.0),
        np.array([7.0, 8.5]),
        lambda range_m: air.path(range_m + 300),
    )
    arriving = ground.at_sensor(RANGE)
    tau = np.exp(-1.0)
    expected = tau * spectral_radiance(10.0, 300.0) + (1 - tau) * spectral_radiance(10.0, AIR)
    assert arriving.at(np.array([10.0]))[0] == pytest.approx(expected, rel=1e-5)
    assert arriving.path_at is None and arriving.name == "ground" and 8.5 in arriving.rows_um
    assert set(air.wavelengths_um) < set(arriving.rows_um) and 7.0 not in arriving.rows_um
    assert BACKDROP.at_sensor(RANGE) is BACKDROP


def test_a_response_weighs_the_rule(tmp_path):
    """Between the rows of air, background and response, the rule is Gauss's of two points."""
    file = tmp_path / "response.csv"
    file.write_text("wavelength_um,response\n9,0\n10.001,1\n11.5,0.4\n")
    narrow = band(file)
    areas = two_sources().areas
    backdrop = Backdrop("sky", lambda x: x - 9, np.array([8.0, 9.7, 12.0]))
    result = Irradiance(areas, RenderError(), narrow, grey_air(), backdrop)
    assert result.wavelengths_um.min() > 9 and result.wavelengths_um.max() < 11.5
    # int (x - 9) response dx by a fine trapezoidal rule
    x = np.linspace(9, 11.5, 250_001)
    expected = np.trapezoid((x - 9) * np.interp(x, [9, 10.001, 11.5], [0, 1, 0.4]), x)
    assert result.in_band(result.behind.at(result.wavelengths_um)) == pytest.approx(
        expected, rel=1e-8
    )


@pytest.mark.parametrize("factor", [1.0, 2.5])
def test_a_background_that_reflects_light_through_air(factor):
    """A third of the sun's light, whose absorbers and those of the path add."""
    air, light = atmosphere("us_standard"), clear_air("us_standard").sun(50.0, 45.0)
    ground = Backdrop(
        "ground", lambda x: 0.3 * light.at(x), light.wavelengths_um, air.path, ((0.3, light),)
    )
    path = air.path(2000.0)
    expected = 0.3 * factor * light.through(path.amounts) + path.radiance
    arriving = ground.scaled(factor).at_sensor(2000.0).at(path.wavelengths_um)
    np.testing.assert_allclose(arriving, expected, rtol=1e-5)
    dimmed = path.transmittance * ground.scaled(factor).at(path.wavelengths_um) + path.radiance
    assert (expected / dimmed).max() > 1.1  # where lines of the first path are saturated


# Weather of a scenario: its quantities, and the light of sun and sky that crosses its air
# ----------------------------------------------------------------------------------------

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

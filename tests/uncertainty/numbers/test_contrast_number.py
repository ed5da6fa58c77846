"""Contrasts of scenarios against closed forms and against renders."""

import mitsuba as mi
import numpy as np
import pytest

import mi_lcair
from mi_lcair.detection.scenario import Scenario
from mi_lcair.errors import InputError
from mi_lcair.physics.blackbody import in_band_radiance, spectral_radiance
from mi_lcair.uncertainty.budget import result_of
from tests.detection.disc_scenario import AREA as DISC_AREA
from tests.detection.disc_scenario import disc, triangles, write_disc
from tests.uncertainty.plate_scene import (
    row,
    slope,
    triangle_areas,
)

mi.set_variant("llvm_ad_mono")


def test_contrast_in_closed_form(tmp_path):
    """A blackbody disc in vacuum: contrast = A (B(T) - B(T_0)) / R^2."""
    write_disc(tmp_path)
    scenario = disc(tmp_path, render__resolution=32, render__spp=256)
    stated = {
        "sigma": {"self.temperature": 1.0},
        "scenario": {
            "background_temperature": 2.0,
            "range_m": 10,
            "transmittance": 0.02,
            "nei": 1e-9,
        },
    }
    found = mi_lcair.budget(scenario, stated)
    band = scenario.sensor.detector().band
    B = lambda T: float(in_band_radiance(band, T))
    scale, expected = DISC_AREA / 1000**2, found.value
    assert found.unit == "W m^-2"
    assert expected == pytest.approx(scale * (B(400) - B(294)), rel=3e-3)
    contributions = {
        "self.temperature": scale * slope(band, 400),
        "scenario.background_temperature": -2 * scale * slope(band, 294),
        "scenario.range_m": -2 * expected / 1000 * 10,
        "scenario.transmittance": 0.02 * scale * B(400),
        "scenario.nei": 1e-9,
    }
    for name, contribution in contributions.items():
        assert row(found, name).contribution == pytest.approx(contribution, rel=4e-3), name
    assert sum(row.share for row in found.rows) == pytest.approx(1)


@pytest.mark.parametrize("air", ["vacuum", "us_standard"])
def test_transmittance_by_wavelength(tmp_path, air):
    """An interval of wavelengths changes its own part of the irradiance, and all add up.

    In vacuum the part is A L(T) / R^2, by Planck's law over the interval.
    """
    write_disc(tmp_path)
    given = {"render__resolution": 16, "render__spp": 64, "atmosphere__table": air}
    scenario = disc(tmp_path, **given)
    ends = [3.0, 3.7, 4.15, 5.0]
    names = [f"transmittance@{a}-{b}" for a, b in zip(ends, ends[1:])]
    of_all = dict.fromkeys([*names, "transmittance"], "2 %")
    found = mi_lcair.budget(scenario, {"scenario": of_all})
    parts = [row(found, f"scenario.{name}").contribution for name in of_all]
    assert sum(parts[:-1]) == pytest.approx(parts[-1], rel=1e-3)
    if air == "vacuum":
        for a, b, part in zip(ends, ends[1:], parts):
            x = np.linspace(a, b, 2001)
            radiance = np.trapezoid(spectral_radiance(x, 400.0), x)
            assert part == pytest.approx(0.02 * DISC_AREA * radiance / 1e6, rel=4e-3)
    with pytest.raises(InputError, match="must name two rising wavelengths within 3-5 um"):
        mi_lcair.budget(scenario, {"scenario": {"transmittance@4-6": 0.1}})


@pytest.mark.slow
def test_contrast_by_sources_and_by_renders():
    """The derivative from weights of the sources is that of contrasts that are rendered anew.

    The value is that of `mi_lcair.contrast`. Differences of renders with these steps scatter by
    10 % from seed to seed, because the choice of lobes changes with the parameters.
    """
    scenario = Scenario.read(
        "a340_landing/position_3",
        **{"render.resolution": 32, "render.spp": 256, "render.max_bounces": "[1, 2]"},
    )
    with result_of(scenario, {}) as number:
        number.start()
        assert number.value == pytest.approx(mi_lcair.contrast(scenario).rows[-1].total.value)
        for name, step in (("bare_aluminum.epsilon", 0.08), ("bare_aluminum.b", 0.04)):
            (found,), (error,) = number.derivatives([name], [step])
            ends = [number.at({name: number.known[name].value + s}) for s in (step, -step)]
            tolerance = 4 * error + 0.2 * abs(found)
            assert found == pytest.approx((ends[0] - ends[1]) / (2 * step), abs=tolerance)
        # Temperatures and radiances by sources, and with everything rendered
        for name, step in (("terrain.temperature", 3.0), ("sky.radiance", 0.1)):
            value = number.known[name].value + step
            total = number.numbers.render({name: value})
            rendered = number.linear(total, number.areas_of(total), {}).value
            assert number.at({name: value}) - number.value == pytest.approx(
                rendered - number.value, rel=1e-3
            )


@pytest.mark.slow
def test_a_contrast_with_too_many_temperatures(tmp_path):
    """The derivative then comes from differences, and its error is not known."""
    temperatures = np.linspace(395, 405, len(triangles()))
    write_disc(tmp_path, temperatures)
    scenario = disc(tmp_path, render__resolution=32)
    found = mi_lcair.budget(scenario, {"sigma": {"self.temperature": 1.0}})
    slopes = [slope(scenario.sensor.detector().band, T) for T in temperatures]
    expected = DISC_AREA * np.average(slopes, weights=triangle_areas()) / 1000**2
    found_row = row(found, "self.temperature")
    assert found_row.contribution == pytest.approx(expected, rel=0.01)
    assert np.isnan(found_row.sensitivity_error)
    assert found.as_dict()["estimate"]["contributions"][0]["sensitivity_error"] is None


def test_weather_of_a_contrast(tmp_path):
    """The contribution of weather is the difference of contrasts in two weathers.

    The disc reflects more than half of the sun and of the sky, whose light crosses the same air.
    """
    write_disc(tmp_path)
    text = (tmp_path / "disc.xml").read_text().replace('"blackbody"', '"0.4"')
    (tmp_path / "disc.xml").write_text(text)
    given = {
        "render__resolution": 16,
        "render__spp": 256,
        "observer__range_m": 5000,
        "observer__elevation_deg": 20,
        "target__height_m": 1500,
        "target__parameters__temperature": 290,
        "atmosphere__table": "us_standard",
        "surroundings__sky": "clear",
        "surroundings__ground": "290,0.8",
        "surroundings__sun": "30,10",
    }
    found = mi_lcair.budget(disc(tmp_path, **given), {"scenario": {"air_humidity": 0.02}})
    high, low = (
        mi_lcair.contrast(disc(tmp_path, **given, atmosphere__humidity=0.4584 + end))
        for end in (0.02, -0.02)
    )
    difference = (high.rows[0].total.value - low.rows[0].total.value) / 2
    assert abs(difference) > 4e-3 * abs(found.value)
    assert row(found, "scenario.air_humidity").contribution == pytest.approx(difference, rel=0.03)
    with pytest.raises(InputError, match="unknown quantity.*scenario.co2"):
        mi_lcair.budget(disc(tmp_path), {"scenario": {"co2": 10.0}})


@pytest.mark.slow
@pytest.mark.parametrize("sky, elevation", [("clear", -10), ("260", 10)])
def test_surroundings_are_behind_the_target_too(tmp_path, sky, elevation):
    """Contributions are differences of contrasts of scenarios with other surroundings."""
    write_disc(tmp_path)
    text = (tmp_path / "disc.xml").read_text().replace('"blackbody"', '"0.6"')
    (tmp_path / "disc.xml").write_text(text)

    def scenario(sky=sky, kelvin=290.0, emissivity=0.8):
        words = {"surroundings__sky": sky, "surroundings__ground": f"{kelvin},{emissivity}"}
        place = {"observer__elevation_deg": elevation, "target__height_m": 400}
        return disc(tmp_path, **words, **place, render__resolution=32, render__spp=64)

    sigma = {"ground.temperature": 1.0, "ground.emissivity": 0.02}
    if sky != "clear":
        sigma["sky.temperature"] = 1.0
    found = mi_lcair.budget(scenario(), {"sigma": sigma})
    other = {
        "ground.temperature": ({"kelvin": 291.0}, {"kelvin": 289.0}),
        "ground.emissivity": ({"emissivity": 0.82}, {"emissivity": 0.78}),
        "sky.temperature": ({"sky": "261"}, {"sky": "259"}),
    }
    for name in sigma:
        high, low = (mi_lcair.contrast(scenario(**k)).rows[-1].total.value for k in other[name])
        tolerance = 0.02 * abs(high - low) / 2 + 1e-9
        assert row(found, name).contribution == pytest.approx((high - low) / 2, abs=tolerance), name
    if sky == "clear" and elevation < 0:  # black would be the contrast without any sky behind
        contribution = mi_lcair.budget(scenario(), {"sigma": {"sky.scale": 0.05}}).rows[0]
        assert contribution.contribution < 0

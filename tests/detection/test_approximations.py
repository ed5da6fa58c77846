"""Approximations of contrasts: their sizes against exact values, and in the interval."""

from dataclasses import replace

import numpy as np
import pytest

import mi_lcair
from mi_lcair.detection.approximations import (
    multiplied_light,
    share_of_product,
    share_of_reflections,
    shares_of_light,
)
from mi_lcair.detection.contrast import accuracy
from mi_lcair.detection.setting import setting_of
from mi_lcair.physics.air.atmosphere import AirLight
from mi_lcair.physics.air.clear_air import SunDirection, clear_air
from mi_lcair.physics.bands import Spectrum
from mi_lcair.physics.blackbody import spectral_radiance
from mi_lcair.plugins.emission.source import Source
from tests.detection.disc_scenario import disc, lit, write_disc

ELEVATIONS_DEG = (4.5, 10, 20, 45, 90)


def shares(setting, light):
    """Exact and stated share that the product adds to a light whose table does not say its air."""
    path, band, x = setting.path, setting.detector.band, light.wavelengths_um
    product = band.integral(x, light.radiance * path.transmittance)
    exact = 1 - band.integral(x, light.through(path.amounts)) / product
    return exact, share_of_product(setting, Spectrum("table", x, light.radiance), None)


def cloud(air, elevation_deg, base_m=1000.0, height_m=50.0):
    """Light of a black cloud with this base, and of the air below it."""
    along = air.ray(
        height_m, elevation_deg, (base_m - height_m) / np.sin(np.radians(elevation_deg))
    )
    kelvin = air.levels.at(np.array([base_m / 1000]))[1][0]
    black = spectral_radiance(air.emitted(along).wavelengths_um, kelvin)
    return air.emitted(along).plus(AirLight.of("cloud", black[None], along.amounts[-1:]))


def air_table(folder) -> str:
    """A file of air at 1 and 5 km."""
    rows = [f"{R},{x},{0.9**R},0.1" for R in (1, 5) for x in np.linspace(3, 5, 99)]
    header = "range_km,wavelength_um,transmittance,path_radiance_W_m2_sr_um"
    (folder / "air.csv").write_text("\n".join([header, *rows]))
    return str(folder / "air.csv")


@pytest.mark.parametrize("band", ["MWIR", "LWIR"])
@pytest.mark.parametrize("name", ["us_standard", "midlat_summer"])
def test_the_size_of_a_product_bounds_that_of_exact_light(tmp_path, name, band):
    """It is 1 to 2.7 times that of clear skies by night and day, and at most 11 % for low clouds,
    whose light is nearly a blackbody's.
    """
    air = clear_air(name)
    write_disc(tmp_path)
    for range_m in (1000, 5000):
        given = {"observer__range_m": range_m, "observer__elevation_deg": 0}
        setting = setting_of(disc(tmp_path, atmosphere__table=name, sensor__band=band, **given))
        for elevation in ELEVATIONS_DEG:
            for sun in (None, SunDirection(45.0, 60.0)):
                exact, stated = shares(setting, air.sky(50.0, elevation, sun))
                assert 1 <= stated / exact <= 2.7, (range_m, elevation, sun)
            exact, stated = shares(setting, cloud(air, elevation))
            assert 0 < exact <= stated < 0.11, (range_m, elevation)


def test_a_table_multiplies_with_a_remark(tmp_path):
    """A user's table does not state its absorbers. The size is that of clear air."""
    folder = lit(tmp_path)
    rows = [f"{R},{x},{0.9**R},0.1" for R in (1, 5) for x in np.linspace(3, 5, 99)]
    header = "range_km,wavelength_um,transmittance,path_radiance_W_m2_sr_um"
    (folder / "air.csv").write_text("\n".join([header, *rows]))
    table = str(folder / "air.csv")
    scenario = disc(folder, atmosphere__table=table, observer__range_m=5000)
    setting, light = setting_of(scenario), clear_air("us_standard").sun(50.0, 45.0)
    sources = [Source("sun", light.name, 1.0, spectrum=light), Source("hot", "400 K", 1.0, 400.0)]
    of_sun, of_hot = shares_of_light(setting, sources)
    assert of_hot == 0
    (remark,) = multiplied_light(sources, np.array([of_sun, of_hot]))
    assert "light of sun (us_standard 45 deg) has crossed air" in remark
    assert "18 % too dark" in remark


@pytest.mark.parametrize("tolerance, reached", [(0.02, False), (0.5, True)])
def test_an_approximation_is_part_of_the_interval(tmp_path, tolerance, reached):
    """Sunlight through a table of air: its error is in the interval, and no tolerance hides it."""
    folder = lit(tmp_path)
    given = {"atmosphere__table": air_table(folder), "observer__range_m": 5000}
    given |= {"background__temperature": 1.0, "target__parameters__temperature": 1}
    result = mi_lcair.contrast(disc(folder, render__tolerance=tolerance, **given))
    (row,) = result.rows
    (remark,) = [text for text in result.remarks if "too dark" in text]
    share = float(remark.split("up to about ")[1].split(" %")[0]) / 100
    assert row.approximated == pytest.approx(share * row.target.value, rel=0.05)
    assert row.half_width >= row.approximated > 0
    assert row.reached is result.reached is reached
    assert ("more paths do not change that" in accuracy(result.as_dict())[1]) is not reached


def test_a_sweep_and_a_flight_have_the_approximation(tmp_path):
    """Their intervals are that of the contrast, and a remark names the light."""
    folder = lit(tmp_path)
    changes = {"atmosphere.table": air_table(folder), "observer.range_m": 5000}
    given = {name.replace(".", "__"): value for name, value in changes.items()}
    (row,) = mi_lcair.contrast(disc(folder, **given)).rows
    conditions = {
        "base": {"scenario": str(folder / "disc.toml")},
        "conditions": {name: [value] for name, value in changes.items()},
        "sampling": {"spp": 256, "resolution": 8},
    }
    with pytest.warns(UserWarning, match="transmittances are multiplied"):
        table = mi_lcair.sweep(conditions).columns()
    assert table["contrast_half_width_W_m2"][0] == pytest.approx(row.half_width, rel=0.05)
    assert row.approximated > 0.5 * row.half_width


@pytest.mark.parametrize(
    "table, air",
    [("us_standard", "us_standard"), ("us_standard", "none"), ("vacuum", "us_standard")],
)
def test_known_light_has_no_remark(tmp_path, table, air):
    setting = setting_of(disc(lit(tmp_path, air), atmosphere__table=table))
    sources = [source for emitter in setting.view.mi.emitters() for source in emitter.spectra()]
    assert any(source.spectrum is not None for source in sources)
    assert multiplied_light(sources, shares_of_light(setting, sources)) == []


@pytest.mark.parametrize("name", ["us_standard", "midlat_summer"])
def test_a_share_does_not_depend_on_the_scale_of_the_light(tmp_path, name):
    """A ground that reflects 5 % of a sky sends light with the same share."""
    write_disc(tmp_path)
    given = {"observer__range_m": 1000, "observer__elevation_deg": 0}
    setting = setting_of(disc(tmp_path, atmosphere__table=name, sensor__band="MWIR", **given))
    light = clear_air(name).sky(50.0, 20.0)
    whole, part = (
        share_of_product(setting, Spectrum("x", light.wavelengths_um, scale * light.radiance), None)
        for scale in (1.0, 0.05)
    )
    assert part == pytest.approx(whole, rel=0.1)


def test_light_that_the_hidden_ground_reflects(tmp_path):
    """A white ground has the share of the sky that it reflects, on the whole path to the sensor."""
    write_disc(tmp_path)
    given = {"observer__range_m": 1000, "observer__elevation_deg": 20, "target__height_m": 50}
    behind = {"background__temperature": None, "background__ground_temperature": 288}
    behind |= {"background__sky": "clear", "background__ground_emissivity": 1e-9}
    air = air_table(tmp_path)
    setting = setting_of(disc(tmp_path, atmosphere__table=air, **given, **behind))
    ((factor, light),) = setting.backdrop.reflected
    along = replace(setting, path=setting.backdrop.path_at(1000.0))
    x = along.path.wavelengths_um
    passed = light.at(x) * along.path.at(x)[0]
    hidden = setting.backdrop.at_sensor(1000.0).at(x)
    share = share_of_product(along, light, None) * factor
    integral = setting.detector.band.integral
    expected = abs(share * integral(x, passed) / integral(x, hidden))
    assert share_of_reflections(setting) == pytest.approx(expected, rel=1e-3)
    assert expected > 0
    black = behind | {"background__ground_emissivity": 1.0}
    black = setting_of(disc(tmp_path, atmosphere__table=air, **given, **black))
    assert share_of_reflections(black) == 0

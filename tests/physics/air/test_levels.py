"""The air by height in other weather, against the formulas that LOWTRAN7 scales its gases with."""

import numpy as np
import pytest

from mi_lcair.errors import InputError
from mi_lcair.physics.air.bands import bands
from mi_lcair.physics.air.clear_air import clear_air
from mi_lcair.physics.air.levels import Weather, levels, model_names, saturation

COLUMNS = bands().columns


def column(air, name):
    return air.densities[:, COLUMNS.index(name)]


@pytest.mark.parametrize("name", model_names())
def test_the_tables_own_weather_changes_nothing(name):
    air = levels(name)
    same = air.with_profile(air.temperature, air.pressure, air.vapour)
    rest = [not name.startswith("aerosol_rural") for name in COLUMNS]
    np.testing.assert_allclose(
        same.densities[:, rest], air.densities[:, rest], rtol=3e-3, atol=1e-12
    )
    np.testing.assert_allclose(
        saturation(air.temperature) * air.humidity, air.vapour, rtol=0.02, atol=1e-3
    )


def test_gases_of_another_temperature_and_pressure():
    """Densities by LOWTRAN7's formula gas * (p/p0)^n * (T0/T)^m, at the ground."""
    air = levels("us_standard", Weather(temperature=300.0, pressure=990.0, humidity=0.8))
    T, p, vapour = 300.0, 990.0 / 1013.25, 0.8 * saturation(300.0)
    assert air.temperature[0] == 300 and air.pressure[0] == pytest.approx(990)
    assert column(air, "h2o_21")[0] == pytest.approx(
        0.1 * vapour * p**0.9681 * (273.15 / T) ** -1.9537, rel=1e-3
    )
    assert column(air, "co2_36")[0] == pytest.approx(
        33.0 * p**1.6705 * (273.15 / T) ** (1 - 2.256), rel=3e-3
    )
    density, water = p * 273.15 / T, 1.2442e-3 * vapour
    assert column(air, "h2o_self")[0] == pytest.approx(29116 * water**2, rel=1e-3)
    assert column(air, "h2o_self_cold")[0] == 0  # above 296 K
    assert column(air, "h2o_foreign")[0] == pytest.approx(
        29116 * water * (density - water), rel=1e-3
    )
    assert column(air, "n2_continuum")[0] == pytest.approx(
        0.781 * density * p * np.sqrt(273.15 / T), rel=2e-3
    )
    assert column(air, "rayleigh")[0] == pytest.approx(density, rel=1e-3)
    assert column(air, "hno3")[0] == column(levels("us_standard"), "hno3")[0]


def test_between_the_levels():
    """Amounts and refraction are straight in logarithms, temperature is; beyond the ends all stay.

    A column that begins between two levels, or ends there, is straight itself.
    """
    air = levels("us_standard")
    heights = np.array([0.313, 4.617, 11.271, 57.3])
    densities, temperature, pressure = air.at(heights)
    np.testing.assert_allclose(temperature, np.interp(heights, air.heights_km, air.temperature))
    for name in ("co2_36", "h2o_21", "rayleigh"):
        expected = np.exp(np.interp(heights, air.heights_km, np.log(column(air, name))))
        np.testing.assert_allclose(densities[:, COLUMNS.index(name)], expected, rtol=1e-9)
    expected = np.exp(np.interp(heights, air.heights_km, np.log(air.pressure)))
    np.testing.assert_allclose(pressure, expected, rtol=1e-9)
    rural = COLUMNS.index("aerosol_fading")
    ends = np.flatnonzero(column(air, "aerosol_fading") > 0)[-1] + np.array([0, 1])
    middle = air.at(np.array([air.heights_km[ends].mean()]))[0][0, rural]
    assert middle == pytest.approx(air.densities[ends[0], rural] / 2) and middle > 0

    index, slope = air.refraction(heights)
    logarithms = np.log(air.refractivity)
    np.testing.assert_allclose(index, np.exp(np.interp(heights, air.heights_km, logarithms)))
    step = 1e-4
    rise = air.refraction(heights + step)[0] - air.refraction(heights - step)[0]
    np.testing.assert_allclose(slope, rise / (2 * step), rtol=1e-6)

    for end, beyond in ((0, -1.0), (-1, 103.0)):
        np.testing.assert_allclose(air.at(np.array([beyond]))[0][0], air.densities[end])
        assert air.refraction(np.array([beyond]))[0] == pytest.approx(air.refractivity[end])


def test_refraction_follows_the_density():
    """n - 1 is proportional to p / T."""
    standard, air = levels("us_standard"), levels("us_standard", Weather(300.0, pressure=990.0))
    denser = air.pressure / standard.pressure * standard.temperature / air.temperature
    np.testing.assert_allclose(air.refractivity, standard.refractivity * denser)


@pytest.mark.parametrize("name", ["us_standard", "midlat_summer"])
def test_classes_of_humidity_of_the_rural_aerosol(name):
    """The table's own classes, and a hand interpolation in ln(1 - humidity) for humid air."""
    table, rural = levels(name), [name.startswith("aerosol_rural") for name in COLUMNS]
    same = table.with_profile()
    largest = table.densities[:, rural].max()
    np.testing.assert_allclose(
        same.densities[:, rural], table.densities[:, rural], atol=3e-3 * largest
    )
    humid = levels(name, Weather(humidity=0.9))
    share = np.log(0.2 / 0.1) / np.log(0.2 / 0.05)  # between the classes of 80 and 95 %
    total = table.densities[0, rural].sum()
    assert column(humid, "aerosol_rural_95")[0] == pytest.approx(share * total, rel=1e-6)
    assert column(humid, "aerosol_rural_80")[0] == pytest.approx((1 - share) * total, rel=1e-6)
    dry = levels(name, Weather(humidity=0.1))
    assert column(dry, "aerosol_rural_40")[0] == pytest.approx(total, rel=1e-6)


def test_carbon_dioxide_of_today():
    more, table = levels("us_standard", Weather(co2=425.0)), levels("us_standard")
    for k, name in enumerate(COLUMNS):
        ratio = 425 / 330 if name.startswith("co2") else 1.0
        np.testing.assert_allclose(more.densities[:, k], ratio * table.densities[:, k])


def test_haze_by_visibility():
    """Extinction at 0.55 um of band_haze.csv; between 10 and 23 km linear in 1 / visibility."""
    table = levels("us_standard")
    total = lambda air, height: sum(
        air.at(np.array([height]))[0][0, k]
        for k, name in enumerate(COLUMNS)
        if name.startswith("aerosol")
    )
    for visibility, height, extinction in (
        (5.0, 0.0, 0.77),
        (5.0, 1.0, 0.77),
        (50.0, 3.0, 0.0146),
        (2.0, 0.0, 1.94),
        (50.0, 1.0, 0.0415),
    ):
        assert total(
            levels("us_standard", Weather(visibility=visibility)), height
        ) == pytest.approx(extinction, rel=2e-3)
    share = (1 / 15 - 1 / 23) / (1 / 10 - 1 / 23)
    expected = 0.158 + share * (0.379 - 0.158)
    assert total(levels("us_standard", Weather(visibility=15.0)), 0.0) == pytest.approx(
        expected, rel=2e-3
    )
    for height in (5.0, 6.0):
        hazy = levels("us_standard", Weather(visibility=5.0))
        assert total(hazy, height) == pytest.approx(total(table, height), rel=1e-12)
    same = levels("us_standard", Weather(visibility=23.0))
    np.testing.assert_allclose(same.densities, table.densities)


def test_weather_dims_and_brightens():
    """Humid, hazy air transmits less; a warmer sky is brighter."""
    clear, humid = (clear_air("us_standard", Weather(humidity=humidity)) for humidity in (0.2, 0.9))
    assert humid.sun(50.0, 30.0).radiance.sum() < 0.9 * clear.sun(50.0, 30.0).radiance.sum()
    warm = clear_air("us_standard", Weather(temperature=300.0))
    assert (
        warm.sky(50.0, 30.0).radiance.sum()
        > 1.2 * clear_air("us_standard").sky(50.0, 30.0).radiance.sum()
    )
    assert levels("us_standard", Weather(humidity=0.97)).humidity.max() <= 0.98 + 1e-9


def test_the_bounds_of_weather():
    for name, lower, upper in (
        ("temperature", 230, 320),
        ("humidity", 0, 0.98),
        ("pressure", 850, 1090),
        ("visibility", 2, 50),
        ("co2", 0, 2000),
    ):
        for bound, outside in ((lower, lower - 0.01), (upper, 1.001 * upper)):
            assert getattr(Weather(**{name: bound}), name) == bound
            with pytest.raises(InputError, match=f"{name} = .*must lie in {lower}..{upper}"):
                Weather(**{name: outside})


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"temperature": 27}, r"\[atmosphere\]: temperature = 27 K; must lie in 230\.\.320"),
        ({"humidity": 45.0}, r"\[atmosphere\]: humidity = 45; must lie in 0\.\.0\.98"),
        ({"visibility": 1.0}, "visibility = 1 km"),
        ({"co2": -1.0}, "co2 = -1 ppmv"),
        ({"pressure": 10.0}, "pressure = 10 hPa"),
    ],
)
def test_impossible_weather_is_refused(given, message):
    with pytest.raises(InputError, match=message):
        Weather(**given)

"""The air by height in other weather, against the formulas that LOWTRAN7 scales its gases with."""

import csv
from functools import cache

import numpy as np
import pytest

from mi_lcair.errors import InputError
from mi_lcair.physics.air.clear_air import clear_air
from mi_lcair.physics.air.levels import (
    EFFECTIVE_RADIUS_M,
    TABLES,
    Weather,
    bands,
    height_along,
    length_between,
    levels,
    lower_end,
    model_names,
    saturation,
)

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


# Coefficients of the band model against the rows of its tables, and phase functions
# ----------------------------------------------------------------------------------

AEROSOLS = [name for name in bands().columns if name.startswith("aerosol")]


@cache
def rows(name):
    with (TABLES / name).open() as file:
        return list(csv.DictReader(line for line in file if line[0] != "#"))


@pytest.mark.parametrize("place", [0, 100, 250, 280, 412])
def test_optical_depth_is_the_sum_over_the_tables_rows(place):
    """(coefficient x amount)^exponent of each absorber that has a row at the wavelength."""
    model = bands()
    amounts = 0.1 + np.arange(len(model.columns)) / 7
    at = [
        row
        for row in rows("band_terms.csv")
        if float(row["wavelength_um"]) == model.wavelengths_um[place]
    ]
    expected = sum(
        (float(row["coefficient"]) * amounts[model.columns.index(row["column"])])
        ** float(row["exponent"])
        for row in at
    )
    assert len(at) > 4
    depths = model.depth(np.array([amounts, -amounts]))
    assert depths.shape == (2, 413) and not depths[1].any()  # rounding below 0 is none
    assert depths[0, place] == pytest.approx(expected, rel=1e-9)
    assert model.transmittance(amounts)[place] == pytest.approx(np.exp(-expected), rel=1e-9)


def test_scattering_and_the_sun():
    model = bands()
    row = next(
        row
        for row in rows("band_terms.csv")
        if row["column"] == "aerosol_rural_70" and float(row["wavelength_um"]) > 3.9
    )
    place = model.wavelengths_um.tolist().index(float(row["wavelength_um"]))
    scattering = model.scattering[model.columns.index("aerosol_rural_70")]
    expected = float(row["coefficient"]) * float(row["scattered_share"])
    assert scattering[place] == pytest.approx(expected, rel=1e-12) and expected > 0
    assert not model.scattering[model.columns.index("h2o_21")].any()
    sun = [float(row["irradiance_W_m2_um"]) for row in rows("band_sun.csv")]
    np.testing.assert_allclose(model.sun, sun)


def test_phase_function_of_molecules():
    """3 / (16 pi) (1 + cos^2), to the few per cent by which molecules are no spheres; integral 1"""
    model = bands()
    column = model.columns.index("rayleigh")
    angles = np.array([0.0, 60.0, 90.0, 180.0])
    phase = model.phase(column, angles)
    assert phase.shape == (4, 413) and np.ptp(phase, axis=1).max() == 0
    spheres = 3 / (16 * np.pi) * (1 + np.cos(np.radians(angles)) ** 2)
    np.testing.assert_allclose(phase[:, 0], spheres, rtol=0.03)
    assert phase[0, 0] - phase[2, 0] == pytest.approx(4 * (phase[1, 0] - phase[2, 0]))
    assert integral(column) == pytest.approx(1, abs=1e-5)


def integral(column):
    """Integral of a phase function over all directions, at the first wavelength."""
    angles = np.linspace(0, 180, 1801)
    phase = bands().phase(column, angles)[:, 0]
    return 2 * np.pi * np.trapezoid(phase * np.sin(np.radians(angles)), np.radians(angles))


@pytest.mark.parametrize("name", AEROSOLS)
def test_phase_functions_of_aerosols(name):
    """The table's rows, straight in logarithms between angles, and an integral of 1 to 4 %."""
    model, column = bands(), bands().columns.index(name)
    of_name = [row for row in rows("band_phase.csv") if row["column"] == name]
    table = {
        (row["wavelength_um"], float(row["angle_deg"])): np.log(float(row["phase_sr"]))
        for row in of_name
    }
    knots = list(dict.fromkeys(row["wavelength_um"] for row in of_name))
    for place in (20, 300):
        wavelength = model.wavelengths_um[place]
        low = [k for k in knots if float(k) <= wavelength][-1]
        high = [*[k for k in knots if float(k) > wavelength], knots[-1]][0]
        share = (wavelength - float(low)) / max(float(high) - float(low), 1e-9)

        def logarithm(angle, low=low, high=high, share=share):
            return (1 - share) * table[low, angle] + share * table[high, angle]

        phase = model.phase(column, np.array([0.0, 10.0, 45.0, 180.0]))[:, place]
        expected = [
            logarithm(0.0),
            logarithm(10.0),
            (logarithm(40.0) + logarithm(50.0)) / 2,
            logarithm(180.0),
        ]
        np.testing.assert_allclose(np.log(phase), expected, atol=1e-9)
    assert integral(column) == pytest.approx(1, abs=0.04)


# Straight lines over a round Earth, against points in the plane of line and Earth's centre
# -----------------------------------------------------------------------------------------

LINES = [(50.0, 1.0, 20e3), (700.0, 8.0, 4000.0), (50.0, 90.0, 2e4), (3000.0, 0.2, 9e4)]


def point(height, elevation_deg, length):
    """Point at a length along a line from (0, radius + height)."""
    angle = np.radians(elevation_deg)
    return np.array([length * np.cos(angle), EFFECTIVE_RADIUS_M + height + length * np.sin(angle)])


def test_the_radius_is_that_of_the_headers_heights():
    assert pytest.approx(1.19 * 6371e3) == EFFECTIVE_RADIUS_M
    for elevation, length, height in ((1, 20e3, 425.3), (10, 5e3, 919.8), (90, 2e4, 20050)):
        assert height_along(50.0, elevation, length) == pytest.approx(height, abs=0.5)


@pytest.mark.parametrize("height, elevation, length", LINES)
def test_heights_along_a_line(height, elevation, length):
    top = np.hypot(*point(height, elevation, length)) - EFFECTIVE_RADIUS_M
    assert height_along(height, elevation, length) == pytest.approx(top, abs=1e-6)
    assert lower_end(top, elevation, length) == pytest.approx(height, abs=1e-6)
    assert length_between(height, top, elevation) == pytest.approx(length, abs=1e-4)


@pytest.mark.parametrize("height, elevation", [(700.0, 8.0), (5000.0, 3.0), (300.0, 90.0)])
def test_a_line_extended_down(height, elevation):
    length = length_between(height, 50.0, -elevation)
    end = np.hypot(*point(height, -elevation, length)) - EFFECTIVE_RADIUS_M
    assert end == pytest.approx(50.0, abs=1e-5)


def test_a_line_that_misses_a_height():
    """A line from 5 km that rises by 0.5 degrees comes down to 4711 m and no further."""
    lowest = (EFFECTIVE_RADIUS_M + 5000) * np.cos(np.radians(0.5)) - EFFECTIVE_RADIUS_M
    assert lowest == pytest.approx(4711, abs=1)
    assert length_between(5000.0, lowest - 0.01, -0.5) == 0.0
    # Downward, the first of the two points at the height counts
    down = length_between(5000.0, 4800.0, -0.5)
    assert 0 < down < (EFFECTIVE_RADIUS_M + 5000) * np.sin(np.radians(0.5))
    assert np.hypot(*point(5000.0, -0.5, down)) - EFFECTIVE_RADIUS_M == pytest.approx(4800)

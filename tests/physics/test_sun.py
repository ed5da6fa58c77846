"""Sunlight: in-band irradiances to three digits, heights, and a user's table."""

import sys

import numpy as np
import pytest

from mi_lcair.errors import InputError
from mi_lcair.physics.air.levels import bands
from mi_lcair.physics.bands import BUNDLED, band
from mi_lcair.physics.sun import (
    ANGLES_DEG,
    air_names,
    clear_sky,
    outside_air,
    sun_position,
    sunlight,
    utc,
)
from tests.matrix import some_of

AIRS = "midlat_summer", "us_standard"
# Irradiances [W m^-2] of the table's own summary, in 3-5 um and 8-12 um
THROUGH_AIR = {
    ("midlat_summer", 5): (1.3204, 0.0294),
    ("midlat_summer", 45): (7.4756, 0.5467),
    ("us_standard", 20): (6.5423, 0.5520),
    ("us_standard", 90): (10.5261, 0.7934),
}


def test_outside_the_air():
    found = [sunlight().in_band_radiance(band(name)) for name in ("MWIR", "LWIR")]
    np.testing.assert_allclose(found, [21.08, 1.091], rtol=5e-4)
    # 0.2-30 um hold nearly all of the solar constant, 1366.1 W m^-2
    total = sunlight().in_band_radiance(band("0.21-29.9"))
    assert total == pytest.approx(1366.1, rel=1e-3)


def test_rows_outside_the_air():
    """Those of ASTM E490 up to 30 um, and in steps of 0.2 % straight lines in logarithms."""
    x, irradiance = outside_air()
    lines = (BUNDLED / "solar_e490.csv").read_text().splitlines()
    rows = np.loadtxt([line for line in lines if line[0] not in "#w"], delimiter=",").T[:2]
    kept = rows[0] <= 30
    places = np.searchsorted(x, rows[0, kept])
    assert np.array_equal(x[places], rows[0, kept]) and x[-1] == 30
    np.testing.assert_allclose(irradiance[places], rows[1, kept], rtol=1e-12)
    assert np.diff(np.log(x)).max() <= 0.002 * (1 + 1e-9) and np.diff(x).min() > 0
    k = int(np.argmax(rows[0] > 10)) - 1  # two rows, and between them
    middle = np.sqrt(rows[0, k] * rows[0, k + 1])
    assert np.interp(middle, x, irradiance) == pytest.approx(
        np.sqrt(rows[1, k] * rows[1, k + 1]), rel=2e-5
    )


@pytest.mark.parametrize("case", THROUGH_AIR)
def test_through_the_air(case):
    found = [sunlight(*case).in_band_radiance(band(name)) for name in ("MWIR", "LWIR")]
    np.testing.assert_allclose(found, THROUGH_AIR[case], rtol=4e-3)


def test_height_of_the_scene():
    """LOWTRAN7's sun at 45 degrees and 1, 3 and 12 km; at 50 m it is 9.26 and 0.726 W/m^2."""
    for height, mwir, lwir in ((1000, 10.85, 0.800), (3000, 13.96, 0.902), (12_000, 19.14, 0.999)):
        light = sunlight("us_standard", 45.0, height_m=height)
        assert light.in_band_radiance(band("MWIR")) == pytest.approx(mwir, rel=2e-3)
        assert light.in_band_radiance(band("LWIR")) == pytest.approx(lwir, rel=2e-3)
    far = sunlight("us_standard", 45.0, 2.0).in_band_radiance(band("MWIR"))
    assert 4 * far == pytest.approx(sunlight("us_standard", 45.0).in_band_radiance(band("MWIR")))


def test_radiance_of_the_disc():
    light = sunlight("us_standard", 45.0)
    disc, amounts = light.scaled(0.5), light.amounts[0]
    assert disc.at(4.0) == pytest.approx(light.at(4.0) / 2)
    # What is left after more air is more than the product of transmittances
    assert (disc.through(amounts) >= disc.radiance**2 / bands().sun * 2 * (1 - 1e-9)).all()


def test_a_users_table_and_the_distance(tmp_path):
    file = tmp_path / "sun.csv"
    file.write_text("# measured\nirradiance_W_m2_um,wavelength_um\n3,3\n3,3.1\n5,3.2\n")
    assert sunlight(file).in_band_radiance(band("3-3.2")) == pytest.approx(0.7)
    plain = file.rename(tmp_path / "sun_without_suffix")
    assert sunlight(plain).in_band_radiance(band("3-3.2")) == pytest.approx(0.7)
    file = plain.rename(file)
    with pytest.raises(InputError, match="distance_au = 2, but a file"):
        sunlight(file, None, 2.0)
    near, far = (sunlight("none", None, d).in_band_radiance(band("MWIR")) for d in (None, 2.0))
    assert near == pytest.approx(4 * far)
    at_one = sunlight("none", None, 1.0)
    assert at_one.in_band_radiance(band("MWIR")) == near and at_one.name == "E490"
    assert sunlight("us_standard", 90).name == "us_standard 90 deg"
    assert np.all(sunlight("us_standard", 90).radiance >= 0)
    assert air_names() == [*AIRS, "none"]


@pytest.mark.parametrize(
    "arguments, name, message",
    [
        (("midlat_summer", 0.5), "MWIR", "0.5 degrees; must lie in 1..90"),
        (("midlat_summer", None), "MWIR", "must lie in 1..90"),
        (("midlat_summer", 90.5), "MWIR", "90.5 degrees; must lie in 1..90"),
        (("midlat", 45.0), "MWIR", "air 'midlat'.*midlat_summer"),
        (("missing.csv",), "MWIR", "missing.csv"),
        (
            ("us_standard", 45.0, None, -1.0),
            "MWIR",
            "height above the ground = -1 m; must lie in 0..100000",
        ),
        (("us_standard", 45.0), "SWIR", "does not cover band SWIR"),
        (("none",), "28-40", "does not cover band 28-40"),
        (("none",), "total", "does not cover band total"),
    ],
)
def test_bad_input(arguments, name, message):
    with pytest.raises(InputError, match=message):
        sunlight(*arguments).in_band_radiance(band(name))


# The daytime sky: LOWTRAN7's own, its interpolation between computed elevations, bad input
# -----------------------------------------------------------------------------------------

DAYTIME_SKY_AIRS = "midlat_summer", "us_standard"
MWIR = band("MWIR")


def daytime_sky(air, sun_elevation_deg=45.0, height_m=50.0):
    return clear_sky(air, sun_elevation_deg, height_m)


def in_band(sky, *where):
    """In-band radiance of a sky's emission and of the sunlight that it scatters."""
    return sum(sky.in_band_components(*where))


@pytest.mark.parametrize(
    "air, thermal, scattered",
    [(DAYTIME_SKY_AIRS[0], 0.979, 0.3340), (DAYTIME_SKY_AIRS[1], 0.648, 0.4174)],
)
def test_lowtran7_toward_the_sun(air, thermal, scattered):
    """Sun at 45 degrees, elevation 35 degrees."""
    radiance = in_band(daytime_sky(air), MWIR, 35.0, 0.0)
    assert radiance == pytest.approx(thermal + scattered, rel=5e-3)


@pytest.mark.parametrize(
    ("sun", "elevations"), some_of([(12.0, (0.7, 7.3, 84.0)), (45.0, (1.2, 3.0, 30.0))], 2)
)
def test_between_the_computed_elevations(sun, elevations):
    """A direction's own ray, also near the horizon and within the aureole of single scattering.

    Below 5 degrees the sky was that at 5 degrees, and by day darker than by night.
    """
    sky = daytime_sky("us_standard", sun, 500.0)
    for elevation in elevations:
        night = sky.air.sky(500.0, elevation).in_band_radiance(MWIR)
        for azimuth in (2.0, 20.0, -60.0, 170.0):
            expected = sky.at(elevation, azimuth).in_band_radiance(MWIR)
            assert in_band(sky, MWIR, elevation, azimuth) == pytest.approx(expected, rel=0.006)
            assert expected > night


def test_both_sides_are_alike_and_the_mean_is_that_of_all_directions():
    sky = daytime_sky("midlat_summer")
    elevation, azimuth = np.meshgrid(np.linspace(0, 90, 91), np.linspace(-180, 180, 145))
    radiance = in_band(sky, MWIR, elevation, azimuth)
    np.testing.assert_allclose(radiance, radiance[::-1])
    np.testing.assert_allclose(radiance[:, -1], radiance[0, -1], rtol=1e-6)
    mean = sky.mean_spectrum().in_band_radiance(MWIR)
    weights = np.cos(np.radians(elevation)) * np.sin(np.radians(elevation))
    assert mean == pytest.approx(np.average(radiance, weights=weights), rel=0.01)


def test_lwir_is_the_sky_of_the_night():
    """Scattered sunlight is at most 0.1 % in LWIR."""
    sky, lwir = daytime_sky("us_standard"), band("LWIR")
    night = sky.air.sky(50.0, 20.0).in_band_radiance(lwir)
    assert in_band(sky, lwir, 20.0, 60.0) == pytest.approx(night, rel=2e-3)


def test_bad_input_of_daytime_sky():
    for name in ("SWIR", "total"):
        with pytest.raises(InputError, match=f"does not cover band {name}"):
            in_band(daytime_sky("us_standard"), band(name), [45.0], [90.0])
    with pytest.raises(InputError, match="air 'tropical'.*us_standard"):
        daytime_sky("tropical")
    with pytest.raises(InputError, match=r"sun = 0.5 degrees; must lie in 1\.\.90"):
        daytime_sky("us_standard", 0.5)
    assert daytime_sky("us_standard", 1.0).sun_elevation_deg == 1.0


def test_the_mean_of_scattered_light_is_that_of_single_directions():
    sky = daytime_sky("midlat_summer")
    x, w = np.polynomial.legendre.leggauss(5)  # over the sine of the elevation
    sines, weights = (x + 1) / 2, w * (x + 1) / 2
    mean = 0.0
    for elevation, weight in zip(np.degrees(np.arcsin(sines)), weights):
        for azimuth in np.arange(5, 180, 10):
            light = sky.components(elevation, azimuth)[1]
            mean += weight / 18 * light.in_band_radiance(MWIR)
    night = clear_sky("midlat_summer").mean_spectrum().in_band_radiance(MWIR)
    assert sky.mean_spectrum().in_band_radiance(MWIR) - night == pytest.approx(mean, rel=1e-3)


@pytest.mark.parametrize("sun, elevation", [(12.0, 5.0), (45.0, 35.0)])
def test_light_scattered_by_an_angle(sun, elevation):
    """As a spectrum and in the band alone, also by angles that no direction there has."""
    sky = daytime_sky("us_standard", sun)
    _, scattered = sky.ring(MWIR, elevation)
    for k in (0, 20, 30, 45):
        light = sky.scattered_by(elevation, ANGLES_DEG[k])
        assert light.in_band_radiance(MWIR) == pytest.approx(scattered[k], rel=2e-3)


# Position of the sun by place and time, against published values
# ---------------------------------------------------------------


def test_against_the_solar_position_algorithm():
    """The example of NREL's algorithm (Reda and Andreas 2004), whose air is thinner."""
    pytest.importorskip("astropy")
    found = sun_position(39.742476, -105.1786, "2003-10-17T12:30:30-07:00")
    assert found.compass_deg == pytest.approx(194.34024, abs=0.005)
    assert found.elevation_deg == pytest.approx(90 - 50.11162, abs=0.005)
    assert found.distance_au == pytest.approx(0.9965422974, abs=1e-5)


@pytest.mark.parametrize("time", ["2026-03-21T07:30:00Z", "2026-06-21T08:30:00Z"])
def test_refraction(time):
    """(n - 1) / tan(elevation), with n - 1 = 77.56e-6 P / T in the infrared, P in hPa, to 1 %."""
    pytest.importorskip("astropy")
    from astropy import coordinates
    from astropy.time import Time

    when, place = Time(time[:-1]), coordinates.EarthLocation.from_geodetic(20, 50)
    airless = coordinates.AltAz(obstime=when, location=place)
    elevation = coordinates.get_sun(when).transform_to(airless).alt.deg
    raised = np.radians(sun_position(50, 20, time).elevation_deg - elevation)
    expected = 77.56e-6 * 1013.25 / 288.15 / np.tan(np.radians(elevation))
    assert raised == pytest.approx(expected, rel=0.01)


def test_far_from_the_tables_of_the_rotation():
    pytest.importorskip("astropy")
    noon = [sun_position(0, 0, f"{year}-03-21T12:00:00Z").elevation_deg for year in (1950, 2090)]
    assert noon == pytest.approx([88, 88], abs=1.5)


@pytest.mark.parametrize(
    "time, message",
    [
        ("noon", "must be a date and time"),
        ("2026-06-21T12:00", "with a time zone"),
        ("1800-01-01T12:00Z", "between the years 1900 and 2100"),
    ],
)
def test_times(time, message):
    with pytest.raises(InputError, match=message):
        utc(time)


def test_without_the_library(monkeypatch):
    monkeypatch.setitem(sys.modules, "astropy", None)
    with pytest.raises(InputError, match=r"pip install 'mi_lcair\[place\]'"):
        sun_position(0, 0, "2026-06-21T12:00Z")

"""The daytime sky between the rows of its tables."""

from dataclasses import replace

import numpy as np
import pytest

from mi_lcair.errors import InputError
from mi_lcair.physics.bands import band
from mi_lcair.physics.sun.daytime_sky import DaytimeSky, daytime_sky, from_sun
from mi_lcair.physics.sun.sunlight import air_mass

AIRS = "midlat_summer", "us_standard"
MWIR = band("MWIR")


def at_rows(sky):
    """Elevations, azimuths and in-band radiances of the tables' rows."""
    table = MWIR.integral(sky.wavelengths_um, sky.thermal[:, None] + sky.scattered)
    return *np.meshgrid(sky.elevations_deg, sky.azimuths_deg, indexing="ij"), table


@pytest.mark.parametrize(
    "air, scattered", [(AIRS[0], (0.3340, 0.0102)), (AIRS[1], (0.4174, 0.0124))]
)
def test_rows(air, scattered):
    sky = daytime_sky(air)
    elevation, azimuth, table = at_rows(sky)
    np.testing.assert_allclose(sky.in_band_radiance(MWIR, elevation, azimuth), table, rtol=1e-6)
    found = MWIR.integral(sky.wavelengths_um, sky.scattered[2, :2])
    np.testing.assert_allclose(found, scattered, atol=6e-5)


@pytest.mark.parametrize("air", AIRS)
def test_a_row_left_out(air):
    sky = daytime_sky(air)
    elevation, azimuth, table = at_rows(sky)
    for k in range(1, len(table) - 1):
        others = np.arange(len(table)) != k
        left = [part[others] for part in (sky.elevations_deg, sky.thermal, sky.scattered)]
        fewer = replace(sky, elevations_deg=left[0], thermal=left[1], scattered=left[2])
        found = fewer.in_band_radiance(MWIR, elevation[k], azimuth[k]) / table[k] - 1
        near = from_sun(elevation[k, 0], 0) < 10.1
        assert abs(found[1:]).max() < 0.031
        assert abs(found[0]) < (0.23 if near else 0.05)


@pytest.mark.parametrize("air", AIRS)
def test_between_the_rows(air):
    """Both sides are alike, azimuths join at the zenith, and nothing leaves the rows' range."""
    sky = daytime_sky(air)
    elevation, azimuth = np.meshgrid(np.linspace(0, 90, 91), np.linspace(-180, 180, 73))
    found = sky.in_band_radiance(MWIR, elevation, azimuth)
    np.testing.assert_allclose(found, found[::-1])
    np.testing.assert_allclose(found[:, -1], found[0, -1])
    table = at_rows(sky)[2]
    assert found.min() == pytest.approx(table.min(), rel=0.01)
    assert found.max() == pytest.approx(table.max(), rel=0.01)
    mean = sky.mean_spectrum().in_band_radiance(MWIR)
    weights = np.cos(np.radians(elevation)) * np.sin(np.radians(elevation))
    assert mean == pytest.approx(np.average(found, weights=weights), rel=0.01)


# A sky in closed form: light that falls by 3 % a degree from the sun, through masses of air
ELEVATIONS = np.array([0.0, 5.0, 15.0, 30.0, 45.0, 60.0, 75.0, 90.0])
AZIMUTHS = np.linspace(0, 180, 13)
X = np.array([3.0, 5.0])


def angle_from_sun(elevation, azimuth):
    """Angle between two unit vectors, of which the sun's lies 45 degrees above the x axis."""
    h, a = np.radians(elevation), np.radians(azimuth)
    to = np.array([np.cos(h) * np.cos(a), np.cos(h) * np.sin(a), np.sin(h)])
    sun = np.array([np.sqrt(0.5), 0, np.sqrt(0.5)])
    across = np.linalg.norm(np.cross(to, sun, axis=0), axis=0)
    return np.degrees(np.arctan2(across, np.tensordot(sun, to, 1)))


def emitted(elevation):
    return 0.2 * air_mass(elevation) ** 0.3


def scattered(elevation, azimuth):
    return 2 * air_mass(elevation) ** 0.6 * np.exp(-0.03 * angle_from_sun(elevation, azimuth))


@pytest.fixture(scope="module")
def falling():
    grid = np.meshgrid(ELEVATIONS, AZIMUTHS, indexing="ij")
    light = scattered(*grid)[..., None] * np.array([1, 0.5])
    return DaytimeSky(
        "falling", ELEVATIONS, AZIMUTHS, X, np.outer(emitted(ELEVATIONS), [1, 3]), light
    )


@pytest.mark.parametrize("elevation, azimuth", [(45, 0), (45, 90), (7, 100), (62, -40), (90, 10)])
def test_angle_from_the_sun(elevation, azimuth):
    assert from_sun(elevation, azimuth) == pytest.approx(
        angle_from_sun(elevation, azimuth), abs=1e-5
    )


@pytest.mark.parametrize("elevation, azimuth", [(40, 60), (10, 100), (3, -70), (70, 120), (90, 5)])
def test_logarithms_are_linear_in_that_of_the_air_mass_and_in_the_angle(
    falling, elevation, azimuth
):
    (values,) = falling.between(falling.thermal, falling.scattered, [elevation], [azimuth])
    light = scattered(elevation, azimuth)
    assert values == pytest.approx(
        [emitted(elevation) + light, 3 * emitted(elevation) + 0.5 * light], rel=1e-7
    )


def test_mean_of_the_sky(falling):
    """The mean over the solid angle times the sine of the elevation, by a fine midpoint rule."""
    square = (np.arange(600) + 0.5) / 600  # squared sine
    azimuth = (np.arange(360) + 0.5) / 2
    directions = np.meshgrid(np.degrees(np.arcsin(np.sqrt(square))), azimuth, indexing="ij")
    expected = falling.between(falling.thermal, falling.scattered, *directions).mean(axis=(0, 1))
    mean = falling.mean_spectrum()
    assert mean.radiance == pytest.approx(expected, rel=1e-3)
    assert np.array_equal(mean.wavelengths_um, X) and mean.name == "daytime sky falling"


def test_bad_input():
    for name in ("LWIR", "total"):
        with pytest.raises(InputError, match=f"does not cover band {name}"):
            daytime_sky("us_standard").in_band_radiance(band(name), [45.0], [90.0])
    with pytest.raises(InputError, match="air 'tropical'.*us_standard"):
        daytime_sky("tropical")

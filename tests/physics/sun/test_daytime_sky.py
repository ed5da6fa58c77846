"""The daytime sky between the rows of its tables."""

from dataclasses import replace

import numpy as np
import pytest

from mi_lcair.errors import InputError
from mi_lcair.physics.bands import band
from mi_lcair.physics.sun.daytime_sky import daytime_sky, from_sun

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


def test_bad_input():
    for name in ("LWIR", "total"):
        with pytest.raises(InputError, match=f"does not cover band {name}"):
            daytime_sky("us_standard").in_band_radiance(band(name), [45.0], [90.0])
    with pytest.raises(InputError, match="air 'tropical'.*us_standard"):
        daytime_sky("tropical")

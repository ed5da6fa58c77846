"""The daytime sky: LOWTRAN7's own, its interpolation between computed elevations, bad input."""

import numpy as np
import pytest

from mi_lcair.errors import InputError
from mi_lcair.physics.bands import band
from mi_lcair.physics.sun.daytime_sky import ANGLES_DEG, clear_sky

AIRS = "midlat_summer", "us_standard"
MWIR = band("MWIR")


def daytime_sky(air, sun_elevation_deg=45.0, height_m=50.0):
    return clear_sky(air, sun_elevation_deg, height_m)


def in_band(sky, *where):
    """In-band radiance of a sky's emission and of the sunlight that it scatters."""
    return sum(sky.in_band_components(*where))


@pytest.mark.parametrize(
    "air, thermal, scattered", [(AIRS[0], 0.979, 0.3340), (AIRS[1], 0.648, 0.4174)]
)
def test_lowtran7_toward_the_sun(air, thermal, scattered):
    """Sun at 45 degrees, elevation 35 degrees."""
    radiance = in_band(daytime_sky(air), MWIR, 35.0, 0.0)
    assert radiance == pytest.approx(thermal + scattered, rel=5e-3)


@pytest.mark.parametrize("sun", [12.0, 45.0])
def test_between_the_computed_elevations(sun):
    """A direction's own ray, also near the horizon and within the aureole of single scattering.

    Below 5 degrees the sky was that at 5 degrees, and by day darker than by night.
    """
    sky = daytime_sky("us_standard", sun, 500.0)
    for elevation in (0.7, 1.2, 3.0, 7.3, 30.0, 84.0):
        for azimuth in (2.0, 20.0, -60.0, 170.0):
            light = sky.at(elevation, azimuth)
            expected = light.in_band_radiance(MWIR)
            assert in_band(sky, MWIR, elevation, azimuth) == pytest.approx(expected, rel=0.006)
            night = sky.air.sky(500.0, elevation).in_band_radiance(MWIR)
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


def test_bad_input():
    for name in ("SWIR", "total"):
        with pytest.raises(InputError, match=f"does not cover band {name}"):
            in_band(daytime_sky("us_standard"), band(name), [45.0], [90.0])
    with pytest.raises(InputError, match="air 'tropical'.*us_standard"):
        daytime_sky("tropical")
    with pytest.raises(InputError, match=r"sun at 0.5 degrees; must lie in 1\.\.90"):
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

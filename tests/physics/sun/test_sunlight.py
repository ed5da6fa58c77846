"""Sunlight: in-band irradiances to three digits, the air's rows left out, and a user's table."""

import numpy as np
import pytest

from mi_lcair.errors import InputError
from mi_lcair.physics.bands import band
from mi_lcair.physics.spectrum import BUNDLED
from mi_lcair.physics.sun.sunlight import (
    air_mass,
    air_names,
    air_table,
    outside_air,
    sunlight,
    transmitted,
)

AIRS = "midlat_summer", "us_standard"
# Irradiances [W m^-2] of the table's own summary, in 3-5 um and 8-12 um
THROUGH_AIR = {
    ("midlat_summer", 5): (1.3204, 0.0294),
    ("midlat_summer", 45): (7.4756, 0.5467),
    ("us_standard", 20): (6.5423, 0.5520),
    ("us_standard", 90): (10.5261, 0.7934),
}


def test_outside_the_air():
    found = [sunlight().in_band_irradiance(band(name)) for name in ("MWIR", "LWIR")]
    np.testing.assert_allclose(found, [21.08, 1.091], rtol=5e-4)
    # 0.2-30 um hold nearly all of the solar constant, 1366.1 W m^-2
    total = sunlight().in_band_irradiance(band("0.21-29.9"))
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


@pytest.mark.parametrize("elevation, mass", [(90, 0.99971), (30, 1.9942), (10, 5.586), (0, 37.92)])
def test_air_mass(elevation, mass):
    """1 at the zenith, about 2 at 30 degrees, 38 at the horizon (Kasten and Young 1989)."""
    assert air_mass(elevation) == pytest.approx(mass, rel=1e-3)


def test_between_elevations_the_depth_is_a_power_of_the_air_mass():
    """Logarithms of optical depth and of air mass are on a line, which a spline keeps."""
    elevations = np.array([5.0, 10.0, 20.0, 45.0, 90.0])
    depth, power = np.array([0.01, 0.3, 2.0]), np.array([1.0, 0.8, 0.6])
    transmittance = np.exp(-depth * air_mass(elevations)[:, None] ** power)
    for elevation in (7.0, 33.0, 88.0):
        expected = np.exp(-depth * air_mass(elevation) ** power)
        np.testing.assert_allclose(
            transmitted(elevations, transmittance, elevation), expected, rtol=1e-9
        )
    # What is printed as 0 or 1 stays finite
    ends = transmitted(elevations, np.outer(np.ones(5), [0.0, 1.0]), 33.0)
    np.testing.assert_allclose(ends, [1e-13, 1], rtol=1e-6)


@pytest.mark.parametrize("case", THROUGH_AIR)
def test_through_the_air(case):
    found = [sunlight(*case).in_band_irradiance(band(name)) for name in ("MWIR", "LWIR")]
    np.testing.assert_allclose(found, THROUGH_AIR[case], rtol=5e-4, atol=5e-5)


@pytest.mark.parametrize("air", AIRS)
def test_a_row_left_out(air):
    elevations, x, transmittance, irradiance = air_table(air)
    sun = irradiance[-1] / np.where(transmittance[-1] > 0, transmittance[-1], 1)
    for name in ("MWIR", "LWIR"):
        weights = band(name).row_weights(x)
        for k in range(1, len(elevations) - 1):
            others = np.arange(len(elevations)) != k
            T = transmitted(elevations[others], transmittance[others], elevations[k])
            error = 0.006 if elevations[k] == 10 else 0.0012 if elevations[k] == 20 else 2e-4
            assert (sun * T) @ weights == pytest.approx(irradiance[k] @ weights, rel=error)


def test_a_users_table_and_the_distance(tmp_path):
    file = tmp_path / "sun.csv"
    file.write_text("# measured\nirradiance_W_m2_um,wavelength_um\n3,3\n3,3.1\n5,3.2\n")
    assert sunlight(file).in_band_irradiance(band("3-3.2")) == pytest.approx(0.7)
    with pytest.raises(InputError, match="distance_au = 2, but a file"):
        sunlight(file, None, 2.0)
    near, far = (sunlight("none", None, d).in_band_irradiance(band("MWIR")) for d in (None, 2.0))
    assert near == pytest.approx(4 * far)
    at_one = sunlight("none", None, 1.0)
    assert at_one.in_band_irradiance(band("MWIR")) == near and at_one.name == "E490"
    assert sunlight("us_standard", 90).name == "us_standard 90 deg"
    assert np.all(sunlight("us_standard", 90).irradiance >= 0)
    assert air_names() == [*AIRS, "none"]


@pytest.mark.parametrize(
    "arguments, name, message",
    [
        (("midlat_summer", 3.0), "MWIR", "3.0 degrees must lie in 5..90"),
        (("midlat_summer", None), "MWIR", "must lie in 5..90"),
        (("midlat_summer", 90.5), "MWIR", "90.5 degrees must lie in 5..90"),
        (("midlat", 45.0), "MWIR", "air 'midlat'.*midlat_summer"),
        (("missing.csv",), "MWIR", "missing.csv"),
        (("us_standard", 45.0), "SWIR", "does not cover band SWIR"),
        (("none",), "28-40", "does not cover band 28-40"),
        (("none",), "total", "does not cover band total"),
    ],
)
def test_bad_input(arguments, name, message):
    with pytest.raises(InputError, match=message):
        sunlight(*arguments).in_band_irradiance(band(name))

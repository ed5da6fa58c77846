"""Sunlight: in-band irradiances to three digits, heights, and a user's table."""

import numpy as np
import pytest

from mi_lcair.errors import InputError
from mi_lcair.physics.air.bands import bands
from mi_lcair.physics.bands import band
from mi_lcair.physics.spectrum import BUNDLED
from mi_lcair.physics.sun.sunlight import air_names, outside_air, sunlight

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
        (("midlat_summer", 0.5), "MWIR", "0.5 degrees must lie in 1..90"),
        (("midlat_summer", None), "MWIR", "must lie in 1..90"),
        (("midlat_summer", 90.5), "MWIR", "90.5 degrees must lie in 1..90"),
        (("midlat", 45.0), "MWIR", "air 'midlat'.*midlat_summer"),
        (("missing.csv",), "MWIR", "missing.csv"),
        (("us_standard", 45.0, None, -1.0), "MWIR", "height -1 m; must lie in 0..100000 m"),
        (("us_standard", 45.0), "SWIR", "does not cover band SWIR"),
        (("none",), "28-40", "does not cover band 28-40"),
        (("none",), "total", "does not cover band total"),
    ],
)
def test_bad_input(arguments, name, message):
    with pytest.raises(InputError, match=message):
        sunlight(*arguments).in_band_radiance(band(name))

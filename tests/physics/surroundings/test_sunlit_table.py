"""A user's sky by day, by elevation and azimuth from the sun: the clear sky, written as a table."""

import numpy as np
import pytest

from mi_lcair.errors import InputError
from mi_lcair.physics.bands import band
from mi_lcair.physics.sky import mean_nodes, spectrum
from mi_lcair.physics.surroundings import Ground, surroundings

MWIR = band("MWIR")
SUN = 40.0  # elevation of the sun [degrees]
COLUMNS = "elevation_deg,azimuth_deg,wavelength_um,radiance_W_m2_sr_um\n"
ELEVATIONS = 0.5, 1.5, 4, 8, 15, 25, 35, 40, 45, 60, 75, 90
AZIMUTHS = 0, 2, 5, 9, 15, 25, 40, 60, 90, 130, 180
WAVELENGTHS = np.arange(2.98, 5.05, 0.02)


def write(path, elevations=ELEVATIONS, azimuths=AZIMUTHS, radiance=None):
    """Write a sky, the clear one unless `radiance` gives it by elevation and azimuth."""
    if radiance is None:
        sky = surroundings("clear", sun_elevation_deg=SUN).sky

        def radiance(elevation, azimuth):
            return sky.at(elevation, azimuth).at(WAVELENGTHS)

    rows = [
        f"{e},{a},{x:.2f},{L:.8g}"
        for e in elevations
        for a in azimuths
        for x, L in zip(WAVELENGTHS, np.broadcast_to(radiance(e, a), WAVELENGTHS.shape))
    ]
    path.write_text(COLUMNS + "\n".join(rows) + "\n", encoding="utf-8")
    return str(path)


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    return write(tmp_path_factory.mktemp("sky") / "sky.csv")


def test_it_is_the_sky_that_was_written(file):
    """Within the table's interpolation, on both sides of the sun."""
    table, clear = (surroundings(sky, sun_elevation_deg=SUN) for sky in (file, "clear"))
    for elevation, azimuth in (
        (0.5, 30),
        (25, 40),
        (25, -40),
        (40, 320),
        (6, 75),
        (52, 3.5),
        (83, 110),
    ):
        expected = clear.at(elevation, azimuth).in_band_radiance(MWIR)
        for whole in (table, table.sky):
            light = whole.at(elevation, azimuth)
            assert light.in_band_radiance(MWIR) == pytest.approx(expected, rel=1.5e-2)
        assert table.in_band_radiance(MWIR, elevation, azimuth) == pytest.approx(expected, rel=2e-2)
        by_angle = table.sky.in_band_by_angle(
            MWIR, np.array([elevation]), clear.sky.from_sun([elevation], azimuth)
        )
        assert sum(by_angle)[0] == pytest.approx(
            table.in_band_radiance(MWIR, elevation, azimuth), rel=1e-6
        )


def test_its_rows(file):
    """On both sides of the sun, with the least over the azimuth as a part of its own."""
    table, clear = (surroundings(sky, sun_elevation_deg=SUN).sky for sky in (file, "clear"))
    rows = np.array([clear.at(25, azimuth).at(WAVELENGTHS) for azimuth in AZIMUTHS])
    least = rows.min(axis=0)
    for azimuth in (-40, 40, 320):
        wanted = rows[AZIMUTHS.index(40)]
        np.testing.assert_allclose(table.at(25, azimuth).radiance, wanted, rtol=1e-6)
        found = table.in_band_components(MWIR, 25, azimuth)
        expected = [MWIR.integral(WAVELENGTHS, part) for part in (least, wanted - least)]
        np.testing.assert_allclose(found, expected, rtol=1e-5)
    np.testing.assert_allclose(table.at(25).radiance, rows[0], rtol=1e-6)
    scattered = table.scattered_by(25, 60).radiance
    np.testing.assert_allclose(scattered, table.mean(25).radiance - least, atol=1e-7)


def test_ground_reflects_its_mean(tmp_path):
    """Radiance 2 + cos(azimuth) has the mean 2 at every elevation."""
    azimuths = np.arange(0, 181, 2.0)
    path = write(tmp_path / "sky.csv", (0, 90), azimuths, lambda e, a: 2 + np.cos(np.radians(a)))
    around = surroundings(path, Ground(250.0, 0.25), SUN)
    lit = surroundings("200", Ground(250.0, 0.25), SUN).reflected[-1]  # by the sun
    assert around.reflected[-1].in_band_radiance(MWIR) == lit.in_band_radiance(MWIR)
    of_sky = sum(light.at(4.0) for light in around.reflected[:-1])
    assert of_sky == pytest.approx(0.75 * 2 * mean_nodes()[1].sum(), rel=1e-4)


def test_the_last_azimuth_is_that_of_all_beyond(tmp_path):
    """Also below the first elevation. Logarithms are linear between the azimuths."""
    path = write(tmp_path / "sky.csv", (10, 60), (20, 80), lambda e, a: np.exp(a / 20) / 10)
    sky = surroundings(path, sun_elevation_deg=SUN)
    width = MWIR.integral(WAVELENGTHS, np.ones(len(WAVELENGTHS)))
    for azimuth, logarithm in ((0, 1), (20, 1), (51, 2.55), (80, 4), (180, 4), (-179, 4)):
        expected = width * np.exp(logarithm) / 10
        found = sky.in_band_radiance(MWIR, np.array([1.0, 30.0, 90.0]), azimuth)
        assert found == pytest.approx(np.full(3, expected), rel=2e-4), azimuth


@pytest.mark.parametrize(
    "given, message",
    [
        ({"azimuths": (0, 90, 181)}, "line 210: azimuth_deg = 181; must lie in 0..180"),
        ({"azimuths": (30,)}, "needs elevation_deg and two azimuth_deg or more"),
        ({"elevations": (5, 91)}, "elevation_deg = 91; must lie in 0..90"),
    ],
)
def test_bad_tables(given, message, tmp_path):
    path = write(tmp_path / "sky.csv", **{"radiance": lambda e, a: 1.0, **given})
    with pytest.raises(InputError, match=message):
        surroundings(path, sun_elevation_deg=SUN)


def test_it_needs_a_sun_and_a_band_and_is_no_spectrum(file, tmp_path):
    with pytest.raises(InputError, match="has azimuths from the sun; give the sun"):
        surroundings(file)
    with pytest.raises(InputError, match="has azimuth_deg; it serves as the sky of surroundings"):
        spectrum(file, 10)
    with pytest.raises(InputError, match="does not cover band LWIR"):
        surroundings(file, sun_elevation_deg=SUN).in_band_radiance(band("LWIR"), 10.0)
    with open(file, encoding="utf-8") as lines:
        short = "".join(lines.readlines()[: -len(WAVELENGTHS)])
    (tmp_path / "short.csv").write_text(short, encoding="utf-8")
    with pytest.raises(
        InputError,
        match="131 spectra for 11 azimuth_deg and 12 elevation_deg; each pair must have one",
    ):
        surroundings(str(tmp_path / "short.csv"), sun_elevation_deg=SUN)

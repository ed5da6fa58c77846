"""Tabulated spectra: bundled skies against their stated in-band values, and damaged files."""

import csv
import os

import numpy as np
import pytest

from mi_lcair.errors import InputError
from mi_lcair.physics.air.levels import Weather
from mi_lcair.physics.bands import BUNDLED, band
from mi_lcair.physics.blackbody import in_band_radiance, spectral_radiance
from mi_lcair.physics.sky import (
    air_mass,
    check_brightness,
    has_elevations,
    mean_nodes,
    sky_names,
    spectrum,
)
from tests.physics.air.test_tape7 import (
    LWIR,
    MWIR,
    block,
    file,  # noqa: F401
    planck,  # noqa: F401
)

LWIR_AT_3_KM = 4.33269  # LOWTRAN7, W m^-2 sr^-1
BANDS = {"3-5": "MWIR", "8-12": "LWIR"}


def summary():
    """The skies in the tables' summary: name, elevation, band and radiance."""
    lines = [
        line for line in (BUNDLED / "inband_summary.csv").read_text().splitlines() if line[0] != "#"
    ]
    return [
        (
            f"{row['atmosphere']}_{row['sky']}",
            float(row["elevation_deg"]),
            BANDS[row["band_um"]],
            float(row["radiance_W_m2_sr"]),
        )
        for row in csv.DictReader(lines)
        if row["kind"] == "sky" and row["imult"] == "0"
    ]


@pytest.mark.slow
def test_every_sky_has_its_stated_radiance():
    """Radiances of cloudy skies agree with all four decimals, those of clear skies within 0.4 %."""
    rows = summary()
    assert {name for name, *_ in rows} == set(sky_names()) and len(rows) == 8 * 11 * 2
    for name, elevation, band_name, radiance in rows:
        assert spectrum(name, elevation).in_band_radiance(band(band_name)) == pytest.approx(
            radiance, abs=4e-3 * radiance if name.endswith("clear") else 6e-5
        ), (name, elevation)


def test_between_elevations_of_a_cloudy_sky():
    """ln(-ln(1 - L/B)) is linear in ln(air mass), and outside the rows the nearest one is used."""
    name, x = "us_standard_stratus", 10.0
    low, high, middle = (spectrum(name, angle).at(x) for angle in (15, 25, 20))
    warmest = max(
        float(brightness_temperature_at(spectrum(name, 0.5), wavelength))
        for wavelength in spectrum(name, 0.5).wavelengths_um
    )
    black = 1.002 * spectral_radiance(x, warmest)
    share = np.log(air_mass(15) / air_mass(20)) / np.log(air_mass(15) / air_mass(25))
    depths = [np.log(-np.log(1 - radiance / black)) for radiance in (low, high)]
    expected = black * (1 - np.exp(-np.exp(depths[0] + share * (depths[1] - depths[0]))))
    assert middle == pytest.approx(float(expected), rel=1e-4)
    # The row comes back through exp and log, whose last digit depends on the processor
    lowest = spectrum(name, 0.5).radiance
    np.testing.assert_allclose(spectrum(name, 0.1).radiance, lowest, rtol=1e-12)


def brightness_temperature_at(sky, wavelength):
    return 14387.76877 / wavelength / np.log1p(1.191042972e8 / wavelength**5 / sky.at(wavelength))


def test_a_table_of_clear_sky_is_interpolated_as_air(tmp_path):
    """At 7, 10 and 12 degrees between rows at 5 and 15 it is within 1 %, not 5 to 8 % as before."""
    rows, file = (0.5, 5, 15, 25, 90), tmp_path / "sky.csv"
    lines = ["elevation_deg,wavelength_um,radiance_W_m2_sr_um"]
    for elevation in rows:
        sky = spectrum("us_standard_clear", elevation)
        lines += [f"{elevation},{x},{L}" for x, L in zip(sky.wavelengths_um, sky.radiance)]
    file.write_text("\n".join(lines))
    for elevation in (7, 10, 12, 60):
        for name in BANDS.values():
            expected = spectrum("us_standard_clear", elevation).in_band_radiance(band(name))
            computed = spectrum(file, elevation).in_band_radiance(band(name))
            assert computed == pytest.approx(expected, rel=0.01)


def test_rows_of_a_table_are_kept(tmp_path):
    """At an elevation of the table its row is the spectrum; a single row is that of the sky."""
    file, header = tmp_path / "sky.csv", "elevation_deg,wavelength_um,radiance_W_m2_sr_um\n"
    file.write_text(header + "10,4,0.3\n10,4.1,0\n")
    for elevation in (3, 10, 80):
        assert spectrum(file, elevation).radiance.tolist() == [0.3, 0]
    file.write_text(header + "10,4,0.3\n10,4.1,0\n40,4,0.1\n40,4.1,0.7\n")
    assert spectrum(file, 10).radiance.tolist() == [0.3, 0]
    assert spectrum(file, 40).radiance.tolist() == [0.1, 0.7]
    assert np.all(np.isfinite(spectrum(file, 20).radiance))


def test_a_clear_sky_depends_on_height_and_weather():
    """LOWTRAN7's sky at 3 km and 10 degrees; a table for 50 m was 53 % too bright there."""
    sky = spectrum("us_standard_clear", 10, height_m=3000.0)
    assert sky.in_band_radiance(band("LWIR")) == pytest.approx(LWIR_AT_3_KM, rel=5e-3)
    warm = spectrum("us_standard_clear", 10, weather=Weather(temperature=300.0))
    assert warm.in_band_radiance(band("LWIR")) > 1.1 * spectrum(
        "us_standard_clear", 10
    ).in_band_radiance(band("LWIR"))


def test_a_file_of_ones_own(tmp_path):
    """A spectrum that rises from 0 at 3 um to 2 at 5 um has an in-band radiance of 2 W m^-2 sr^-1.

    With a response from 0 at 4 um to 1 at 5 um, it is int (l - 3)(l - 4) dl = 5/6.
    """
    path = tmp_path / "ramp.csv"
    path.write_text(
        "# made by hand\nwavelength_um,radiance_W_m2_sr_um\n"
        + "".join(f"{3 + k / 20},{k / 20}\n" for k in range(41))
    )
    assert spectrum(path).in_band_radiance(band("MWIR")) == pytest.approx(2, rel=1e-12)
    assert spectrum(path).at(3.51) == pytest.approx(0.51)
    response = tmp_path / "response.csv"
    response.write_text("wavelength_um,response\n4,0\n5,1\n")
    assert spectrum(path).in_band_radiance(band(response)) == pytest.approx(5 / 6, rel=1e-9)


def test_a_sky_in_another_unit_is_remarked_upon(tmp_path):
    """Per metre in place of per micrometre: 10^6 times as bright as a blackbody of 300 K."""
    path, x = tmp_path / "sky.csv", np.linspace(8, 12, 201)
    for factor in (1, 1e6):
        rows = zip(x, factor * spectral_radiance(x, 300.0))
        lines = (f"{wavelength:.6f},{radiance:.9g}" for wavelength, radiance in rows)
        path.write_text("\n".join(["wavelength_um,radiance_W_m2_sr_um", *lines]))
        if factor == 1:
            check_brightness(path)  # warnings are errors
            continue
        ratio = in_band_radiance(band("LWIR"), 300.0) / in_band_radiance(band("LWIR"), 400.0)
        with pytest.warns(
            UserWarning, match=f"is {1e6 * ratio:.2g} times as bright".replace("+", "[+]")
        ):
            check_brightness(path)


@pytest.mark.parametrize(
    "name, elevation, message",
    [
        ("us_standard_fog", 5, "unknown sky table 'us_standard_fog'; known: us_standard"),
        ("us_standard_clear", None, "elevation_deg = None"),
        ("us_standard_clear", 91, "elevation_deg = 91"),
        ("missing.csv", None, "cannot be read"),
    ],
)
def test_unusable_choice(name, elevation, message):
    with pytest.raises(InputError, match=message):
        spectrum(name, elevation)


@pytest.mark.parametrize(
    "text, message",
    [
        ("", "found: nothing"),
        ("wavelength_um,radiance\n3,1\n", "must name wavelength_um and radiance_W_m2_sr_um"),
        (
            "wavelength_um,radiance_W_m2_sr_um\n3,1\n4,x\n",
            "line 3: 'x' in column 'radiance_W_m2_sr_um' is not a number",
        ),
        ("wavelength_um,radiance_W_m2_sr_um\n3,1\n4,-1\n", "line 3: .* = -1; must lie in 0..1e"),
        ("wavelength_um,radiance_W_m2_sr_um\n3,1\n", "two rows"),
        ("elevation_deg,wavelength_um,radiance_W_m2_sr_um\n", "no rows of data"),
        ("wavelength_um,radiance_W_m2_sr_um\n4,1\n3,1\n", "rising"),
        (
            "elevation_deg,wavelength_um,radiance_W_m2_sr_um\n0,3,1\n0,4,1\n5,3,1\n5,5,1\n",
            "same wavelengths",
        ),
        (
            "elevation_deg,wavelength_um,radiance_W_m2_sr_um\n95,3,1\n95,4,1\n",
            "line 2: elevation_deg = 95; must lie in 0..90",
        ),
    ],
)
def test_unusable_file(tmp_path, text, message):
    path = tmp_path / "s.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=message):
        spectrum(path, 5)


def test_an_elevation_where_there_is_none(tmp_path):
    path = tmp_path / "s.csv"
    path.write_text("wavelength_um,radiance_W_m2_sr_um\n3,1\n4,1\n")
    with pytest.raises(InputError, match="no column elevation_deg"):
        spectrum(path, 5)


@pytest.mark.parametrize("name", ["SWIR", "total", "4-9", "11-15"])
def test_a_band_that_the_table_does_not_cover(name):
    with pytest.raises(InputError, match="does not cover band .*; it has 2.9985-5, 6.993"):
        spectrum("us_standard_clear", 5).in_band_radiance(band(name))


def test_which_sources_have_elevations(file):
    """A bundled sky has; a tape7 is one line of sight, whose blocks have one range."""
    assert has_elevations("us_standard_clear")
    path = file(block(MWIR, TOTAL_RAD=planck(MWIR, 250)))
    assert not has_elevations(path)
    assert spectrum(path).at(4.0) == pytest.approx(planck(2500, 250) * 2500**2, rel=1e-3)
    with pytest.raises(InputError, match="lines of sight of different ranges"):
        spectrum(file(block(MWIR), block(LWIR, range_km=3)))


def test_a_file_that_was_edited_is_read_again(tmp_path):
    path = tmp_path / "sky.csv"
    for value in (1, 2):
        path.write_text(f"wavelength_um,radiance_W_m2_sr_um\n3,{value}\n5,{value}\n")
        os.utime(path, ns=(value, value))
        assert spectrum(path).at(4.0) == value


@pytest.mark.parametrize("elevation, mass", [(90, 0.99971), (30, 1.9942), (10, 5.586), (0, 37.92)])
def test_air_mass(elevation, mass):
    """1 at the zenith, about 2 at 30 degrees, 38 at the horizon (Kasten and Young 1989)."""
    assert air_mass(elevation) == pytest.approx(mass, rel=1e-3)


def test_nodes_of_the_mean_over_the_sky():
    """Weighted by the cosine to the zenith, sines have the mean 2/3 and their squares 1/2."""
    elevations, weights = mean_nodes()
    sines = np.sin(np.radians(elevations))
    for power, mean in ((0, 1), (1, 2 / 3), (2, 1 / 2), (5, 2 / 7)):
        assert weights @ sines**power == pytest.approx(mean, rel=1e-12)

"""Tabulated spectra: bundled skies against their stated in-band values, and damaged files."""

import csv
import os

import numpy as np
import pytest

from mi_lcair.errors import InputError
from mi_lcair.physics import spectrum as module
from mi_lcair.physics.bands import band
from mi_lcair.physics.spectrum import has_elevations, sky_names, spectrum
from tests.physics.test_tape7 import LWIR, MWIR, block, file, planck  # noqa: F401

BANDS = {"3-5": "MWIR", "8-12": "LWIR"}


def summary():
    """The skies in the tables' summary: name, elevation, band and radiance."""
    lines = [
        line
        for line in (module.BUNDLED / "inband_summary.csv").read_text().splitlines()
        if line[0] != "#"
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
    """The radiances agree with all four decimals of the summary."""
    rows = summary()
    assert {name for name, *_ in rows} == set(sky_names()) and len(rows) == 8 * 11 * 2
    for name, elevation, band_name, radiance in rows:
        assert spectrum(name, elevation).in_band_radiance(band(band_name)) == pytest.approx(
            radiance, abs=6e-5
        ), (name, elevation)


def test_between_elevations():
    low, high, middle = (spectrum("us_standard_clear", angle) for angle in (15, 25, 20))
    np.testing.assert_allclose(middle.radiance, (low.radiance + high.radiance) / 2, rtol=1e-12)
    np.testing.assert_array_equal(
        spectrum("us_standard_clear", 0.1).radiance, spectrum("us_standard_clear", 0.5).radiance
    )


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
        ("wavelength_um,radiance_W_m2_sr_um\n3,1\n4,-1\n", "line 3: .* must be 0 or more"),
        ("wavelength_um,radiance_W_m2_sr_um\n3,1\n", "two rows"),
        ("elevation_deg,wavelength_um,radiance_W_m2_sr_um\n", "no rows of data"),
        ("wavelength_um,radiance_W_m2_sr_um\n4,1\n3,1\n", "rising"),
        (
            "elevation_deg,wavelength_um,radiance_W_m2_sr_um\n0,3,1\n0,4,1\n5,3,1\n5,5,1\n",
            "same wavelengths",
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


@pytest.mark.parametrize("name", ["SWIR", "total", "4-9", "11-13"])
def test_a_band_that_the_table_does_not_cover(name):
    with pytest.raises(InputError, match="does not cover band .*; it has 2.9985-5, 8-12.0482 um"):
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

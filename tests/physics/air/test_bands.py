"""Coefficients of the band model against the rows of its tables, and phase functions."""

import csv
from functools import cache

import numpy as np
import pytest

from mi_lcair.physics.air.bands import TABLES, bands

AEROSOLS = [name for name in bands().columns if name.startswith("aerosol")]


@cache
def rows(name):
    with (TABLES / name).open() as file:
        return list(csv.DictReader(line for line in file if line[0] != "#"))


@pytest.mark.parametrize("place", [0, 100, 250, 352])
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
    assert depths.shape == (2, 353) and not depths[1].any()  # rounding below 0 is none
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
    assert phase.shape == (4, 353) and np.ptp(phase, axis=1).max() == 0
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

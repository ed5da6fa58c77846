"""Planck's law against a table, mpmath, colour-science and the Stefan-Boltzmann law."""

import json
import subprocess
import sys
import warnings
from pathlib import Path

import drjit as dr
import mpmath
import numpy as np
import pytest
from drjit.llvm.ad import Array3f, Float, Float64, TensorXf, UInt32
from hypothesis import given, settings
from hypothesis import strategies as st

from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import (
    brightness_temperature,
    in_band_radiance,
    in_band_slope,
    spectral_radiance,
)

TABLE = json.loads((Path(__file__).parents[1] / "data" / "in_band_radiance.json").read_text())
NAMED = ["SWIR", "MWIR", "LWIR"]
C1 = 2 * 6.62607015e-34 * 299792458**2 * 1e24  # W m^-2 sr^-1 um^4: 2 h c^2, CODATA 2018
C2 = 6.62607015e-34 * 299792458 / 1.380649e-23 * 1e6  # um K: h c / k
SIGMA = 5.670374419e-8  # W m^-2 K^-4, CODATA 2018 as printed: 10 digits


def exact(limits, temperature):
    """In-band radiance in mpmath, by a series and not by quadrature.

    The series is that of the integral of Planck's law (Widger and Woodall 1976),
    int_x^inf t^3 / (e^t - 1) dt = sum_n e^(-n x) (x^3/n + 3 x^2/n^2 + 6 x/n^3 + 6/n^4), here as
    polylogarithms.
    """

    def longer_x(wavelength):
        x = mpmath.mpf(C2) / (wavelength * temperature)
        z = mpmath.exp(-x)  # the first polylogarithm is -ln(1 - z)
        return -(x**3) * mpmath.log1p(-z) + sum(
            f * x ** (4 - n) * mpmath.polylog(n, z) for n, f in ((2, 3), (3, 6), (4, 6))
        )

    with mpmath.workdps(30):
        temperature = mpmath.mpf(temperature)
        return C1 * (temperature / C2) ** 4 * (longer_x(limits[1]) - longer_x(limits[0]))


@pytest.mark.parametrize("name", NAMED)
def test_in_band_radiance_agrees_with_the_table(name):
    column = TABLE["columns"].index(name)
    temperatures = np.array([float(row[0]) for row in TABLE["rows"]])
    expected = np.array([float(row[column]) for row in TABLE["rows"]])
    np.testing.assert_allclose(in_band_radiance(band(name), temperatures), expected, rtol=1e-11)
    np.testing.assert_allclose(
        in_band_radiance(band(name), Float64(temperatures)), expected, rtol=1e-11
    )


@pytest.mark.parametrize("limits", [(1, 3), (3, 5), (8, 12), (0.4, 0.7), (3.99, 4.01), (0.5, 500)])
def test_in_band_radiance_agrees_with_the_series(limits):
    rule = band(f"{limits[0]}-{limits[1]}")
    for temperature in (30, 97.3, 300, 1111, 6000):
        value = exact(limits, temperature)
        if value > 1e-290:
            assert abs(in_band_radiance(rule, temperature) / value - 1) < 1e-8


def test_spectral_radiance_agrees_with_mpmath():
    for wavelength, temperature in (
        (0.3, 300),
        (4, 30),
        (4, 300),
        (10, 6000),
        (1000, 6000),
        (1000, 1e6),
    ):
        value = (
            C1
            / mpmath.mpf(wavelength) ** 5
            / mpmath.expm1(mpmath.mpf(C2) / wavelength / temperature)
        )
        assert abs(spectral_radiance(wavelength, temperature) / value - 1) < 1e-13
        assert abs(spectral_radiance(wavelength, Float64(temperature))[0] / value - 1) < 1e-13


@pytest.mark.slow
def test_spectral_radiance_agrees_with_colour_science():
    with warnings.catch_warnings():
        # colour warns if optional packages are missing.
        warnings.simplefilter("ignore")
        from colour.colorimetry import planck_law
    wavelengths = np.linspace(1, 14, 50)
    for temperature in (250, 300, 800):
        theirs = planck_law(wavelengths * 1e-6, temperature, c1=np.pi * C1 * 1e-24, c2=C2 * 1e-6)
        np.testing.assert_allclose(
            spectral_radiance(wavelengths, temperature), theirs * 1e-6, rtol=1e-12
        )


def test_total_is_the_law_of_stefan_and_boltzmann_and_the_limit_of_wide_bands():
    temperatures = np.array([500.0, 1000.0, 2000.0])
    total = in_band_radiance(band("total"), temperatures)
    np.testing.assert_allclose(total, SIGMA * temperatures**4 / np.pi, rtol=1e-10)
    # Radiance beyond 1000 um by the law of Rayleigh and Jeans, at most 1e-6 of the total.
    beyond = C1 / C2 * temperatures / (3 * 1000.0**3)
    np.testing.assert_allclose(
        in_band_radiance(band("0.1-1000"), temperatures) + beyond, total, rtol=2e-8
    )


@pytest.mark.parametrize("name", ["LWIR", "total"])
@pytest.mark.parametrize("count", [3, 1000])
def test_the_slope_is_that_of_differences(name, count):
    T, step = np.linspace(250.0, 1000.0, count), 1e-3
    high, low = (in_band_radiance(band(name), T + change) for change in (step, -step))
    np.testing.assert_allclose(in_band_slope(band(name), T), (high - low) / (2 * step), rtol=1e-7)
    assert in_band_slope(band(name), 0.0) == 0


@pytest.mark.slow
@pytest.mark.parametrize("name", [*NAMED, "total"])
@pytest.mark.parametrize("mode", ["forward", "backward"])
def test_derivatives_agree_with_mpmath(name, mode):
    temperatures = [30, 77, 300, 800, 6000]
    t = Float64(temperatures)
    dr.enable_grad(t)
    value = in_band_radiance(band(name), t)
    if mode == "forward":
        dr.set_grad(t, 1)
        computed = dr.forward_to(value)
    else:
        dr.backward(value)
        computed = dr.grad(t)
    for temperature, derivative in zip(temperatures, computed):
        if name == "total":
            expected = 4 * SIGMA * temperature**3 / np.pi
        else:
            rule = band(name)
            expected = mpmath.diff(
                lambda x: exact((rule.lower_um, rule.upper_um), x), temperature, h=1e-8
            )
        assert abs(derivative / expected - 1) < 1e-9


def test_spectral_radiance_has_a_derivative():
    t = Float64(300)
    dr.enable_grad(t)
    dr.backward(spectral_radiance(4.0, t))
    expected = mpmath.diff(lambda x: C1 / mpmath.mpf(4) ** 5 / mpmath.expm1(C2 / 4 / x), 300)
    assert abs(dr.grad(t)[0] / expected - 1) < 1e-12


@pytest.mark.parametrize("name", [*NAMED, "total", "0.1-1000"])
def test_float32_is_computed_in_float64(name):
    """The result is exact to Float32's rounding, 6e-8.

    For values below 1e-30 only the absolute error is tested.
    """
    temperatures = np.geomspace(30, 6000, 500).astype(np.float32)
    expected = in_band_radiance(band(name), temperatures.astype(float))
    computed = in_band_radiance(band(name), Float(temperatures))
    assert type(computed) is Float
    error, large = np.abs(computed.numpy() - expected), expected >= 1e-30
    assert np.all(error[large] <= 1e-7 * expected[large]) and np.all(error[~large] < 1e-30)


@pytest.mark.parametrize("Type", [Float, Float64])
@pytest.mark.parametrize(
    "function",
    [
        lambda t: in_band_radiance(band("SWIR"), t),
        lambda t: in_band_radiance(band("0.1-1000"), t),
        lambda t: in_band_radiance(band("total"), t),
        lambda t: spectral_radiance(0.1, t),
    ],
)
def test_value_and_derivative_are_finite_everywhere(Type, function):
    t = Type([-10, 0, 1e-30, 1e-3, 1, 5, 30, 6000, 1e6])
    dr.enable_grad(t)
    value = function(t)
    dr.backward(value)
    for result in (value.numpy(), dr.grad(t).numpy()):
        assert np.all(np.isfinite(result)) and np.all(result >= 0) and np.all(result[:2] == 0)


def test_numpy_gives_the_same_and_no_warning_at_the_edges():
    temperatures = [-10, 0, 1e-300, 1e-3, 5, 30, 6000, 1e6]
    for name in (*NAMED, "total", "0.1-1000"):
        computed = in_band_radiance(band(name), temperatures)
        np.testing.assert_allclose(
            computed, in_band_radiance(band(name), Float64(temperatures)), rtol=1e-12, atol=1e-300
        )
        assert np.all(computed[:2] == 0)
        for nan in (np.nan, Float(np.nan), Float(300, np.nan)):
            assert np.isnan(np.atleast_1d(in_band_radiance(band(name), nan))[-1])


def test_shapes_and_types_are_kept():
    mwir = band("MWIR")
    at_300, at_400 = in_band_radiance(mwir, 300), in_band_radiance(mwir, 400.0)
    grid = in_band_radiance(mwir, np.array([[300, 400]], dtype=np.float32))
    assert grid.shape == (1, 2) and grid.dtype == np.float64
    assert spectral_radiance(np.ones((3, 1)), np.full(4, 300)).shape == (3, 4)

    vector = in_band_radiance(mwir, Array3f(300, 400, 300))
    tensor = in_band_radiance(mwir, TensorXf([300, 400], shape=(2, 1)))
    assert type(vector) is Array3f and type(tensor) is TensorXf and tensor.shape == (2, 1)
    np.testing.assert_allclose(vector.numpy()[:, 0], [at_300, at_400, at_300], rtol=1e-6)
    np.testing.assert_allclose(tensor.numpy()[:, 0], [at_300, at_400], rtol=1e-6)
    spectral = spectral_radiance(Float(4, 5), 300.0)
    assert type(spectral) is Float
    np.testing.assert_allclose(spectral, spectral_radiance([4, 5], 300), rtol=1e-6)


def test_traced_calls_carry_the_derivative():
    """Derivatives are right if emitters of several bands are called within one kernel.

    Mitsuba's calls of plugins are like dr.switch.
    """
    t = Float(300, 300)
    dr.enable_grad(t)
    emitters = [
        lambda t: in_band_radiance(band("MWIR"), t),
        lambda t: in_band_radiance(band("LWIR"), t),
    ]
    value = dr.switch(UInt32(0, 1), emitters, t)
    dr.backward(value)
    for k, limits in enumerate(((3, 5), (8, 12))):
        assert abs(value[k] / exact(limits, 300) - 1) < 1e-6
        assert abs(dr.grad(t)[k] / mpmath.diff(lambda x: exact(limits, x), 300, h=1e-8) - 1) < 1e-6


@pytest.mark.slow
@pytest.mark.parametrize("spec", [*NAMED, "total", "3.99-4.01", "1-9"])
@settings(max_examples=15, deadline=None)
@given(exponents=st.lists(st.floats(-40, 8), min_size=1, max_size=5))
def test_the_inverse_returns(spec, exponents):
    radiance = 10.0 ** np.array(exponents)
    temperature = brightness_temperature(band(spec), radiance)
    # The temperature's error is smaller than the radiance's, by the factor d ln L / d ln T >= 1.
    np.testing.assert_allclose(in_band_radiance(band(spec), temperature), radiance, rtol=1e-11)


def test_the_inverse_of_the_table():
    for name in NAMED:
        column = TABLE["columns"].index(name)
        for row in TABLE["rows"]:
            assert abs(brightness_temperature(band(name), float(row[column])) / row[0] - 1) < 1e-11


def test_the_inverse_of_what_is_no_radiance():
    for name in ("MWIR", "total"):
        computed = brightness_temperature(
            band(name), np.array([[0, -1, np.nan, np.inf, 1e-320, 1e30]], dtype=float)
        )
        assert computed.shape == (1, 6) and computed.dtype == np.float64
        np.testing.assert_array_equal(computed[0, :4], [0, np.nan, np.nan, np.inf])
        assert np.all(computed[0, 4:] > 0) and np.all(np.isfinite(computed[0, 4:]))
    assert np.ndim(brightness_temperature(band("MWIR"), 1.0)) == 0
    assert brightness_temperature(band("MWIR"), np.zeros((0, 3))).shape == (0, 3)


def test_the_inverse_of_an_image_is_that_of_its_pixels():
    image = np.random.default_rng(1).uniform(0, 40, (100, 130)).astype(np.float32)  # several blocks
    computed = brightness_temperature(band("LWIR"), image)
    np.testing.assert_allclose(in_band_radiance(band("LWIR"), computed), image, rtol=1e-11)


@pytest.mark.slow
def test_numpy_suffices():
    code = (
        "import sys; from mi_lcair.physics.bands import band; "
        "from mi_lcair.physics.blackbody import *; "
        "in_band_radiance(band('MWIR'), 300); brightness_temperature(band('MWIR'), 1); "
        "sys.exit('drjit' in sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True, cwd=Path(__file__).parents[2])


@pytest.mark.slow
@pytest.mark.parametrize("name", ["SWIR", "LWIR", "total"])
def test_inverse_of_many(name):
    """Many radiances at once give the same temperatures as each alone.

    They span 40 decades, or a few kelvin.
    """
    for radiance in (
        np.geomspace(1e-36, 1e4, 9000),
        np.linspace(30.0, 31.0, 9000),
        np.full(9000, 5.0),
    ):
        many = brightness_temperature(band(name), radiance)
        alone = [brightness_temperature(band(name), value) for value in radiance[::751]]
        np.testing.assert_allclose(many[::751], alone, rtol=1e-9)

"""Planck's law from 3 K to 30,000 K and from 0.1 to 1000 um.

Radiance, in-band radiance, its inverse and derivatives are tested.
tests/physics/test_blackbody.py covers the bands and temperatures of thermal scenes.
"""

import drjit as dr
import mpmath
import numpy as np
import pytest
from drjit.llvm.ad import Float, Float64

from mi_lcair.physics import blackbody
from mi_lcair.physics.bands import band

TEMPERATURES = (3, 30, 300, 30_000)
BANDS = ("SWIR", "MWIR", "LWIR", "0.1-0.2", "500-1000", "0.1-1000", "0.1-0.1001", "999-1000")


def planck(wavelength, temperature):
    """Return the spectral radiance [W m^-2 sr^-1 um^-1], computed by mpmath."""
    wavelength = mpmath.mpf(wavelength)
    return blackbody.C1 / wavelength**5 / mpmath.expm1(blackbody.C2 / (wavelength * temperature))


def below(wavelength, temperature):
    """Return the radiance below a wavelength in um [W m^-2 sr^-1], computed by mpmath.

    It is an integral from x = c2 / (wavelength T) to infinity, by a series in exp(-x) or in x.
    """
    x = blackbody.C2 / (mpmath.mpf(wavelength) * temperature)
    if x < 1:  # int_0^x t^3 / (e^t - 1) dt is a series with Bernoulli numbers
        terms = (mpmath.bernoulli(n) * x**n / ((n + 3) * mpmath.factorial(n)) for n in range(60))
        value = mpmath.pi**4 / 15 - x**3 * sum(terms)
    else:
        term = lambda n: mpmath.exp(-n * x) * (x**3 / n + 3 * x**2 / n**2 + 6 * x / n**3 + 6 / n**4)
        value = sum(term(mpmath.mpf(n)) for n in range(1, 90))
    return blackbody.C1 / mpmath.mpf(blackbody.C2) ** 4 * mpmath.mpf(temperature) ** 4 * value


def in_band(limits, temperature):
    return below(limits.upper_um, temperature) - below(limits.lower_um, temperature)


def with_derivative(function, Type, temperature):
    temperature = Type(temperature)
    dr.enable_grad(temperature)
    value = function(temperature)
    # The flag allows a value that is a literal 0 and has no gradient.
    dr.backward(value, flags=dr.ADFlag.AllowNoGrad)
    return value[0], dr.grad(temperature)[0]


@pytest.mark.parametrize("wavelength", [0.1, 1, 10, 1000])
@pytest.mark.parametrize("temperature", TEMPERATURES)
def test_spectral_radiance(wavelength, temperature):
    """Value and derivative have a relative error of 1e-12 in Float64.

    They are 0 where Float64 underflows. At 30 K and 0.1 um the value is 1.7e-2070.
    """
    with mpmath.workdps(30):
        exact = planck(wavelength, temperature)
        slope = mpmath.diff(lambda T: planck(wavelength, T), temperature)
    for Type, bound, smallest in ((Float64, 1e-12, 1e-290), (Float, 2e-7, 1e-37)):
        value, derivative = with_derivative(
            lambda T: blackbody.spectral_radiance(wavelength, T), Type, temperature
        )
        assert value == pytest.approx(float(exact), rel=bound, abs=smallest)
        assert derivative == pytest.approx(float(slope), rel=bound, abs=smallest)


@pytest.mark.slow
@pytest.mark.parametrize("name", BANDS)
@pytest.mark.parametrize("temperature", TEMPERATURES)
def test_in_band_radiance_and_its_inverse(name, temperature):
    """Value and inverse have a relative error of 1e-11, the derivative of 1e-6.

    The inverse is tested for one value and for an array. The derivative is compared with a finite
    difference of the exact value.
    """
    limits = band(name)
    with mpmath.workdps(60):
        exact = in_band(limits, mpmath.mpf(temperature))
        step = mpmath.mpf(temperature) / 10**6
        slope = (in_band(limits, temperature + step) - in_band(limits, temperature - step)) / (
            2 * step
        )
    value, derivative = with_derivative(
        lambda T: blackbody.in_band_radiance(limits, T), Float64, temperature
    )
    assert value == pytest.approx(float(exact), rel=1e-11, abs=1e-290)
    assert derivative == pytest.approx(float(slope), rel=1e-6, abs=1e-290)
    value32, derivative32 = with_derivative(
        lambda T: blackbody.in_band_radiance(limits, T), Float, temperature
    )
    assert value32 == pytest.approx(
        float(exact), rel=1e-6, abs=1e-37
    ) and derivative32 == pytest.approx(float(slope), rel=1e-6, abs=1e-37)
    if value > 1e-290:
        assert blackbody.brightness_temperature(limits, value) == pytest.approx(
            temperature, rel=1e-11
        )
        image = blackbody.brightness_temperature(limits, value * np.linspace(1, 1.01, 5000))
        assert image[0] == pytest.approx(temperature, rel=1e-10) and np.all(np.diff(image) > 0)


# The lowest temperature in K whose radiance is not 0 in Float32. An image shows 0 K for colder
# surfaces.
COLDEST = {"SWIR": 49.5, "MWIR": 30.3, "LWIR": 13.2}


@pytest.mark.parametrize("name", COLDEST)
def test_what_an_image_cannot_show(name):
    temperatures = np.arange(50, 800) / 10
    radiance = blackbody.in_band_radiance(band(name), Float(temperatures)).numpy()
    assert temperatures[np.argmax(radiance > 0)] == pytest.approx(COLDEST[name], abs=0.15)
    shown = blackbody.brightness_temperature(band(name), radiance)
    np.testing.assert_allclose(shown[radiance > 0], temperatures[radiance > 0], rtol=1e-6)
    np.testing.assert_array_equal(shown[radiance == 0], 0)

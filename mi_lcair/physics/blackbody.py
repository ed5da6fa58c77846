"""Planck's law: spectral radiance, in-band radiance and brightness temperature of a blackbody.

Temperatures are floats, NumPy arrays or Dr.Jit arrays of any float type. This module never imports
Dr.Jit.
"""

import sys

import numpy as np
import scipy

from mi_lcair.physics.bands import Band

# CODATA 2018 (exact)
PLANCK, LIGHT_SPEED, BOLTZMANN = 6.62607015e-34, 299792458.0, 1.380649e-23  # J s, m/s, J/K
STEFAN_BOLTZMANN = 2 * np.pi**5 * BOLTZMANN**4 / (15 * PLANCK**3 * LIGHT_SPEED**2)  # W m^-2 K^-4
C1 = 2 * PLANCK * LIGHT_SPEED**2 * 1e24  # W m^-2 sr^-1 um^4, first radiation constant for radiance
C2 = PLANCK * LIGHT_SPEED / BOLTZMANN * 1e6  # um K, second radiation constant

# More brightness temperatures than this are interpolated by a spline with this many knots.
KNOTS = 4096
FEW = 200  # temperatures up to which all nodes of a band are computed at once
# Exponent c2 / (wavelength T) at which Planck's law is 0 in Float64, for all wavelengths from 0.1
# um.
LARGEST_EXPONENT = 800.0


def spectral_radiance(wavelength_um, temperature):
    """Spectral radiance of a blackbody [W m^-2 sr^-1 um^-1] by Planck's law.

    wavelength_um [um] and temperature [K] are floats, NumPy arrays or Dr.Jit arrays, broadcast
    against each other. The radiance at 0 K and below is 0. For Dr.Jit arrays it is computed in
    Float64, returned in the type of the argument, and differentiable.
    """
    like = next((a for a in (temperature, wavelength_um) if _drjit(a)), None)
    if like is None:
        value, _ = _planck(np, *(np.asarray(a, dtype=float) for a in (wavelength_um, temperature)))
        return value
    dr = _drjit(like)
    Float64 = dr.float64_array_t(type(like))
    value, _ = _planck(dr, Float64(wavelength_um), Float64(temperature))
    return type(like)(value)


def spectral_temperature(wavelength_um, radiance):
    """Temperature [K] of a blackbody with this spectral radiance [W m^-2 sr^-1 um^-1]; 0 for none.

    It is Planck's law solved for the temperature. The arrays are broadcast.
    """
    wavelength, radiance = np.broadcast_arrays(wavelength_um, np.asarray(radiance, dtype=float))
    is_lit = radiance > 0
    exponent = np.log1p(C1 / wavelength**5 / np.where(is_lit, radiance, 1))
    return np.where(is_lit, C2 / (wavelength * exponent), 0.0)


def in_band_radiance(band: Band, temperature):
    """In-band radiance of a blackbody, weighted by the band's response [W m^-2 sr^-1].

    temperature [K] is a float, a NumPy array or a Dr.Jit array. The first two return Float64. For a
    Dr.Jit array the radiance is computed in Float64 and returned in the array's type, with its
    derivative attached; the derivative is finite everywhere. The radiance at 0 K and below is 0;
    NaN gives NaN. The relative error is under 1e-6 from 30 K to 6000 K where Float64 does not
    underflow. The band `total` gives sigma T^4 / pi.
    """
    dr = _drjit(temperature)
    if dr is None:
        return radiance_and_slope(band, np.asarray(temperature, dtype=float))[0]
    exact = dr.float64_array_t(type(temperature))(temperature)
    if band.is_total:
        return type(temperature)(_total(dr, exact))
    value, slope = _traced_sum(dr, band, dr.detach(exact))
    return type(temperature)(dr.replace_grad(value, slope * exact))


def in_band_slope(band: Band, temperature) -> np.ndarray:
    """Derivative of `in_band_radiance` with respect to temperature [W m^-2 sr^-1 K^-1], Float64."""
    return radiance_and_slope(band, np.asarray(temperature, dtype=float))[1]


def brightness_temperature(band: Band, radiance):
    """Temperature [K] of the blackbody with this in-band radiance.

    This is the inverse of `in_band_radiance`. radiance [W m^-2 sr^-1] is a float or a NumPy array;
    the result is Float64 of the same shape. A radiance of 0 gives 0 K; a negative one or NaN gives
    NaN. The relative error is about 1e-10 or less for radiances of 1e-40 and more.
    """
    radiance = np.asarray(radiance, dtype=float)
    result = np.where(radiance >= 0, radiance, np.nan)  # 0 gives 0 K, infinity gives infinity
    solved = (radiance > 0) & (radiance < np.inf)
    values = radiance[solved]
    if band.is_total:
        result[solved] = (np.pi * values / STEFAN_BOLTZMANN) ** 0.25
    else:
        result[solved] = (
            _solve(band, values) if values.size <= KNOTS else _interpolate(band, values)
        )
    return result[()]


def _drjit(array):
    """The drjit module if `array` is one of its arrays, else None."""
    dr = sys.modules.get("drjit")
    return dr if dr is not None and dr.is_array_v(array) else None


def _planck(m, wavelength, temperature):
    """Spectral radiance and its derivative with respect to temperature.

    m: the module whose functions are used, NumPy or Dr.Jit. A lower limit of the temperature caps
    the exponent, so that nothing overflows and no derivative divides by 0.
    """
    x = C2 / (wavelength * m.maximum(temperature, C2 / (LARGEST_EXPONENT * wavelength)))
    half = m.exp(-x / 2)
    rise = 2 * m.sinh(x / 2)  # 1 / (e^x - 1) = half / rise, without cancellation
    value = C1 / wavelength**5 * half / rise
    return value, value * x * x * wavelength / (C2 * half * rise)


def _total(m, temperature):
    """sigma T^4 / pi, with the functions of module `m` (NumPy or Dr.Jit)."""
    t = m.maximum(temperature, 0)
    return STEFAN_BOLTZMANN / np.pi * (t * t) * (t * t)


def radiance_and_slope(band: Band, temperature):
    """In-band radiance and its derivative with respect to temperature, in NumPy."""
    if band.is_total:
        return _total(np, temperature), 4 * STEFAN_BOLTZMANN / np.pi * np.maximum(
            temperature, 0
        ) ** 3
    if np.size(temperature) <= FEW:
        nodes = np.asarray(band.wavelengths_um).reshape(-1, *[1] * np.ndim(temperature))
        both = _planck(np, nodes, temperature)
        return tuple(np.tensordot(band.weights_um, values, 1) for values in both)
    value = slope = 0.0
    for wavelength, weight in zip(band.wavelengths_um, band.weights_um):
        node_value, node_slope = _planck(np, wavelength, temperature)
        value, slope = value + weight * node_value, slope + weight * node_slope
    return value, slope


def _traced_sum(dr, band, temperature):
    """In-band radiance and its derivative with respect to temperature, in Dr.Jit, detached.

    One symbolic loop runs over the nodes, so that the kernel's size does not depend on their
    number.
    """
    Float64 = type(dr.ravel(temperature))  # one-dimensional, also for a tensor or a nested array
    UInt32 = dr.uint32_array_t(Float64)
    wavelengths, weights = Float64(band.wavelengths_um), Float64(band.weights_um)

    def add_node(i, value, slope):
        node_value, node_slope = _planck(dr, dr.gather(Float64, wavelengths, i), temperature)
        weight = dr.gather(Float64, weights, i)
        return i + 1, dr.fma(weight, node_value, value), dr.fma(weight, node_slope, slope)

    zeros = dr.zeros(type(temperature), dr.shape(temperature))
    _, value, slope = dr.while_loop(
        state=(UInt32(0), zeros, zeros),
        cond=lambda i, value, slope: i < band.wavelengths_um.size,
        body=add_node,
        label="in-band radiance",
    )
    # Dr.Jit's loop turns a literal NaN into 0.
    return dr.select(dr.isnan(temperature), temperature, value), slope


def _interpolate(band, radiance):
    """Brightness temperatures of many radiances, by a Hermite spline of ln T over ln L.

    `_solve` gives the knots. The relative error is 2e-13 over 40 decades of radiance in SWIR, and
    less over the range of an image.
    """
    from scipy.interpolate import CubicHermiteSpline

    knots = np.geomspace(radiance.min() * (1 - 1e-6), radiance.max() * (1 + 1e-6), KNOTS)
    temperature = _solve(band, knots)
    value, slope = radiance_and_slope(band, temperature)
    spline = CubicHermiteSpline(np.log(knots), np.log(temperature), value / (temperature * slope))
    return np.exp(spline(np.log(radiance)))


def _solve(band, radiance):
    """Brightness temperatures [K] of positive radiances (n,), by Newton's method.

    The method solves ln L(u) = ln radiance for u = 1/T. ln L is convex and falls with u. Steps that
    start at a u below the root therefore rise to the root and never pass it. The start is the
    smallest inverse brightness temperature of the nodes at the mean spectral radiance; it lies
    below the root.
    """
    target = np.log(radiance)
    mean = target - np.log(band.weights_um.sum())
    u = np.full(radiance.shape, np.inf)
    for wavelength in band.wavelengths_um:
        u = np.minimum(u, wavelength / C2 * np.logaddexp(0, np.log(C1 / wavelength**5) - mean))
    for _ in range(50):
        value, slope = radiance_and_slope(band, 1 / u)
        step = (np.log(value) - target) * value * u * u / slope
        u = u + step
        # Convergence is quadratic: the remaining relative error is the square of the last step's.
        if np.all(np.abs(step) < 1e-8 * u):
            break
    return 1 / u


def polynomials(nodes_um: np.ndarray, wavelengths_um: np.ndarray) -> np.ndarray:
    """The polynomials that are 1 at one of the nodes and 0 at the others, (nodes, n).

    They are the parts of the spectrum of many blackbodies, which is recorded at the nodes.
    """
    if not nodes_um.size:
        return np.empty((0, len(wavelengths_um)))
    unit = np.eye(len(nodes_um))
    return scipy.interpolate.BarycentricInterpolator(nodes_um, unit)(wavelengths_um).T

"""Derivatives of the BRDF with respect to its parameters, at the limits of the parameters.

Float32 is compared with Float64, and Float64 with finite differences. On a bound the difference is
one-sided, toward the inside of the feasible set.
"""

import drjit as dr
import numpy as np
import pytest
from drjit.llvm.ad import Array3f, Array3f64, Float, Float64

from mi_lcair.physics.reflection import sandford_robertson_equations
from mi_lcair.physics.reflection import sandford_robertson_equations as sr
from tests.physics.reflection.surfaces import direction

G_05 = float(sr.G(Float64(0.05))[0])
# name -> (epsilon, rho_d, b, e), and the side of each difference: 0 central, +-1 one-sided, None if
# it is not tested
CORNERS = {
    "b = 0": ((0.3, 0.1, 0.0, 0.1), (0, 0, 1, 0)),
    "b = 1e-4": ((0.3, 0.1, 1e-4, 0.1), (0, 0, 0, 0)),
    "b = 1": ((0.1, 0.1, 1.0, 0.1), (0, 0, -1, 0)),
    "bound, b = 1": ((0.3, 0.2, 1.0, 0.1), (-1, -1, -1, 0)),
    "bound, b = 0.05": ((G_05 - 0.2, 0.2, 0.05, 0.1), (-1, -1, -1, 0)),
    "e = 1e-5": ((0.3, 0.1, 0.05, 1e-5), (0, 0, 0, 0)),
    "e = 1e-3": ((0.3, 0.1, 0.05, 1e-3), (0, 0, 0, 0)),
    "e = 1": ((0.3, 0.1, 0.05, 1.0), (0, 0, 0, -1)),
    "epsilon = rho_d = 0": ((0.0, 0.0, 0.5, 0.1), (1, 1, 0, 0)),
    "blackbody": ((1.0, 0.0, 0.0, 0.1), (-1, None, None, 0)),
    "white": ((0.0, 1.0, 0.0, 0.1), (None, -1, None, 0)),
}


def directions(e, count=2000):
    """Return directions (i, r) in Float32.

    r is up to 89.999 degrees from the normal. i is drawn from the lobe about the mirror direction
    of r.
    """
    rng = np.random.default_rng(0)
    r = direction(
        np.radians(
            np.where(
                np.arange(count) % 2, 90 * rng.random(count), 90 - 10 ** rng.uniform(-3, 1, count)
            )
        )
    )
    half = sr.sample_half_vector(r, Float64(e), *(Float64(rng.random(count)) for _ in range(2)))
    i, r = (2 * dr.dot(r, half) * half - r).numpy(), r.numpy()
    above = i[2] > 1e-6
    return i[:, above].astype(np.float32), r[:, above].astype(np.float32)


def value(parameters, i, r, form):
    """Return the BRDF in Float64 [1/sr]."""
    numbers = [dr.opaque(Float64, float(number)) for number in parameters]
    return sr.f(sr.surface(*numbers, form=form), Array3f64(i), Array3f64(r)).numpy()


def derivative(parameters, k, i, r, form, Type, Vector):
    """Return the derivative of the BRDF with respect to parameter k, computed with `Type`."""
    numbers = [dr.opaque(Float64, float(number)) for number in parameters]
    dr.enable_grad(numbers[k])
    f = sr.f(sr.surface(*numbers, form=form).cast(Type), Vector(i), Vector(r))
    dr.set_grad(numbers[k], 1)
    dr.forward_to(f)
    return dr.grad(f).numpy().astype(float)


def difference(parameters, k, side, evaluate, relative_step=1e-5):
    """Return a finite difference of second order, central or one-sided."""
    step = relative_step * max(parameters[k], 1e-3 if k < 3 else 0)
    at = lambda n: evaluate((*parameters[:k], parameters[k] + n * step, *parameters[k + 1 :]))
    if side == 0:
        return (at(1) - at(-1)) / (2 * step)
    return side * (-3 * at(0) + 4 * at(side) - at(2 * side)) / (2 * step)


@pytest.mark.parametrize("form", sr.FORMS)
@pytest.mark.parametrize("corner", CORNERS)
def test_of_the_brdf(corner, form):
    """Errors are relative to |derivative| + 1e-3 of the value.

    For small b the derivative is proportional to b log b. At b = 0 a finite difference therefore
    deviates from the limit, 0.
    """
    parameters, sides = CORNERS[corner]
    i, r = directions(parameters[3])
    f = value(parameters, i, r, form)
    for k, side in enumerate(sides):
        exact = derivative(parameters, k, i, r, form, Float64, Array3f64)
        scale = np.abs(exact) + 1e-3 * f + 1e-12
        float32 = derivative(parameters, k, i, r, form, Float, Array3f)
        # The comparison is false for NaN.
        assert np.all(np.abs(float32 - exact) <= 5e-3 * scale), f"Float32, parameter {k}"
        if side is not None:
            expected = difference(parameters, k, side, lambda at: value(at, i, r, form))
            assert np.quantile(np.abs(exact - expected) / scale, 0.99) <= (
                0.05 if parameters[2] == 0 and k == 2 else 2e-3
            ), f"difference, parameter {k}"
            large = np.abs(expected) > 0.01 * np.abs(expected).max()
            assert (
                np.all(np.sign(exact[large]) == np.sign(expected[large]))
                or k == 2
                and parameters[2] == 0
            )


@pytest.mark.slow
@pytest.mark.parametrize("form", sr.FORMS)
@pytest.mark.parametrize("corner", CORNERS)
def test_of_the_emissivity(corner, form):
    """The derivative of 1 - min(1, HDR) agrees with finite differences up to 90 - 1e-6 degrees.

    It is 0 beyond the first angle at which HDR reaches 1, where the emissivity is 0.
    """
    parameters, sides = CORNERS[corner]
    theta = Float64(np.radians([0, 30, 80, 89, 89.9, 89.99, 90 - 1e-6]))

    def HDR(at):
        return sandford_robertson_equations.HDR(
            sr.surface(*(dr.opaque(Float64, float(number)) for number in at), form=form), theta
        ).numpy()

    for k, side in enumerate(sides):
        numbers = [dr.opaque(Float64, number) for number in parameters]
        dr.enable_grad(numbers[k])
        result = 1 - dr.minimum(
            sandford_robertson_equations.HDR(sr.surface(*numbers, form=form), theta), 1
        )
        dr.set_grad(numbers[k], 1)
        dr.forward_to(result)
        slope = dr.grad(result).numpy()
        assert np.all(np.isfinite(slope))
        np.testing.assert_array_equal(slope[HDR(parameters) > 1 + 1e-9], 0)
        if side is not None:
            # HDR at the points of the difference, which is wrong if HDR passes 1 between them.
            evaluated = []
            expected = difference(
                parameters,
                k,
                side,
                lambda at: evaluated.append(HDR(at)) or 1 - evaluated[-1],
                1e-3 if k == 3 else 1e-5,
            )
            smooth = np.max(evaluated, axis=0) < 1
            # The noise of the quadrature divided by the step.
            noise = 1e-12 / (1e-3 * parameters[k]) if k == 3 else 0
            scale = np.abs(expected[smooth]).max(initial=0) + 1e-3
            np.testing.assert_allclose(
                slope[smooth], expected[smooth], rtol=5e-3, atol=1e-3 * scale + noise
            )

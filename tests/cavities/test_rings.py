"""Diffuse cavities against the sphere's closed form and the integral equation of the meridian."""

import numpy as np
import pytest

from mi_lcair.cavities import rings
from mi_lcair.cavities.exchange import ring_exchange
from mi_lcair.cavities.shape import Shape
from mi_lcair.cavities.view import Beam, Cone, Hemisphere
from tests.cavities import meridian

WANTED = 2e-5  # largest stated error; the true one is below a tenth of it


def isothermal(z):
    return np.ones((len(z), 1))


def effective(shape, emissivity, emission, view):
    value, error = rings.effective_emissivity(shape, emissivity, emission, view)
    return value[0], error[0]


@pytest.mark.parametrize("seed", range(6))
def test_sphere(seed):
    """A sphere's radiosity is even: epsilon / (1 - (1 - epsilon)(1 - f)) in any direction."""
    rng = np.random.default_rng(seed)
    R, epsilon = rng.uniform(0.01, 3), rng.uniform(0.02, 1)
    a = R * rng.uniform(0.02, 0.99)
    shape = Shape(kind="sphere", radius_m=R, aperture_radius_m=a)
    f = (1 - np.sqrt(1 - (a / R) ** 2)) / 2  # share of the cap
    exact = epsilon / (1 - (1 - epsilon) * (1 - f))
    spot = a * rng.uniform(0.1, 1)
    for view in (Hemisphere(spot), Beam(spot, rng.uniform(0, 1.4)), Cone(spot, 2 * R)):
        value, _ = effective(shape, epsilon, isothermal, view)
        assert abs(value - exact) < 1e-12


def shapes():
    rng = np.random.default_rng(7)
    for _ in range(3):
        R = rng.uniform(0.01, 0.2)
        lid = R * 10 ** rng.uniform(-1, 0)
        yield Shape(kind="cylinder", radius_m=R, length_m=R * 10 ** rng.uniform(-1, 1))
        yield Shape(
            kind="cylinder",
            radius_m=R,
            length_m=R * 10 ** rng.uniform(-1, 1),
            aperture_radius_m=lid,
        )
        yield Shape(kind="cone", radius_m=R, angle_deg=rng.uniform(20, 170))
        yield Shape(
            kind="cylinder_cone",
            radius_m=R,
            length_m=R * rng.uniform(4, 8),
            angle_deg=rng.uniform(40, 170),
            aperture_radius_m=lid,
        )


@pytest.mark.parametrize("shape", list(shapes()), ids=lambda shape: shape.kind)
def test_integral_equation(shape):
    """Isothermal and with a gradient of 30 %, seen from all directions and along the axis."""
    rng = np.random.default_rng(int(1e6 * shape.radius_m))
    epsilon, gradient = rng.uniform(0.03, 1), rng.uniform(-0.3, 0.3)
    corners = shape.corners()
    for slope in (0, gradient):

        def emission(z, slope=slope):
            return 1 + slope * (z / shape.depth) ** 2

        for view, reference in (
            (Hemisphere(shape.aperture), meridian.hemispherical),
            (Beam(shape.aperture), meridian.normal),
        ):
            value, error = effective(shape, epsilon, lambda z: emission(z)[:, None], view)
            exact = reference(corners, epsilon, emission)
            assert abs(value - exact) < WANTED / 10
            assert error < WANTED


@pytest.mark.parametrize("shape", list(shapes()), ids=lambda shape: shape.kind)
def test_stated_error_holds(shape):
    """The error that two numbers of rings give is larger than the difference to many rings."""
    rng = np.random.default_rng(int(1e6 * shape.radius_m) + 1)
    spot = shape.aperture * rng.uniform(0.2, 1)
    view = [Hemisphere(spot), Beam(spot, rng.uniform(0, 1)), Cone(spot, shape.depth)][
        rng.integers(3)
    ]

    def emission(z):
        return 1 + 0.2 * z[:, None] / shape.depth

    value, error = effective(shape, 0.4, emission, view)
    many = rings.of_rings(shape, 0.4, emission, view, 700)[0]
    assert abs(value - many) < max(error, 1e-9) < 1e-4


@pytest.mark.parametrize("shape", list(shapes()), ids=lambda shape: shape.kind)
def test_exchange_is_that_of_an_enclosure(shape):
    """View factors are positive, reciprocal, and with the aperture they add up to 1."""
    nodes = shape.nodes(30)
    areas = shape.areas(nodes)
    F = ring_exchange(nodes, areas)
    assert F.min() > -1e-12
    exchange = F * areas[:, None]
    np.testing.assert_allclose(exchange, exchange.T, atol=1e-12 * areas.max())
    through = np.sum(areas * (1 - F.sum(axis=1)))
    assert through == pytest.approx(np.pi * shape.aperture**2, rel=1e-9)

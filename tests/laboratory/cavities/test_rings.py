"""Diffuse cavities against the sphere's closed form and the integral equation of the meridian."""

import mitsuba as mi
import numpy as np
import pytest

from mi_lcair.laboratory.cavities import rings
from mi_lcair.laboratory.cavities.rings import (
    Beam,
    Cone,
    HemisphereView,
    cavity_emissivity,
    common_area,
    gouffe,
    ring_exchange,
    shape_term,
)
from mi_lcair.laboratory.cavities.shape import Shape
from tests.laboratory.cavities import meridian
from tests.matrix import some_of

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
    for view in (HemisphereView(spot), Beam(spot, rng.uniform(0, 1.4)), Cone(spot, 2 * R)):
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


@pytest.mark.parametrize("shape", some_of(shapes(), 2), ids=lambda shape: shape.kind)
def test_integral_equation(shape):
    """Isothermal and with a gradient of 30 %, seen from all directions and along the axis."""
    rng = np.random.default_rng(int(1e6 * shape.radius_m))
    epsilon, gradient = rng.uniform(0.03, 1), rng.uniform(-0.3, 0.3)
    corners = shape.corners()
    for slope in (0, gradient):

        def emission(z, slope=slope):
            return 1 + slope * (z / shape.depth) ** 2

        for view, reference in (
            (HemisphereView(shape.aperture), meridian.hemispherical),
            (Beam(shape.aperture), meridian.normal),
        ):
            value, error = effective(shape, epsilon, lambda z: emission(z)[:, None], view)
            exact = reference(corners, epsilon, emission)
            assert abs(value - exact) < WANTED / 10
            assert error < WANTED


@pytest.mark.parametrize("shape", some_of(shapes(), 2), ids=lambda shape: shape.kind)
def test_stated_error_holds(shape):
    """The error that two numbers of rings give is larger than the difference to many rings."""
    rng = np.random.default_rng(int(1e6 * shape.radius_m) + 1)
    spot = shape.aperture * rng.uniform(0.2, 1)
    view = [HemisphereView(spot), Beam(spot, rng.uniform(0, 1)), Cone(spot, shape.depth)][
        rng.integers(3)
    ]

    def emission(z):
        return 1 + 0.2 * z[:, None] / shape.depth

    value, error = effective(shape, 0.4, emission, view)
    many = rings.of_rings(shape, 0.4, emission, view, 700)[0]
    assert abs(value - many) < max(error, 1e-9) < 1e-4


@pytest.mark.parametrize(
    ("c", "lid", "last"), [(0.01, 0, 160), (0.1, 0, 640), (1e4, 0, 1280), (1e4, 0.5, 640)]
)
def test_an_error_of_second_order_is_extrapolated_away(monkeypatch, c, lid, last):
    """Of values 1 + c / n^2, n is doubled from 40 until two steps are below 5e-6, or to the most.

    2400 rings are the most of a whole wall: one part of a sphere, three of a cylinder with a lid.
    """
    counts = []

    def value(shape, emissivity, emission, view, count):
        counts.append(count)
        return np.array([1 + c / count**2])

    monkeypatch.setattr(rings, "of_rings", value)
    shape = Shape(kind="sphere", radius_m=1.0, aperture_radius_m=0.5)
    if lid:
        shape = Shape(kind="cylinder", radius_m=1.0, length_m=1.0, aperture_radius_m=lid)
    found, error = rings.effective_emissivity(shape, 0.5, isothermal, HemisphereView(0.5))
    assert counts == [40 * 2**k for k in range(len(counts))] and counts[-1] == last
    assert found[0] == pytest.approx(1, abs=1e-12 * c)
    assert error[0] == pytest.approx(c * (16 - 4) / last**2, rel=1e-9)


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


# Views: the share of rays that pass a disc, by formula and by counting rays
# --------------------------------------------------------------------------

COUNT = 400_000


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("kind", [HemisphereView, Beam, Cone])
def test_passed(kind, seed):
    rng = np.random.default_rng(seed)
    spot = rng.uniform(0.1, 1)
    more = {HemisphereView: (), Beam: (rng.uniform(0, 1.3),), Cone: (rng.uniform(0.3, 4),)}[kind]
    view = kind(spot, *more)
    u = mi.Point2f(rng.random((2, COUNT)))
    v = mi.Point2f(rng.random((2, COUNT)))
    start, direction = (np.array(part).reshape(3, -1) for part in view.ray(u, v))
    assert (start[2] == 0).all()
    assert np.hypot(*start[:2]).max() <= spot * (1 + 1e-6)
    r, z = rng.uniform(0.05, 2), rng.uniform(0.01, 2)
    place = start[:2] + direction[:2] * z / direction[2]
    counted = np.mean(np.hypot(*place) <= r)
    exact = float(view.passed(np.array(r), np.array(z)))
    error = np.sqrt(max(exact * (1 - exact), 1e-5) / COUNT)
    assert abs(counted - exact) < 5 * error


@pytest.mark.parametrize("seed", range(20))
def test_common_area(seed):
    """The area that two circles share, as the integral of the chords that they share."""
    rng = np.random.default_rng(seed)
    a, b = rng.uniform(0.2, 1, 2)
    d = rng.uniform(0, 1.2 * (a + b))
    x = a * (2 * np.arange(200_000) + 1 - 200_000) / 200_000
    chords = (np.sqrt(np.maximum(radius**2 - u**2, 0)) for radius, u in ((a, x), (b, x - d)))
    exact = 2 * np.sum(np.minimum(*chords)) * a / 100_000
    assert common_area(a, np.array(b), np.array(d)) == pytest.approx(exact, abs=2e-6)


def test_circles_inside_each_other():
    area = common_area(0.5, np.array([0.0, 0.2, 1.0, 0.5]), np.array([0.1, 0.1, 0.1, 0.0]))
    np.testing.assert_allclose(area, np.pi * np.array([0, 0.2, 0.5, 0.5]) ** 2, rtol=1e-12)


# Method of Gouffé: the worked example of thesis appendix B, and the sphere
# -------------------------------------------------------------------------


def test_worked_example():
    """Thesis, appendix B.2, to all printed digits.

    It rounds s/S to .0157 for the cavity's emissivity, but not for the correction.
    """
    s, S, rounded = 0.0487, 3.106, 0.0157
    cavity, k = cavity_emissivity(0.5, rounded, 1.0), shape_term(0.5, s, S, np.pi)
    assert f"{s / S:.4f}" == f"{rounded:.4f}"
    assert f"{cavity:.4f}" == "0.9845"
    assert f"{k:.2e}" == "8.88e-05"
    assert f"{cavity * (1 + k):.4f}" == "0.9846"
    assert f"{gouffe(0.5, s, S, np.pi):.4f}" == "0.9847"  # without rounding


@pytest.mark.parametrize("seed", range(5))
def test_sphere_has_no_correction(seed):
    """For S = S0 the method is exact: the series of a sphere's reflections."""
    epsilon, f = np.random.default_rng(seed).uniform(0.1, 0.9, 2)
    series = epsilon * np.sum(((1 - epsilon) * (1 - f)) ** np.arange(2000))
    assert gouffe(epsilon, f, 1.0, 1.0) == pytest.approx(series, rel=1e-12)

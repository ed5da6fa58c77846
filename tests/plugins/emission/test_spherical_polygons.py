"""Directions toward triangles and rectangles: against quadratures over their area, closed forms of
the solid angle, and view factors.
"""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from mi_lcair.plugins.emission.spherical_polygons import (
    Receiver,
    SphericalRectangle,
    SphericalTriangle,
    linear_from_apex,
)

KINDS = [SphericalTriangle, SphericalRectangle]
COUNT = 2**18


def vector(values):
    return mi.Vector3f(*map(float, values))


def seen(kind, corner, edge_1, edge_2, up):
    """A polygon as seen from the origin, where the surface's normal is `up`."""
    n = np.cross(edge_1, edge_2)
    receiver = Receiver(mi.Point3f(0), mi.Normal3f(*map(float, up)))
    edges = vector(edge_1), vector(edge_2)
    return kind.of(mi.Point3f(*map(float, corner)), *edges, vector(n / np.linalg.norm(n)), receiver)


def polygon(kind, size, seed):
    """Corner, edges and normal of a random polygon about 1 m away, over the horizon or across."""
    rng = np.random.default_rng(seed)
    corner, edge_1, edge_2, up = rng.normal(size=(4, 3))
    corner, up = corner / np.linalg.norm(corner), up / np.linalg.norm(up)
    edge_1, edge_2 = edge_1 * size, edge_2 * size
    if kind is SphericalRectangle:
        edge_2 = edge_2 - edge_1 * (edge_1 @ edge_2) / (edge_1 @ edge_1)
    return corner, edge_1, edge_2, up if up @ corner > 0 else -up


def functions(places):
    """Test functions of the place in a polygon, by the coordinates along its edges."""
    a, b = places
    return np.stack([a**0, a, b, a * b, np.sin(7 * a + 3 * b), np.cos(9 * a * b + b)])


def quadrature(kind, corner, edge_1, edge_2, up):
    """Integrals of `functions` and of the cosine over the solid angle, by Gauss and Legendre."""
    x, weight = np.polynomial.legendre.leggauss(200)
    a, b = np.meshgrid((x + 1) / 2, (x + 1) / 2, indexing="ij")
    width = 1 - a if kind is SphericalTriangle else np.ones_like(a)
    places = np.stack([a, width * b]).reshape(2, -1)
    points = corner[:, None] + np.outer(edge_1, places[0]) + np.outer(edge_2, places[1])
    distance, n = np.linalg.norm(points, axis=0), np.cross(edge_1, edge_2)
    angle = (weight[:, None] * weight / 4 * width).ravel() * abs(n @ corner) / distance**3
    cosine = np.maximum(up @ points / distance, 0)
    return functions(places) @ angle, cosine @ angle


@pytest.mark.parametrize("size", [1.0, 0.1, 0.02, 0.002])
@pytest.mark.parametrize("kind", KINDS)
def test_means_over_drawn_directions_are_integrals(kind, size):
    """Large polygons across the horizon, and those so small that points are drawn by area."""
    for seed in range(2):
        parts = polygon(kind, size, seed)
        expected, _ = quadrature(kind, *parts)
        drawn = seen(kind, *parts)
        sampler = mi.load_dict({"type": "independent"})
        sampler.seed(seed, COUNT)
        d, distance, density = drawn.draw(sampler.next_2d())
        d, density = d.numpy().astype(float), density.numpy().astype(float)
        corner, edge_1, edge_2, _ = parts
        n = np.cross(edge_1, edge_2)
        length = (n @ corner) / (n @ d)
        np.testing.assert_allclose(distance.numpy(), length, rtol=1e-4)
        edges = np.stack([edge_1, edge_2], axis=1)
        places = np.linalg.lstsq(edges, d * length - corner[:, None], rcond=None)[0]
        values = functions(places) / density
        error = values.std(axis=1) / np.sqrt(COUNT) + 1e-5 * expected[0]
        assert np.abs((values.mean(axis=1) - expected) / error).max() < 4.5
        assert float(drawn.solid_angle[0]) == pytest.approx(expected[0], rel=1e-5)
        top = places.sum(axis=0) if kind is SphericalTriangle else places.max(axis=0)
        assert places.min() > -1e-3 and top.max() < 1.001


@pytest.mark.parametrize("kind", KINDS)
def test_above_the_horizon_the_projected_solid_angle_is_exact(kind):
    """And directions are drawn so nearly in proportion to the cosine that 5 % scatter is left."""
    corner, edge_1, edge_2 = np.eye(3)[2] + 0.3, np.array([0.4, 0.0, 0.1]), np.array([0, 0.5, 0.0])
    up = np.array([0.0, 0.0, 1.0])
    _, expected = quadrature(kind, corner, edge_1, edge_2, up)
    drawn = seen(kind, corner, edge_1, edge_2, up)
    assert float(drawn.projected[0]) == pytest.approx(expected, rel=1e-4)
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(0, COUNT)
    d, distance, density = drawn.draw(sampler.next_2d())
    quotient = (mi.Float(d.z) / density).numpy().astype(float)
    assert quotient.mean() == pytest.approx(expected, rel=1e-3)
    assert quotient.std() < 0.05 * expected
    compared = drawn.along(d, distance).numpy()
    assert np.abs(compared / density.numpy() - 1).max() < 0.3


def test_below_the_horizon_nothing_arrives():
    for kind in KINDS:
        drawn = seen(kind, [0, 0, -1], [1, 0, 0], [0, 1, 0], [0, 0, 1])
        assert float(drawn.projected[0]) == 0


def test_solid_angles_by_hand():
    """An octant, and a side of the cube around the point."""
    octant = seen(SphericalTriangle, [1, 0, 0], [-1, 1, 0], [-1, 0, 1], [1, 0, 0])
    assert float(octant.solid_angle[0]) == pytest.approx(np.pi / 2, rel=1e-6)
    side = seen(SphericalRectangle, [-1, -1, 1], [2, 0, 0], [0, 2, 0], [0, 0, 1])
    assert float(side.solid_angle[0]) == pytest.approx(4 * np.pi / 6, rel=1e-6)
    # View factor of the side opposite a cube's centre, half a side away: 4 x 0.138598
    factor = 4 / (2 * np.pi) * 2 / np.sqrt(2) * np.arctan(1 / np.sqrt(2))
    assert float(side.projected[0]) == pytest.approx(np.pi * factor, rel=1e-5)


@pytest.mark.parametrize("cosines", [(1, 1), (1, 0.02), (0.02, 1), (0.5, 0.8)])
def test_distance_from_the_apex(cosines):
    """The inverse of the cumulative density w^2 (3 - 2 w) a + 2 w^3 b, divided by a + 2 b."""
    a, b = cosines
    u = (np.arange(2**12) + 0.5) / 2**12
    w = linear_from_apex(mi.Float(u), mi.Float(a), mi.Float(b)).numpy().astype(float)
    np.testing.assert_allclose((a * (3 - 2 * w) * w**2 + 2 * b * w**3) / (a + 2 * b), u, atol=1e-6)
    edge = linear_from_apex(mi.Float(0.0, 1.0), mi.Float(a), mi.Float(b))
    assert dr.all(dr.isfinite(edge)) and float(edge[1]) == pytest.approx(1, abs=1e-3)

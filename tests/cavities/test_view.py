"""Views: the share of rays that pass a disc, by formula and by counting rays."""

import mitsuba as mi
import numpy as np
import pytest

from mi_lcair.cavities.view import Beam, Cone, Hemisphere, common_area

COUNT = 400_000


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("kind", [Hemisphere, Beam, Cone])
def test_passed(kind, seed):
    rng = np.random.default_rng(seed)
    spot = rng.uniform(0.1, 1)
    more = {Hemisphere: (), Beam: (rng.uniform(0, 1.3),), Cone: (rng.uniform(0.3, 4),)}[kind]
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

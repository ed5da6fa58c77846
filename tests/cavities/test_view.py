"""Views: the share of rays that pass a disc, by formula and by counting rays."""

import mitsuba as mi
import numpy as np
import pytest

from mi_lcair.cavities.view import Beam, Cone, Hemisphere

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
    r, z = rng.uniform(0.05, 2), rng.uniform(0.01, 2)
    place = start[:2] + direction[:2] * z / direction[2]
    counted = np.mean(np.hypot(*place) <= r)
    exact = float(view.passed(np.array(r), np.array(z)))
    error = np.sqrt(max(exact * (1 - exact), 1e-5) / COUNT)
    assert abs(counted - exact) < 5 * error

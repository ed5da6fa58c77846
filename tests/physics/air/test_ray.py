"""Rays through the air against the differential equation of a ray, solved apart."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from mi_lcair.physics.air.bands import bands
from mi_lcair.physics.air.levels import levels
from mi_lcair.physics.air.ray import ray, ray_end

AIR = levels("us_standard")


def solved(height_km, elevation_deg, length_km):
    """Height [km] and elevation [degrees] at a ray's end, and amounts along it."""

    def slope(_, y):
        index, rate = AIR.refraction(np.array(y[0]))
        turn = np.cos(y[1]) * (1 / (6371.23 + y[0]) + rate / (1 + index))
        return [np.sin(y[1]), turn, *AIR.at(np.array(y[0]))[0]]

    start = [height_km, np.radians(elevation_deg), *np.zeros(AIR.densities.shape[1])]
    y = solve_ivp(slope, (0, length_km), start, rtol=1e-8, max_step=0.2).y[:, -1]
    return y[0], np.degrees(y[1]), y[2:]


@pytest.mark.parametrize(
    ("height", "elevation", "length"),
    [(0.05, 1, 50), (0.05, 30, 20), (8, -2, 120), (3, -30, 3), (0.5, 0, 10)],
)
def test_ray_of_the_differential_equation(height, elevation, length):
    along = ray(AIR, height, elevation, length)
    end, turned, amounts = solved(height, elevation, length)
    assert along.lengths_km[-1] == pytest.approx(length, rel=4e-4)
    assert along.heights_km[-1] == pytest.approx(end, abs=1e-3)
    assert along.elevations_deg[-1] == pytest.approx(turned, abs=0.03)
    ends = ray_end(AIR, height, elevation, length)
    last = along.lengths_km[-1], along.heights_km[-1], along.elevations_deg[-1]
    assert ends == pytest.approx(last, rel=4e-4, abs=1e-6)
    gases = [not name.startswith("aerosol") for name in bands().columns]
    np.testing.assert_allclose(along.amounts[-1][gases], amounts[gases], rtol=1e-3)
    # The aerosols change their class within layers. Their sum counts.
    aerosols = np.logical_not(gases)
    assert along.amounts[-1][aerosols].sum() == pytest.approx(amounts[aerosols].sum(), rel=2e-3)


def test_layers_grow_from_the_viewer():
    along = ray(AIR, 0.05, 90.0)
    thickness = np.diff(along.lengths_km)
    assert along.heights_km[-1] == pytest.approx(100) and thickness[0] < 0.0061
    assert (thickness < 0.21 * along.lengths_km[1:] + 0.006).all()
    low = along.heights_km[1:] < 30
    assert thickness[low].max() < 0.51 and thickness.max() < 2.1
    assert along.temperatures[0] == pytest.approx(287.86, abs=0.02)


def test_temperature_of_a_layer():
    """The mean by mass, which lies low in a thick layer: 0.1 K below the middle's."""
    along = ray(AIR, 0.05, 90.0)
    for low, high, temperature in zip(along.heights_km, along.heights_km[1:], along.temperatures):
        heights = np.linspace(low, high, 200)
        _, at_heights, pressure = AIR.at(heights)
        mean = np.average(at_heights, weights=pressure / at_heights)
        assert temperature == pytest.approx(mean, abs=0.02)


def test_ends_at_the_ground_and_at_the_top():
    down = ray(AIR, 3.0, -30.0)
    assert down.heights_km[-1] == pytest.approx(0, abs=1e-6)
    assert down.lengths_km[-1] == pytest.approx(6.0, rel=2e-3)
    grazing = ray(AIR, 10.0, -1.0)
    assert grazing.heights_km[-1] == pytest.approx(100) and 8 < grazing.heights_km.min() < 10
    assert ray(AIR, 100.0, 10.0).lengths_km[-1] < 1e-9


def test_angle_at_the_centre_of_the_earth():
    """Without refraction it would be atan(L cos / (R + h + L sin))."""
    along = ray(AIR, 0.05, 10.0, 40.0)
    cos, sin = 40 * np.cos(np.radians(10)), 40 * np.sin(np.radians(10))
    assert along.turned_deg[-1] == pytest.approx(np.degrees(cos / (6371.28 + sin)), rel=1e-3)

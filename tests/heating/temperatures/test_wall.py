"""Walls against the closed forms of conduction."""

import numpy as np
import pytest

from mi_lcair.heating.temperatures.wall import DAY, Wall

OMEGA = 2 * np.pi / DAY


def impedance(wall: Wall, days: float = 1.0) -> complex:
    """Temperature of the surface for a flux of 1 W/m^2 that oscillates once in some days."""
    rates, shapes = wall.modes
    return np.sum(shapes[0] ** 2 / (1j * OMEGA / days + rates))


@pytest.mark.parametrize("thickness", [0.001, 0.02, 0.1])
@pytest.mark.parametrize(("conductivity", "capacity"), [(200, 2.4e6), (0.04, 3e4), (1.5, 2e6)])
def test_panel_with_an_insulated_back(thickness, conductivity, capacity):
    """Z = coth(m L) / (k m), m^2 = i omega rho c / k [Carslaw and Jaeger, section 3.6]."""
    m = np.sqrt(1j * OMEGA * capacity / conductivity)
    exact = 1 / (conductivity * m * np.tanh(m * thickness))
    wall = Wall(thickness, conductivity, 1.0, capacity)
    np.testing.assert_allclose(impedance(wall), exact, rtol=1e-7)  # a thin metal: rounding, 2e-8


@pytest.mark.parametrize("thickness", [0.7, 1.0, 4.0, 50.0])
def test_soil_is_a_semi_infinite_body(thickness):
    """Z = 1 / (k m): amplitude within 1e-3 and phase within half a degree, however deep."""
    wall = Wall(thickness, 1.2, 1800, 1100)
    exact = 1 / (1.2 * np.sqrt(1j * OMEGA * 1800 * 1100 / 1.2))
    ratio = impedance(wall) / exact
    assert abs(abs(ratio) - 1) < 1e-4
    assert abs(np.angle(ratio, deg=True)) < 0.01


@pytest.mark.parametrize("conductivity", [0.05, 1.2, 400.0])
@pytest.mark.parametrize(("duration", "error"), [(3, 1e-4), (30, 1e-3), (365, 1e-2)])
def test_soil_in_a_long_series(duration, error, conductivity):
    """The wall has the impedance of waves of a day and of the whole series."""
    wall = Wall(2000.0, conductivity, 1800, 1100, duration=duration * DAY)
    for days in (1, np.sqrt(duration), duration):
        exact = 1 / np.sqrt(1j * OMEGA / days * 1800 * 1100 * conductivity)
        assert abs(impedance(wall, days) / exact - 1) < error


@pytest.mark.parametrize("thickness", [0.05, 5.0])
@pytest.mark.parametrize("back", [np.inf, 4.0, 0.0])
def test_steady_flux_is_that_of_resistances_in_series(thickness, back):
    wall = Wall(thickness, 0.5, 1000, 900, back, 280.0)
    rates, shapes = wall.modes
    # U = Phi V with rates V = Phi^T b + Phi_0 q
    response = np.sum(shapes[0] ** 2 / rates)
    rest = np.sum(shapes[0] * (shapes.T @ wall.conduction[1]) / rates)
    flux = 0.0 if back == 0 else (310 - 280) / (thickness / 0.5 + 1 / back)
    assert (310 - rest) / response == pytest.approx(flux, rel=1e-12, abs=1e-20)


@pytest.mark.parametrize("back", [np.inf, 4.0, 0.0])
def test_modes_are_those_of_mass_and_conduction(back):
    """Phi^T M Phi = 1 and Phi^T K Phi = diag(rates)."""
    wall = Wall(0.05, 0.5, 1000, 900, back, 280.0)
    rates, shapes = wall.modes
    inner = slice(None, -1) if back == np.inf else slice(None)
    mass = shapes[inner].T * wall.mass[inner] @ shapes[inner]
    stored = np.diag(np.append(np.ones(10), np.isfinite(back)))
    np.testing.assert_allclose(mass, stored, atol=1e-12)
    stiffness = shapes.T @ wall.conduction[0] @ shapes
    np.testing.assert_allclose(stiffness, np.diag(rates), atol=1e-10 * rates.max())

"""Heat that air takes against integrals of the profiles, tables and closed forms."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

from mi_lcair.heating.temperatures.air import (
    SurfaceAir,
    evaporation,
    longwave_temperature,
    plate_convection,
    psi_heat,
    psi_momentum,
    rough_convection,
    sky_temperature,
    vapour_pressure,
)


def slopes(zeta):
    """Dimensionless gradients of wind and temperature, whose integrals are the profiles."""
    if zeta < 0:
        return (1 - 16 * zeta) ** -0.25, (1 - 16 * zeta) ** -0.5
    stable = 1 + 0.7 * zeta + 0.75 * zeta * (1 + 5 - 0.35 * zeta) * np.exp(-0.35 * zeta)
    return stable, stable


@pytest.mark.parametrize(("wind", "warmer"), [(0.4, 8.0), (3.0, 5.0), (6.0, -3.0), (3.0, 0.3)])
def test_profile_over_rough_ground(wind, warmer):
    """1e-6 of gradients that are integrated over the height and bisected for the stability."""
    z0, zh, z, zt, T = 0.01, 0.001, 10.0, 2.0, 280.0

    def state(zeta):
        def grown(bottom, top, which):
            return quad(lambda s: slopes(zeta * np.exp(s) / z)[which], np.log(bottom), np.log(top))[
                0
            ]

        f_m, f_h = grown(z0, z, 0), grown(zh, zt, 1)

        def surplus(V):  # the gusts of the heat flow that the wind V makes
            flow = 0.16 * V * warmer / (f_m * f_h)
            return V**2 - wind**2 - (1.2 * (9.81 / T * max(flow, 0) * 1000) ** (1 / 3)) ** 2

        V = brentq(surplus, wind, 50, xtol=1e-13) if warmer > 0 else wind
        return f_m, f_h, V

    def apart(zeta):
        f_m, f_h, V = state(zeta)
        friction, scale = 0.4 * V / f_m, -0.4 * warmer / f_h
        return zeta - z * 0.4 * 9.81 * scale / (T * friction**2)

    zeta = brentq(apart, *((-10, -1e-9) if warmer > 0 else (1e-9, 5)), xtol=1e-12)
    f_m, f_h, V = state(zeta)
    air = SurfaceAir(T, wind, pressure=900.0, wind_height=z, height=zt)
    h = rough_convection(np.array([T + warmer]), air, z0, zh)
    expected = 90000 / (287.05 * T) * 1005 * 0.16 * V / (f_m * f_h)
    assert h.real[0] == pytest.approx(expected, rel=1e-6)


def test_neutral_profile_is_logarithmic():
    h = rough_convection(np.array([290.0]), SurfaceAir(290.0 - 1e-9, 5.0), 0.03, 0.003).real
    expected = 101325 / (287.05 * 290) * 1005 * 0.16 * 5 / (np.log(10 / 0.03) * np.log(2 / 0.003))
    assert h[0] == pytest.approx(expected, rel=1e-4)


def test_least_wind_is_a_third_of_a_metre_a_second():
    h = [
        rough_convection(np.array([285.0]), SurfaceAir(286.0, wind), 0.01, 0.001).real[0]
        for wind in (0.1, 0.3, 0.31)
    ]
    assert h[0] == h[1] < h[2]


def test_still_air_at_an_upright_plate():
    """2 % of a worked example: 0.71 m at 232 degrees C in 23 (Incropera, example 9.2), 7.0."""
    h = plate_convection(np.array([505.15]), SurfaceAir(296.15), 0.71, "upright")
    assert h[0] == pytest.approx(7.0, rel=0.02)


@pytest.mark.parametrize(("facing", "warmer"), [("up", 20.0), ("down", -20.0)])
def test_still_air_above_a_warm_plate(facing, warmer):
    """0.14 Ra^(1/3) of large plates, whatever their size; so below a cold plate."""
    T, L = 290.0, 5.0
    film, air = T + warmer / 2, SurfaceAir(T)
    k, mu = 0.0241 * (film / 273.15) ** 0.81, 1.458e-6 * film**1.5 / (film + 110.4)
    Ra = 9.81 / film * 20 * L**3 * 0.71 / (mu * 287.05 * film / 101325) ** 2
    expected = k / L * 0.14 * Ra ** (1 / 3)
    h = plate_convection(np.array([T + warmer]), air, L, facing)
    assert h[0] == pytest.approx(expected, rel=1e-3)
    stable = plate_convection(np.array([T - warmer]), air, L, facing)
    assert stable[0] < 0.3 * h[0]


@pytest.mark.parametrize(
    ("facing", "warmer", "Ra", "Nu"),
    [
        ("upright", 20.0, 1e4, 5.432745463),
        ("upright", -20.0, 1e6, 16.558402864),
        ("upright", 20.0, 1e9, 122.856534876),
        ("down", 20.0, 1e4, 3.637167800),
        ("up", -20.0, 1e6, 7.534186650),
        ("down", 20.0, 1e9, 26.522868569),
        ("up", 20.0, 1e3, 3.0653),  # by hand: 0.835 x 0.515 Ra^(1/4) = 2.4182, 1.4 / ln(1.57894)
    ],
)
def test_still_air_as_another_program_has_it(facing, warmer, Ra, Nu):
    """Nu_vertical_plate_Churchill and Nu_horizontal_plate_Rohsenow of ht 1.2.0, Pr = 0.71."""
    film = 290 + warmer / 2
    k, mu = 0.0241 * (film / 273.15) ** 0.81, 1.458e-6 * film**1.5 / (film + 110.4)
    nu = mu * 287.05 * film / 90000
    height = (Ra * nu**2 * film / (9.81 * abs(warmer) * 0.71)) ** (1 / 3)
    length = height if facing == "upright" else 4 * height
    air = SurfaceAir(290.0, pressure=900.0)
    h = plate_convection(np.array([290 + warmer]), air, length, facing)[0]
    assert h * height / k == pytest.approx(Nu, rel=2e-4)  # the wind of Re = 1e-9


def test_turbulent_wind_as_another_program_has_it():
    """Nu_horizontal_plate_turbulent_Schlichting of ht 1.2.0, with the laminar part in squares."""
    film, length = 290.0, 20.0
    k, mu = 0.0241 * (film / 273.15) ** 0.81, 1.458e-6 * film**1.5 / (film + 110.4)
    wind = 1e7 * mu * 287.05 * film / 101325 / length
    h = plate_convection(np.array([290.0]), SurfaceAir(290.0, wind), length, "up")[0]
    laminar = 0.664 * 1e7**0.5 * 0.71 ** (1 / 3)
    assert h * length / k == pytest.approx(np.hypot(11613.912438, laminar), rel=1e-5)


def test_profiles_have_the_derivatives_of_differences():
    """By temperature and wind, through the stability that follows from both."""
    for warmer, wind in ((5.0, 2.0), (-2.0, 3.0)):
        step, T = 1e-5, np.array([285.0 + warmer])

        def h(dT=0.0, dU=0.0, T=T, wind=wind):
            return rough_convection(T + dT, SurfaceAir(285.0, wind + dU), 0.01, 0.001)

        for key in ("dT", "dU"):
            slope = h(**{key: 1e-30j}).imag / 1e-30
            ends = (h(**{key: sign * step}).real for sign in (1, -1))
            assert slope == pytest.approx(np.subtract(*ends) / (2 * step), rel=1e-5)
    for zeta in (-1e-12, 1e-12):
        assert abs(psi_momentum(np.array([zeta]))) < 1e-9 > abs(psi_heat(np.array([zeta])))


def test_wind_along_a_plate():
    """Little more than laminar at Re = 700, and 10 % of 0.037 Re^0.8 Pr^(1/3) at 3 million."""
    nu, k = 1.48e-5, 0.0253
    h = plate_convection(np.array([290.0]), SurfaceAir(290.0, 0.1), 0.1, "up")[0] * 0.1 / k
    laminar = 0.664 * (0.1 * 0.1 / nu) ** 0.5 * 0.71 ** (1 / 3)
    assert laminar < h < 1.25 * laminar
    h = plate_convection(np.array([290.0]), SurfaceAir(290.0, 10.0), 4.4, "up")[0] * 4.4 / k
    assert h == pytest.approx(0.037 * (44 / nu) ** 0.8 * 0.71 ** (1 / 3), rel=0.1)


def test_vapour_pressure_of_tables():
    """0.3 % of the saturation pressures at 20 and 0 degrees C, and over ice at -20."""
    np.testing.assert_allclose(
        vapour_pressure(np.array([293.15, 273.15, 253.15])), [2339.0, 611.2, 103.2], rtol=3e-3
    )


def test_evaporation():
    """None at the dew point; a wet surface by the Lewis relation; dew on a dry surface."""
    air = SurfaceAir(293.15, humidity=50.0, pressure=1013.25)
    dew = brentq(lambda T: vapour_pressure(T) - vapour_pressure(293.15) / 2, 273.2, 293)
    assert abs(evaporation(np.array([dew]), 10.0, air, 0.5)[0]) < 1e-6
    wet = evaporation(np.array([293.15]), 10.0, air, 1.0)[0]
    assert wet == pytest.approx(2.454e6 * 10 / 1005 * 0.622 / 101325 * 1169.5, rel=3e-3)
    assert evaporation(np.array([293.15]), 10.0, air, 0.3)[0] == pytest.approx(0.3 * wet)
    assert evaporation(np.array([275.0]), 10.0, air, 0.0)[0] < -20
    density = 101325 / (287.05 * 293.15)
    halved = evaporation(np.array([293.15]), 10.0, air, resistance=density * 1005 / 10)[0]
    assert halved == pytest.approx(wet / 2)


def test_dew_frost_and_ice():
    """Dew takes no wetness; frost is ice, 2.83 MJ/kg at -10 degrees C; water above 0."""
    moist = SurfaceAir(290.0, humidity=90.0)
    dew = [evaporation(np.array([280.0]), 10.0, moist, wet)[0] for wet in (0.2, 1.0)]
    assert dew[0] == dew[1]
    surplus = 991.8 - 0.9 * 1918.0  # saturation over water at 280 and 290 K, of tables
    assert dew[0] == pytest.approx(2.485e6 * 10 / 1005 * 0.622 / 101325 * surplus, rel=0.01)
    ice = evaporation(np.array([263.15]), 10.0, SurfaceAir(263.15), 1.0)[0]
    assert ice == pytest.approx(2.836e6 * 10 / 1005 * 0.622 / 101325 * 259.9, rel=0.012)
    assert vapour_pressure(np.array(273.65)) == pytest.approx(633.6, rel=2e-3)


def test_sky_by_humidity_and_cloud():
    """A clear sky at 290 K and 1000 Pa has the emissivity 1.24 (10 / 290)^(1/7); an overcast one
    is nearly black."""
    assert longwave_temperature(5.670374419e-8 * 300.0**4) == pytest.approx(300)
    humidity = 100 * 1000 / vapour_pressure(290.0)
    clear = (sky_temperature(290.0, humidity) / 290) ** 4
    assert clear == pytest.approx(1.24 * (10 / 290) ** (1 / 7))
    assert (sky_temperature(290.0, humidity, 1.0) / 290) ** 4 == pytest.approx(0.84 + 0.16 * clear)

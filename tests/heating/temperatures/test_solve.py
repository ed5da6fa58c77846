"""Temperatures over a day against closed forms, fine references and differences."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from mi_lcair.errors import InputError
from mi_lcair.heating.conductors import Traced
from mi_lcair.heating.temperatures.solve import course
from mi_lcair.physics.blackbody import STEFAN_BOLTZMANN
from tests.heating.temperatures.networks import network, weather

PANEL = {"conductivity": 200.0, "density": 2700.0, "heat_capacity": 900.0}
BACK = {"back_K": 295.0, "back_h": 4.0}
SOIL = {"conductivity": 1.2, "density": 1800.0, "heat_capacity": 1100.0, "thickness_mm": 2000.0}


def day_of(steps, wall, area=None, **groups):
    """A plate below the sun of a day, and a second one that it warms."""
    angle = 2 * np.pi * np.arange(1, steps + 1) / steps
    sunshine = np.maximum(0, -np.cos(angle)) * 900
    conditions = weather(steps, sun_W_m2=sunshine, air_K=290 - 8 * np.cos(angle))
    tables = {"g0": wall, "g1": wall} | groups
    between = [[0, 0.2], [0.2, 0]]
    skies, grounds = [0.7, 0.3], [0.1, 0.1]
    return network(between, skies, grounds, conditions, beam=[0.5, 0.0], groups=tables, area=area)


@pytest.mark.parametrize(
    "wall", [SOIL, *({"thickness_mm": d} | PANEL for d in (1.0, 20.0, 100.0))], ids=str
)
def test_wave_of_a_day(wall):
    """Amplitude and phase below air that swings by 20 K.

    The surface has the impedance Z = coth(m L) / (k m) [Carslaw and Jaeger, section 3.6].
    """
    steps, h = 192, 8.0
    angle = 2 * np.pi * np.arange(1, steps + 1) / steps
    conditions = weather(steps, air_K=290 + 20 * np.cos(angle), h_W_m2_K=h)
    kelvin = course(network([[0]], [0.0], [0.0], conditions, groups={"g0": wall})).kelvin[:, 0]
    wave = 2 * np.mean((kelvin - 290) * np.exp(-1j * angle))
    k, capacity = wall["conductivity"], wall["density"] * wall["heat_capacity"]
    m = np.sqrt(1j * 2 * np.pi / 86400 * capacity / k)
    Z = 1 / (k * m * np.tanh(m * wall["thickness_mm"] / 1000))
    ratio = wave / (20 * h * Z / (1 + h * Z))
    assert abs(abs(ratio) - 1) < 1e-3
    assert abs(np.angle(ratio, deg=True)) < 0.5


@pytest.mark.parametrize("thickness", [2.0, 20.0])
def test_day_with_default_steps_against_a_fine_reference(thickness):
    """0.2 K of an integrator of stiff equations with 10,000 times smaller errors."""
    wall = {"thickness_mm": thickness} | PANEL
    result = course(day_of(96, wall))
    capacity = thickness / 1000 * PANEL["density"] * PANEL["heat_capacity"]

    def rate(t, T):
        angle = 2 * np.pi * t / 86400
        sun, air = max(0.0, -np.cos(angle)) * 900, 290 - 8 * np.cos(angle)
        light = 0.2 * sun * np.sin(np.pi / 4)
        gain = 0.2 * (T[::-1] ** 4 - T**4) + np.array([0.7, 0.3]) * (260.0**4 - T**4)
        gain = STEFAN_BOLTZMANN * (gain + 0.1 * (285.0**4 - T**4)) + 8 * (air - T)
        return (gain + np.array([0.5, 0.0]) * sun + 0.6 * 0.1 * light) / capacity

    days = 1 if thickness < 10 else 3
    times = np.arange(1, 97) * 900.0 + (days - 1) * 86400
    exact = solve_ivp(
        rate, (0, days * 86400), result.kelvin[-1], "LSODA", times, rtol=1e-8, max_step=900
    )
    np.testing.assert_allclose(result.kelvin, exact.y.T, atol=0.2)


@pytest.mark.parametrize("area", [0.2, 5.0])
def test_soil_is_periodic_within_a_few_days(area):
    assert course(day_of(48, SOIL, area=[area, area])).days <= 5


def test_changes_by_inputs_are_those_of_differences():
    """Columns of the last day against solved days whose inputs differ a little."""
    wall = {"thickness_mm": 5.0} | PANEL | {"back_K": 295.0, "back_h": 4.0}
    sigma = "1 %"
    network = day_of(48, wall)
    for name in ("density", "conductivity", "back_h", "back_K"):
        changes = course(network, [network.column(name, sigma)]).changes[0]
        ends = [
            course(day_of(48, wall | {name: wall[name] * (1 + sign * 1e-2)})).kelvin
            for sign in (1, -1)
        ]
        difference = (ends[0] - ends[1]) / 2
        np.testing.assert_allclose(changes, difference, atol=2e-3 + 1e-3 * abs(difference).max())


@pytest.mark.parametrize(
    ("wall", "days", "most"),
    [({"thickness_mm": 2.0} | PANEL, 2, 48 + 12), ({}, 1, 48), (SOIL, 4, 4 * 48)],
    ids=["panel", "no wall", "soil"],
)
def test_changes_of_thin_walls_begin_in_the_first_evening(wall, days, most, monkeypatch):
    """They are those of all steps, in fewer; other walls are not repeated more often for it."""
    plates, calls = day_of(48, wall), []
    columns = [plates.column("h", "5 %")]
    rates = type(plates).rates

    def counted(self, *arguments):
        calls.append(1)
        return rates(self, *arguments)

    monkeypatch.setattr(type(plates), "rates", counted)
    result = course(plates, columns)
    assert (result.days, len(calls)) == (days, most) and result.drift < 2e-3
    monkeypatch.setattr("mi_lcair.heating.temperatures.solve.ALONE", 0.0)
    np.testing.assert_allclose(result.changes, course(plates, columns).changes, atol=1e-6)


@pytest.mark.parametrize(
    "wall", [SOIL, {"thickness_mm": 5.0} | PANEL | BACK], ids=["soil", "panel"]
)
def test_harmonics_are_what_the_steps_approach(wall, monkeypatch):
    """1e-5 K of days that are repeated until they differ by less, and of their changes."""
    monkeypatch.setattr("mi_lcair.heating.temperatures.solve.PERIODIC", 1e-6)
    plates = day_of(48, wall)
    inputs = ("h", "absorptance", "conductivity", "density", "sky_K", "emissivity")
    columns = [plates.column(name, "5 %") for name in inputs]
    steps, harmonics = (course(plates, columns, method=m) for m in ("steps", "harmonics"))
    np.testing.assert_allclose(harmonics.kelvin, steps.kelvin, rtol=0, atol=1e-5)
    np.testing.assert_allclose(harmonics.changes, steps.changes, rtol=0, atol=2e-5)
    assert harmonics.days == 1 and harmonics.residual < 0.01


def test_harmonics_refuse_what_they_cannot():
    rough = day_of(12, SOIL | {"plate": "up", "length_m": 1.0})
    windy = replace(rough, weather=replace(rough.weather, wind_m_s=0 * rough.weather.air_K))
    with pytest.raises(InputError, match='method = "harmonics" is for walls of one material'):
        course(windy, method="harmonics")


def test_series_begins_at_its_temperature():
    """A lumped panel cools exponentially."""
    wall = {"thickness_mm": 50.0} | PANEL
    conditions = weather(96, air_K=280.0)
    cooling = course(network([[0]], [0.0], [0.0], conditions, groups={"g0": wall}), start_K=320.0)
    constant = 0.05 * 2700 * 900 / 8
    exact = 280 + 40 * np.exp(-conditions.seconds / constant)
    np.testing.assert_allclose(cooling.kelvin[:, 0], exact, atol=0.05)


def test_scatter_of_the_conductors_reaches_the_temperatures():
    """Columns of the randomisations are the differences of temperatures that each would give."""
    rng = np.random.default_rng(1)
    matrices = [np.array([[0, x], [x, 0]]) for x in 0.3 + 0.01 * rng.standard_normal(8)]
    mean = np.mean(matrices, axis=0)
    skies = 0.6 + 0.01 * rng.standard_normal((8, 2))

    def of(matrix, sky):
        conditions = weather(sun_W_m2=600, sky_K=200, ground_K=330)
        return network(matrix, sky, 1 - sky, conditions, beam=[0.6, 0])

    pairs = list(zip(matrices, skies))
    base = of(mean, skies.mean(axis=0))
    runs = tuple(of(*pair).traced.mean for pair in pairs)
    noisy = replace(base, traced=Traced(runs))
    changes = course(noisy).scatter[:, 0]
    kelvin = course(base).kelvin[0]
    for pair, change in zip(pairs, changes):
        lit = replace(of(*pair), sun=base.sun)  # light of the ground is that of the mean
        np.testing.assert_allclose(change, course(lit).kelvin[0] - kelvin, atol=0.03)


def test_scatter_of_the_sunlight_reaches_the_temperatures():
    plate = network([[0]], [0.6], [0.3], weather(sun_W_m2=600))
    direct = 0.5 + 0.01 * np.random.default_rng(2).standard_normal((8, 1, 1))

    def lit(direct):
        R = len(direct)
        diffuse = {name: np.tile(getattr(plate.sun, name), (R, 1)) for name in ("sky", "ground")}
        sun = replace(plate.sun, direct=direct, **diffuse)
        return course(replace(plate, sun=sun, traced=Traced((plate.traced.mean,) * R)))

    kelvin = [lit(run[None]).kelvin[0, 0] for run in direct]
    expected = np.array(kelvin) - lit(direct.mean(axis=0)[None]).kelvin[0, 0]
    np.testing.assert_allclose(lit(direct).scatter[:, 0, 0], expected, atol=0.01)
    assert expected.std() > 0.2


def test_randomisations_that_agree_leave_an_error():
    """That of 1.5 paths, between the sky, the ground and the other plate; none with a held one."""
    a, conditions = 2e-3, weather(sky_K=200, ground_K=330, h_W_m2_K=0)
    base = network([[0, 0.1], [0.1, 0]], [0.6, 0.6], [0.3, 0.3], conditions)
    agreed = replace(base, traced=Traced((base.traced.mean,) * 8, path_area=a))
    solved = course(agreed)
    noise = solved.scatter[:, 0].std(axis=0, ddof=1) / np.sqrt(8)
    T = solved.kelvin[0]
    # Each plate alone has C dT^4 = P; together J = [[1, -.1], [-.1, 1]]
    power = 1.5 * a * (330.0**4 - 200.0**4)
    inverse = np.linalg.inv([[1.0, -0.1], [-0.1, 1.0]])
    expected = power * np.sqrt(np.sum(inverse**2, axis=1)) / (4 * T**3)
    assert noise == pytest.approx(expected, rel=1e-3)


def test_one_factor_of_all_that_heats_and_cools_changes_no_temperature():
    """Of absorptance, emissivity, h, conductivity and density; of thick soil twice conductivity."""
    angle = 2 * np.pi * np.arange(1, 49) / 48
    sunshine = np.maximum(0, -np.cos(angle)) * 900
    conditions = weather(48, sun_W_m2=sunshine, air_K=290 - 8 * np.cos(angle))
    outside = ("absorptance", "emissivity", "h")
    for wall, inputs in (
        (SOIL, {**dict.fromkeys(outside, 1), "conductivity": 2}),
        ({"thickness_mm": 5.0} | PANEL, dict.fromkeys((*outside, "conductivity", "density"), 1)),
    ):
        plate = network([[0]], [0.7], [0.1], conditions, beam=[0.5], groups={"g0": wall})
        changes = course(plate, [plate.column(name, "1 %") for name in inputs]).changes
        changes = changes[: len(inputs), :, 0]
        total = list(inputs.values()) @ changes
        assert abs(total).max() < 1e-3 * abs(changes).max()

"""Walls of layers and ground by temperature and depth, and derivatives of all that air and walls
add, against closed forms, an integrator and differences."""

from dataclasses import replace
from functools import reduce

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from mi_lcair.errors import InputError
from mi_lcair.heating.temperatures.description import LayerTable, group_of
from mi_lcair.heating.temperatures.solve import course
from tests.heating.temperatures.networks import network, weather

BRICK = {"conductivity": 0.7, "density": 1800.0, "heat_capacity": 840.0}
FOAM = {"conductivity": 0.04, "density": 30.0, "heat_capacity": 1400.0}
MOON = {"thickness_mm": 500.0, "conductivity": 3.4e-3, "density": 1800.0, "heat_capacity": 600.0}
MOON |= {"surface_conductivity": 7.4e-4, "surface_density": 1100.0, "scale_depth_mm": 60.0}
MOON |= {"radiative": 2.7}


def layers(*pairs):
    return {"layers": tuple(LayerTable(**values, thickness_mm=mm) for values, mm in pairs)}


@pytest.mark.parametrize("conductivity", [0.3, 3.0])
def test_day_after_another_wall(conductivity):
    """A day that begins with that of a wall with other cells is the same day."""
    conditions = weather(24, air_K=290 + 10 * np.sin(np.arange(24) / 24 * 2 * np.pi), h_W_m2_K=8.0)

    def day(k, **more):
        wall = layers((BRICK, 60.0), (FOAM | {"conductivity": k}, 40.0)) | {"back_K": 290.0}
        return course(network([[0]], [0.0], [0.0], conditions, groups={"g0": wall}), **more)

    first, alone = day(0.04), day(conductivity)
    assert first.cells[0].U.shape != alone.cells[0].U.shape
    after = day(conductivity, begin=first)
    np.testing.assert_allclose(after.kelvin, alone.kelvin, atol=3e-3)


def test_wave_through_layers():
    """1e-3 of the product of the layers' matrices [Carslaw and Jaeger, section 3.7]."""
    steps, h, back_h, contact = 144, 8.0, 5.0, 0.05
    angle = 2 * np.pi * np.arange(1, steps + 1) / steps
    conditions = weather(steps, air_K=290 + 20 * np.cos(angle), h_W_m2_K=h)
    outer = BRICK | {"contact_m2_K_W": 0.03}  # such as grass
    parts = (outer, 40.0), (FOAM | {"contact_m2_K_W": contact}, 60.0), (BRICK, 100.0)
    wall = layers(*parts) | {"back_K": 290.0, "back_h": back_h}
    kelvin = course(network([[0]], [0.0], [0.0], conditions, groups={"g0": wall})).kelvin[:, 0]
    wave = 2 * np.mean((kelvin - 290) * np.exp(-1j * angle))

    def matrix(values, mm):
        k, d = values["conductivity"], mm / 1000
        m = np.sqrt(2j * np.pi / 86400 * values["density"] * values["heat_capacity"] / k)
        return [
            [np.cosh(m * d), np.sinh(m * d) / (k * m)],
            [k * m * np.sinh(m * d), np.cosh(m * d)],
        ]

    first, second, third = (np.array(matrix(*part)) for part in parts)
    chain = [
        [[1, 0.03], [0, 1]],
        first,
        [[1, contact], [0, 1]],
        second,
        third,
        [[1, 1 / back_h], [0, 1]],
    ]
    (_, b), (_, d) = reduce(np.matmul, chain)  # the air behind does not swing
    Z = b / d
    ratio = wave / (20 * h * Z / (1 + h * Z))
    assert abs(abs(ratio) - 1) < 1e-3
    assert abs(np.angle(ratio, deg=True)) < 0.5


def test_steady_flux_through_layers():
    """Resistances in series, of layers, contacts and the air behind."""
    first, second = BRICK | {"contact_m2_K_W": 0.03}, FOAM | {"contact_m2_K_W": 0.05}
    wall = layers((first, 40.0), (second, 10.0)) | {"back_K": 280.0, "back_h": 5.0}
    still = weather(h_W_m2_K=2.0, air_K=320.0)
    T = course(network([[0]], [0.0], [0.0], still, groups={"g0": wall})).kelvin[0, 0]
    resistance = 0.03 + 0.04 / 0.7 + 0.05 + 0.01 / 0.04 + 1 / 5
    assert (T - 280) / resistance == pytest.approx(2 * (320 - T), rel=1e-9)


def test_steady_conductivity_by_temperature():
    """The integral of k over the temperature drives a steady flux."""
    k, chi, d, hot, cold = 0.01, 2.7, 0.02, 380.0, 200.0
    wall = {"thickness_mm": 1000 * d, "conductivity": k, "density": 1.0, "heat_capacity": 1.0}
    wall |= {"radiative": chi, "back_K": cold}
    still = weather(h_W_m2_K=2.0, air_K=400.0)
    T = course(network([[0]], [0.0], [0.0], still, groups={"g0": wall})).kelvin[0, 0]
    flux = k / d * (T - cold + chi / 350**3 * (T**4 - cold**4) / 4)
    assert flux == pytest.approx(2.0 * (400 - T), rel=1e-3)
    assert cold < T < hot


def test_ground_by_temperature_and_depth():
    """0.06 K of a stiff integrator with 200 even cells, over three hours."""
    table = {"capacity_at_K": (100.0, 300.0, 500.0), "capacity_J_kg_K": (300.0, 700.0, 900.0)}
    wall = MOON | table | {"thickness_mm": 60.0}
    conditions = weather(192, h_W_m2_K=4.0, air_K=350.0)
    few = {n: v[:24] for n, v in vars(conditions).items() if isinstance(v, np.ndarray)}
    conditions = replace(conditions, **few)
    result = course(network([[0]], [0.0], [0.0], conditions, groups={"g0": wall}), start_K=250.0)
    N = 200
    dz = 0.06 / N
    depth = (np.arange(N) + 0.5) * dz
    near = np.exp(-depth / 0.06)
    rho, k0 = 1800 - 700 * near, 3.4e-3 - (3.4e-3 - 7.4e-4) * near

    def rate(t, T):
        k = k0 * (1 + 2.7 * (T / 350) ** 3)
        inner = (T[:-1] - T[1:]) / (dz / 2 / k[:-1] + dz / 2 / k[1:])
        top = (350.0 - T[0]) / (1 / 4.0 + dz / 2 / k[0])
        flux = np.concatenate([[top], inner, [0.0]])
        c = np.interp(T, table["capacity_at_K"], table["capacity_J_kg_K"])
        return -np.diff(flux) / (rho * c * dz)

    times = conditions.seconds[[11, 23]]
    exact = solve_ivp(
        rate, (0, times[-1]), np.full(N, 250.0), "LSODA", times, rtol=1e-8, lband=1, uband=1
    ).y
    k = k0[0] * (1 + 2.7 * (exact[0] / 350) ** 3)
    surface = (4 * 350 + k / (dz / 2) * exact[0]) / (4 + k / (dz / 2))
    np.testing.assert_allclose(result.kelvin[[11, 23], 0], surface, atol=0.06)


@pytest.mark.parametrize(
    ("name", "top", "deep"), [("conductivity", 7.4e-4, 3.4e-3), ("density", 1100.0, 1800.0)]
)
def test_cells_have_the_numbers_of_their_middles(name, top, deep):
    """Over all cells, exp(-z / s) has the integral s (1 - exp(-D / s))."""
    for mm, s in ((500.0, 0.06), (20.0, 0.01)):
        table = MOON | {"thickness_mm": mm, "scale_depth_mm": 1000 * s}
        wall = group_of(table, "[groups.g0]").wall(86400.0)
        near = (deep - getattr(wall, name)) / (deep - top)
        D = wall.dz.sum()
        assert near @ wall.dz == pytest.approx(s * (1 - np.exp(-D / s)), rel=1e-3)
        np.testing.assert_allclose(np.log(near[0] / near[1]), (wall.dz[0] + wall.dz[1]) / 2 / s)


EVERYTHING = {
    "g0": MOON
    | {
        "thickness_mm": 5.0,
        "roughness_mm": 10.0,
        "heat_roughness_mm": 1.0,
        "wetness": 0.3,
        "back_W_m2": 2.0,
    },
    "g1": layers((BRICK, 40.0), (FOAM | {"contact_m2_K_W": 0.1}, 20.0))
    | {"plate": "up", "length_m": 0.5, "resistance_s_m": 100.0, "back_K": 290.0, "back_h": 4.0}
    | {"h_factor": 1.0},
}
OF_WEATHER = {"wind_m_s": 2.0, "relative_humidity": 60.0, "pressure_hPa": 900.0, "air_K": 285.0}


def everything(**changed):
    """Two plates with all that depends on temperature, in a series of six steps."""
    groups = {name: dict(table) for name, table in EVERYTHING.items()}
    conditions = OF_WEATHER | {"sky_K": 260.0}
    for name, factor in changed.items():
        group, _, bare = name.rpartition("__")
        if not group and bare in conditions:
            conditions[bare] = conditions[bare] * factor
        elif group == "g1" and bare not in groups["g1"]:
            parts = ({**vars(layer)} for layer in groups["g1"]["layers"])
            changes = ({**part, bare: part[bare] * factor} for part in parts)
            groups["g1"]["layers"] = tuple(LayerTable(**part) for part in changes)
        else:
            groups[group][bare] = groups[group][bare] * factor
    day = weather(288, sun_W_m2=600.0, **conditions)
    few = {n: v[:2] for n, v in vars(day).items() if isinstance(v, np.ndarray)}
    return network(
        [[0, 0.1], [0.1, 0]],
        [0.7, 0.6],
        [0.1, 0.1],
        replace(day, **few),
        beam=[0.5, 0.2],
        groups=groups,
    )


INPUTS = [
    *("wind_m_s", "relative_humidity", "pressure_hPa", "air_K"),
    *("g0.roughness_mm", "g0.heat_roughness_mm", "g0.wetness", "g0.back_W_m2", "g0.radiative"),
    *("g0.conductivity", "g0.surface_conductivity", "g0.surface_density", "g0.scale_depth_mm"),
    *("g0.heat_capacity", "g1.length_m", "g1.resistance_s_m", "g1.back_h", "g1.thickness_mm"),
    *("g1.conductivity", "g1.contact_m2_K_W", "g1.h"),
]


def test_derivatives_are_those_of_differences(monkeypatch):
    """1e-6 of differences of the solved temperatures, extrapolated to no step."""
    monkeypatch.setattr("mi_lcair.heating.temperatures.solve.DAILY", 1e-13)
    monkeypatch.setattr("mi_lcair.heating.temperatures.solve.PARTS", 2)
    model = everything()
    columns = [model.column(name, "100 %") for name in INPUTS]
    changes = course(model, columns, start_K=280.0).changes
    for name, change in zip(INPUTS, changes):
        key = name.replace("g1.h", "g1.h_factor").replace(".", "__")
        size = 1e-4 if name == "air_K" else 0.01

        def difference(step, key=key):
            ends = [
                course(everything(**{key: 1 + sign * step}), start_K=280.0).kelvin
                for sign in (1, -1)
            ]
            return (ends[0] - ends[1]) / (2 * step)

        expected = (4 * difference(size / 2) - difference(size)) / 3
        assert abs(expected).max() > 1e-5, name
        atol = 1e-6 * abs(expected).max() + 2e-12 / size
        np.testing.assert_allclose(change, expected, rtol=0, atol=atol, err_msg=name)


def test_slow_walls_are_soon_periodic():
    """Steel on insulation on concrete, whose time constant is a month, after few days.

    From day to day, the mean heat into an insulated wall vanishes, so that its back has the mean
    temperature of the surface.
    """
    steel = LayerTable(thickness_mm=2, conductivity=50, density=7850, heat_capacity=480)
    foam = LayerTable(thickness_mm=100, conductivity=0.04, density=30, heat_capacity=1400)
    concrete = LayerTable(thickness_mm=500, conductivity=1.6, density=2300, heat_capacity=950)
    wall = {"layers": (steel, foam, concrete)}
    day = weather(48, air_K=290 + 10 * np.cos(2 * np.pi * np.arange(1, 49) / 48))
    solved = course(network([[0]], [0.7], [0.0], day, groups={"g0": wall}))
    assert 0 < solved.days <= 3
    assert solved.cells[0].U[0, -1] == pytest.approx(solved.kelvin[:, 0].mean(), abs=0.02)


def test_measured_sky():
    """The derivative with respect to the longwave irradiance is that through its temperature."""
    plate = network([[0]], [0.7], [0.0], weather())
    (change,) = course(plate, [plate.column("down_longwave_W_m2", 1.0)]).changes[:1, 0]
    (of_sky,) = course(plate, [plate.column("sky_K", 1.0)]).changes[:1, 0]
    np.testing.assert_allclose(change, of_sky / (4 * 5.670374419e-8 * 260.0**3))


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({"wetness": 1.2}, "wetness = 1.2; must lie in 0..1"),
        ({"wetness": 0.2, "resistance_s_m": 10.0}, "wetness and resistance_s_m cannot be combined"),
        ({"layers": [{"thickness_mm": 10}]}, r"layers\[0\]: conductivity is missing"),
        ({"layers": {"thickness_mm": 10}}, "layers must be tables"),
        (
            {"layers": [BRICK | {"thickness_mm": 9}], "thickness_mm": 3},
            "cannot be combined|missing",
        ),
        ({"plate": "up"}, "length_m is missing"),
        ({"plate": "sideways", "length_m": 1.0}, "sideways"),
        ({"roughness_mm": 10.0, "h_W_m2_K": 3.0}, "one law gives"),
        ({"heat_roughness_mm": 10.0}, "heat_roughness_mm needs roughness_mm"),
        ({"scale_depth_mm": 10.0}, "surface_conductivity is missing"),
        (
            BRICK | {"thickness_mm": 9, "capacity_at_K": [200, 100], "capacity_J_kg_K": [1, 2]},
            "rise",
        ),
        ({"back_K": 290.0}, "back_K needs thickness_mm"),
        ({"radiative": 2.7}, "radiative and contact_m2_K_W need thickness_mm"),
        ({"contact_m2_K_W": 0.1, "layers": [BRICK | {"thickness_mm": 9}]}, "in its first layer"),
        (BRICK | {"thickness_mm": 9, "back_K": 290.0, "back_W_m2": 9.0}, "without back_K"),
        ({"plate": "up", "length_m": 1.0, "h_W_m2_K": 3.0}, "one law gives"),
        ({"roughness_mm": 10.0, "heat_roughness_mm": 20.0}, "is more than roughness_mm"),
        ({"albedo": [0.2, 0.9]}, "must lie in 0..1 for zenith angles"),
        ({"albedo": [-5.0]}, "must lie in 0..1 for zenith angles"),
    ],
)
def test_tables_that_are_refused(table, message):
    with pytest.raises(InputError, match=message):
        group_of(table, "[groups.g0]")


@pytest.mark.parametrize(
    ("table", "conditions", "message"),
    [
        ({"roughness_mm": 10.0}, {}, "needs wind_m_s"),
        ({"wetness": 0.5}, {}, "evaporation needs relative_humidity"),
        ({"roughness_mm": 3000.0}, {"wind_m_s": 2.0}, "reaches up to the height"),
    ],
)
def test_weather_that_lacks_what_a_law_needs(table, conditions, message):
    with pytest.raises(InputError, match=message):
        course(network([[0]], [0.7], [0.0], weather(**conditions), groups={"g0": table}))

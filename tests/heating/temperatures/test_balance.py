"""Steady temperatures against root finders, closed forms and conservation."""

import numpy as np
import pytest
from scipy import sparse
from scipy.optimize import brentq

from mi_lcair.errors import InputError
from mi_lcair.heating.temperatures.balance import NODES, WEIGHTS, Balance, HeatWall
from mi_lcair.heating.temperatures.solve import course
from mi_lcair.physics.blackbody import STEFAN_BOLTZMANN
from tests.heating.temperatures.networks import network, weather

WALL = {"thickness_mm": 50, "conductivity": 0.1, "density": 100, "heat_capacity": 1000}
SIGMAS = {
    "h": "30 %",
    "absorptance": 0.05,
    "emissivity": 0.02,
    "sky_K": 10,
    "air_K": 2,
    "ground_K": 3,
    "sun_W_m2": "5 %",
    "albedo": 0.1,
    "internal_W_m2": 5,
    "conductivity": "10 %",
    "back_K": 1,
    "g1.temperature": 4,
}


@pytest.mark.parametrize("sun", [0.0, 800.0])
@pytest.mark.parametrize("back", [{}, {"back_K": 300.0}, {"back_K": 300.0, "back_h": 5.0}])
def test_plate_with_all_terms(sun, back):
    """1e-9 K of a root finder for the sum of its fluxes."""
    table = WALL | {"internal_W_m2": 30} | back
    conditions = weather(sun_W_m2=sun, diffuse_W_m2=100)
    A = 2.0
    plate = network([[0]], [0.7], [0.2], conditions, area=[A], beam=0.5, groups={"g0": table})
    resistance = 0.05 / 0.1 + 1 / back.get("back_h", np.inf)
    through = 1 / resistance if back else 0.0

    def surplus(T):
        radiated = 0.7 * (260**4 - T**4) + 0.2 * (285**4 - T**4)
        from_ground = 0.2 * (sun * np.sin(np.radians(45)) + 100)
        absorbed = 0.5 * sun + 0.6 * (0.7 * 100 + 0.2 * from_ground)
        gained = STEFAN_BOLTZMANN * radiated + absorbed
        return gained + A * (8 * (290 - T) + 30 - through * (T - 300))

    solved = course(plate)
    assert solved.kelvin[0, 0] == pytest.approx(brentq(surplus, 200, 600, xtol=1e-12), abs=1e-9)
    assert solved.residual < 1e-8


@pytest.mark.parametrize("shields", [2, 3])
def test_radiation_shields(shields):
    """Shields of different emissivity between a hot and a cold plate.

    The resistances 1 / GR of the gaps add, so the flow and all temperatures have a closed form.
    """
    eps = np.linspace(0.05, 0.8, shields + 2)
    gaps = 1 / (1 / eps[:-1] + 1 / eps[1:] - 1)
    between = np.diag(gaps, 1) + np.diag(gaps, -1)
    last = shields + 1
    held = {"g0": {"temperature": 500.0}, f"g{last}": {"temperature": 250.0}}
    zero = np.zeros(last + 1)
    kelvin = course(network(between, zero, zero, weather(h_W_m2_K=0.0), groups=held)).kelvin[0]
    flow = STEFAN_BOLTZMANN * (500**4 - 250**4) / np.sum(1 / gaps)
    drops = np.concatenate([[0], np.cumsum(1 / gaps)]) * flow / STEFAN_BOLTZMANN
    np.testing.assert_allclose(kelvin, (500**4 - drops) ** 0.25, atol=1e-8)


def test_isothermal_room_has_its_temperature_whatever_the_noise():
    """300 K within 1e-6 K for any symmetric conductors, and heat flows that sum to 0."""
    rng = np.random.default_rng(4)
    between = sparse.random_array((300, 300), density=0.05, rng=rng)
    between = between + between.T
    outward = np.where(rng.random(300) < 0.3, rng.exponential(size=300), 0)
    balance = Balance(sparse.diags_array(between.sum(axis=1) + outward) - between)
    start = rng.uniform(100, 600, 300)
    h = np.where(rng.random(300) < 0.5, rng.exponential(10, 300), 0)
    power = STEFAN_BOLTZMANN * outward * 300.0**4 + h * 300
    kelvin, _ = balance.solve(power, h, start)
    np.testing.assert_allclose(kelvin, 300, atol=1e-6)
    inner = balance.laplacian - sparse.diags_array(outward)
    flows = inner @ start**4
    assert abs(flows.sum()) < 1e-10 * abs(flows).sum()


def example(**changed):
    """A network with every kind of input."""
    between = np.array([[0, 0.2, 0.1], [0.2, 0, 0.3], [0.1, 0.3, 0]])
    numbers = {
        "air_K": 290.0,
        "sky_K": 260.0,
        "ground_K": 285.0,
        "sun_W_m2": 700.0,
        "h_W_m2_K": 8.0,
    }
    table = WALL | {"internal_W_m2": 30.0, "back_K": 300.0}
    g1 = {"temperature": 350.0}
    for name, value in changed.items():
        where = {"conductivity": table, "back_K": table, "temperature": g1}.get(name, numbers)
        where[name] = value
    groups = {"g0": table, "g1": g1}
    return network(
        between,
        [0.3, 0.1, 0.2],
        [0.1, 0.1, 0.0],
        weather(**numbers),
        beam=[0.5, 0.1, 0],
        groups=groups,
    )


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("h", {"h_W_m2_K": 8 * 0.3}),
        ("sky_K", {"sky_K": 10}),
        ("air_K", {"air_K": 2}),
        ("ground_K", {"ground_K": 3}),
        ("sun_W_m2", {"sun_W_m2": 700 * 0.05}),
        ("conductivity", {"conductivity": 0.1 * 0.1}),
        ("back_K", {"back_K": 1}),
        ("g1.temperature", {"temperature": 4}),
    ],
)
def test_derivatives_are_those_of_differences(name, change):
    """1e-8 of what differences of the solved temperatures give, extrapolated to no step."""
    ((quantity, sigma),) = change.items()
    base = {"h_W_m2_K": 8.0, "sky_K": 260.0, "air_K": 290.0, "ground_K": 285.0, "sun_W_m2": 700.0}
    base |= {"conductivity": 0.1, "back_K": 300.0, "temperature": 350.0}

    def difference(step):
        ends = [
            course(example(**{quantity: base[quantity] + sign * step * sigma})).kelvin[0]
            for sign in (1, -1)
        ]
        return (ends[0] - ends[1]) / (2 * step)

    coarse, middle, fine = map(difference, (0.08, 0.04, 0.02))
    first, second = (4 * middle - coarse) / 3, (4 * fine - middle) / 3
    expected = (16 * second - first) / 15
    column = example().column(name, SIGMAS[name])
    changes = course(example(), [column]).changes[0, 0]
    np.testing.assert_allclose(changes, expected, atol=1e-8 * abs(expected).max() + 1e-9)


def test_derivative_with_respect_to_emissivity():
    """Against differences of conductors that radiosity gives, for three diffuse surfaces."""
    area = np.array([1.0, 2.0, 0.5])
    views = np.array([[0.0, 0.5, 0.1], [0.5, 0.3, 0.2], [0.1, 0.2, 0.0]])  # A F, symmetric
    out = area - views.sum(axis=1)

    def of(eps):
        # G = A eps (A - F rho)^-1 (F eps and F to the surroundings), F = views
        inverse = np.linalg.inv(np.diag(area) - views @ np.diag(1 - eps))
        front = np.diag(area * eps) @ inverse
        return front @ views @ np.diag(eps), front @ out

    eps = np.array([0.9, 0.3, 0.6])

    def room(shift):
        matrix, sky = of(eps + shift)
        made = network(matrix, sky, np.zeros(3), weather(h_W_m2_K=2.0, sun_W_m2=500), area=area,
                       beam=[0.5, 0, 0])  # fmt: skip
        made.facets.emissivity[:] = eps
        return made

    column = room(0.0).column("emissivity", 0.02)
    changes = course(room(0.0), [column]).changes[0, 0]
    ends = [course(room(sign * 1e-5)).kelvin[0] for sign in (1, -1)]
    np.testing.assert_allclose(changes, (ends[0] - ends[1]) / 2e-5 * 0.02, rtol=1e-5)


def test_derivative_with_respect_to_absorptance():
    """Against sunlight that radiosity gives, for three diffuse surfaces that light each other."""
    area = np.array([1.0, 2.0, 0.5])
    views = np.array([[0.0, 0.5, 0.1], [0.5, 0.3, 0.2], [0.1, 0.2, 0.0]])  # A F, symmetric
    lit = np.array([0.8, 0.3, 0.0])  # area across the beam

    def of(alpha):
        # Light that leaves reaches others by F and is reflected again
        F = views / area[:, None]
        onward = F @ np.linalg.inv(np.eye(3) - np.diag(1 - alpha) @ F)
        return (lit + (lit * (1 - alpha)) @ onward) * alpha, onward * alpha

    alpha = np.full(3, 0.6)  # of `network`
    beam, onward = of(alpha)
    room = network(views, [0.4, 1.0, 0.2], [0] * 3, weather(sun_W_m2=500.0, albedo=0.0), beam=beam,
                   area=area, onward=onward)  # fmt: skip
    for name, members in (("absorptance", slice(None)), ("g1.absorptance", slice(1, 2))):
        step = np.zeros(3)
        step[members] = 1e-6
        expected = (of(alpha + step)[0] - of(alpha - step)[0]) / 2e-6 * 0.05 * 500
        column = room.column(name, 0.05)
        np.testing.assert_allclose(column.gained(None, 0), expected, rtol=1e-6)


def test_what_leaves_by_a_law_counts_in_the_residual():
    """Nearly all heat leaves by a law that is 0 at 300 K, whatever the start."""
    balance = Balance(sparse.csr_array([[1e-6]]))
    law = lambda kelvin: (8 * (kelvin - 300), np.full(1, 8.0))
    for start in (200.0, 400.0):
        kelvin, _ = balance.solve(np.zeros(1), 0.0, [start], leaving=law)
        assert kelvin[0] == pytest.approx(300, abs=1e-3)


def test_a_rounding_that_no_step_takes_away_ends_the_iteration():
    calls = []

    def law(kelvin):
        calls.append(kelvin)
        return 8 * (kelvin - 300) + 1e-5 * (-1) ** len(calls), np.full(1, 8.0)

    kelvin, _ = Balance(sparse.csr_array([[0.1]])).solve(np.zeros(1), 1.0, [310.0], leaving=law)
    assert len(calls) < 12
    # sigma 0.1 T^4 + T + 8 (T - 300) = 0
    root = brentq(lambda T: STEFAN_BOLTZMANN * 0.1 * T**4 + T + 8 * (T - 300), 100, 300)
    assert kelvin[0] == pytest.approx(root, abs=1e-5)


def scripted(shares):
    """A law whose share of the power that is left over is scripted, and the temperatures it saw."""
    seen = []

    def law(kelvin):
        seen.append(kelvin[0])
        return np.array([1 - 2 * shares[len(seen) - 1]]), np.array([1e-3])

    return law, seen


@pytest.mark.parametrize(
    "shares", [(1.02e-7, 1.02e-7, 0.98e-7, 1.0), (0.98e-7, 0.48e-7, 0.245e-7, 1.0)]
)
def test_what_no_longer_halves_below_1e_7_is_rounding(shares):
    law, seen = scripted(shares)
    Balance(sparse.csr_array([[1e-30]])).solve(np.ones(1), np.zeros(1), [300.0], leaving=law)
    assert len(seen) == 3


def test_what_cannot_be_balanced_is_halved_sixty_times():
    seen = []
    law = lambda kelvin: (seen.append(kelvin[0]) or np.array([1e6]), np.zeros(1))
    with pytest.raises(InputError, match="after 60 steps; internal_W_m2 removes more heat"):
        Balance(sparse.csr_array([[0.1]])).solve(np.zeros(1), np.zeros(1), [300.0], leaving=law)
    np.testing.assert_allclose(seen, 300 / 2.0 ** np.arange(60))


def test_what_cannot_lose_its_heat_is_refused():
    law = lambda kelvin: (-2 * STEFAN_BOLTZMANN * 0.1 * kelvin**4, np.zeros(1))
    with pytest.raises(InputError, match="must be able to lose the heat that it absorbs"):
        Balance(sparse.csr_array([[0.1]])).solve(np.zeros(1), np.zeros(1), [300.0], leaving=law)


def test_steps_that_go_to_and_fro_are_shortened_after_eight():
    """Where a law rises twice as steeply as it says, each step leads to the other side.

    Half of the ninth step leads to the middle.
    """
    calls = []

    def law(kelvin):
        calls.append(kelvin[0])
        emitted = STEFAN_BOLTZMANN * 0.1 * kelvin**4
        return 4 * (kelvin - 300) - emitted, 2 - 4 * emitted / kelvin

    kelvin, _ = Balance(sparse.csr_array([[0.1]])).solve(
        np.zeros(1), np.zeros(1), [310.0], leaving=law
    )
    assert kelvin[0] == pytest.approx(300, abs=1e-9)
    np.testing.assert_allclose(calls, [310, 290] * 4 + [310, 300], atol=1e-6)


def test_a_surface_without_a_source_ends_at_a_millikelvin():
    """It then radiates 1e-12 of what it would at 1 K."""
    for start, is_end in ((0.995e-3, True), (1.005e-3, False)):
        kelvin, _ = Balance(sparse.csr_array([[0.5]])).solve(np.zeros(1), np.zeros(1), [start])
        assert (kelvin[0] == start) == is_end


def test_linear_systems_are_solved_as_well_as_asked():
    """Surfaces in a row, to a thousandth; without exchange, at once."""
    n, kelvin = 40, np.full(40, 300.0)
    row = sparse.diags_array([np.full(n - 1, -1.0), np.full(n, 2.1), np.full(n - 1, -1.0)],
                             offsets=[-1, 0, 1]).tocsr()  # fmt: skip
    power = np.random.default_rng(3).normal(size=(n, 1))
    found = Balance(row).linear(kelvin, np.zeros(n), power, 1e-3)
    left = power - STEFAN_BOLTZMANN * 4 * 300.0**3 * row @ found
    assert 1e-4 < np.linalg.norm(left) / np.linalg.norm(power) < 1e-3
    loss = np.linspace(0, 9, n)
    found = Balance(sparse.diags_array(np.full(n, 0.5)).tocsr()).linear(kelvin, loss, power, 0.5)
    slope = STEFAN_BOLTZMANN * 0.5 * 4 * 300.0**3 + loss
    np.testing.assert_allclose(found[:, 0], power[:, 0] / slope, rtol=1e-12)


def test_many_right_hand_sides_one_of_which_is_zero():
    """Changes by powers against a dense solver; no power changes nothing."""
    rng = np.random.default_rng(2)
    between = rng.random((5, 5))
    between = between + between.T - np.diag(2 * np.diag(between))
    laplacian = np.diag(between.sum(axis=1) + 0.3) - between
    kelvin, through = rng.uniform(200, 400, 5), rng.random(5)
    power = rng.normal(size=(5, 3)) * [1, 0, 1e-9]
    found = Balance(sparse.csr_array(laplacian)).linear(kelvin, through, power)
    matrix = STEFAN_BOLTZMANN * laplacian @ np.diag(4 * kelvin**3) + np.diag(through)
    np.testing.assert_allclose(found, np.linalg.solve(matrix, power), rtol=1e-9, atol=1e-30)
    of_two = np.column_stack([through, 2 * through])
    found = Balance(sparse.csr_array(laplacian)).linear(kelvin, of_two, power[:, [0, 2]])
    np.testing.assert_allclose(
        found[:, 1], np.linalg.solve(matrix + np.diag(through), power[:, 2]), rtol=1e-9
    )


def test_groups_without_a_path_for_heat_are_refused():
    still = weather(h_W_m2_K=0.0)
    with pytest.raises(InputError, match="group g0: facet 0 has no path for heat"):
        course(network([[0]], [0.0], [0.0], still))
    with pytest.raises(InputError, match="group g1: facet 1 has no path for heat"):
        course(network([[0, 0, 0], [0, 0, 0.2], [0, 0.2, 0]], [1.0, 0, 0], [0] * 3, still))


@pytest.mark.parametrize(
    "way", [{"temperature": 300.0}, {"back_K": 300.0} | WALL, {"h_W_m2_K": 1.0}]
)
def test_heat_finds_its_way_through_other_facets(way):
    pair = network([[0, 0.2], [0.2, 0]], [0, 0], [0, 0], weather(h_W_m2_K=0.0, air_K=300.0),
                   groups={"g1": way})  # fmt: skip
    np.testing.assert_allclose(course(pair).kelvin, 300)


def test_what_has_no_source_is_cold():
    plate = network([[0]], [1.0], [0.0], weather(h_W_m2_K=0.0, sky_K=0.0))
    assert course(plate).kelvin[0, 0] < 0.01


def test_more_cooling_than_heat_is_refused():
    cooled = network(
        [[0]], [1.0], [0.0], weather(h_W_m2_K=0.0), groups={"g0": {"internal_W_m2": -900.0}}
    )
    with pytest.raises(InputError, match="internal_W_m2 removes more heat"):
        course(cooled)


def test_a_network_without_a_free_group_has_its_temperatures():
    held = network([[0]], [1.0], [0.0], weather(), groups={"g0": {"temperature": 400.0}})
    assert course(held).kelvin[0, 0] == 400


# Walls against the closed forms of conduction
# --------------------------------------------

OMEGA = 2 * np.pi / 86400


def impedance(wall: HeatWall, days: float = 1.0) -> complex:
    """Temperature of the surface for a flux of 1 W/m^2 that oscillates once in some days."""
    rates, shapes = wall.modes
    return np.sum(shapes[0] ** 2 / (1j * OMEGA / days + rates))


@pytest.mark.parametrize("thickness", [0.001, 0.02, 0.1])
@pytest.mark.parametrize(("conductivity", "capacity"), [(200, 2.4e6), (0.04, 3e4), (1.5, 2e6)])
def test_panel_with_an_insulated_back(thickness, conductivity, capacity):
    """Z = coth(m L) / (k m), m^2 = i omega rho c / k [Carslaw and Jaeger, section 3.6]."""
    m = np.sqrt(1j * OMEGA * capacity / conductivity)
    exact = 1 / (conductivity * m * np.tanh(m * thickness))
    wall = HeatWall(thickness, conductivity, 1.0, capacity)
    np.testing.assert_allclose(impedance(wall), exact, rtol=1e-7)  # a thin metal: rounding, 2e-8


@pytest.mark.parametrize("thickness", [0.7, 1.0, 4.0, 50.0])
def test_soil_is_a_semi_infinite_body(thickness):
    """Z = 1 / (k m): amplitude within 1e-3 and phase within half a degree, however deep."""
    wall = HeatWall(thickness, 1.2, 1800, 1100)
    exact = 1 / (1.2 * np.sqrt(1j * OMEGA * 1800 * 1100 / 1.2))
    ratio = impedance(wall) / exact
    assert abs(abs(ratio) - 1) < 1e-4
    assert abs(np.angle(ratio, deg=True)) < 0.01


@pytest.mark.parametrize("conductivity", [0.05, 1.2, 400.0])
@pytest.mark.parametrize(("duration", "error"), [(3, 1e-4), (30, 1e-3), (365, 1e-2)])
def test_soil_in_a_long_series(duration, error, conductivity):
    """The wall has the impedance of waves of a day and of the whole series."""
    wall = HeatWall(2000.0, conductivity, 1800, 1100, duration=duration * 86400)
    for days in (1, np.sqrt(duration), duration):
        exact = 1 / np.sqrt(1j * OMEGA / days * 1800 * 1100 * conductivity)
        assert abs(impedance(wall, days) / exact - 1) < error


def test_a_wall_evens_out_at_the_rates_of_its_cosines():
    """Insulated on both sides: (k pi)^2 over the time of diffusion, and 0 [Carslaw and Jaeger]."""
    wall = HeatWall(0.05, 0.5, 1000, 900)
    rates = np.sort(wall.modes[0])
    assert rates[0] < 1e-15
    np.testing.assert_allclose(rates[1:4] * wall.diffusion, (np.pi * np.arange(1, 4)) ** 2, 1e-5)
    assert wall.penetration(wall.diffusion * np.pi) == pytest.approx(0.05)


@pytest.mark.parametrize("thickness", [0.05, 50.0])
def test_what_a_wall_stores(thickness):
    """The whole wall's heat, or that down to six penetration depths of the day."""
    wall = HeatWall(thickness, 0.5, 1000, 900)
    deepest = 6 * np.sqrt(0.5 / (1000 * 900) * 86400 / np.pi)
    assert wall.mass.sum() == pytest.approx(1000 * 900 * min(thickness, deepest), rel=1e-12)


@pytest.mark.parametrize("days", [1.003, 30, 365])
def test_nodes_of_a_long_series_are_as_close_at_the_surface(days):
    """As those of a day, and their depths add up to that of the series."""
    wall = HeatWall(2000.0, 0.5, 1000, 900, duration=days * 86400)
    daily = HeatWall(2000.0, 0.5, 1000, 900)
    assert wall.stretch[0] == pytest.approx(daily.stretch[0], rel=1e-6)
    assert wall.stretch @ WEIGHTS / 2 == pytest.approx(daily.depth * days**0.5, rel=1e-3)
    assert np.ptp(np.diff(np.log(wall.stretch)) / np.diff(NODES)) < 1e-6


@pytest.mark.parametrize("thickness", [0.05, 5.0])
@pytest.mark.parametrize("back", [np.inf, 4.0, 0.0])
def test_steady_flux_is_that_of_resistances_in_series(thickness, back):
    wall = HeatWall(thickness, 0.5, 1000, 900, back, 280.0)
    rates, shapes = wall.modes
    # U = Phi V with rates V = Phi^T b + Phi_0 q
    response = np.sum(shapes[0] ** 2 / rates)
    rest = np.sum(shapes[0] * (shapes.T @ wall.conduction[1]) / rates)
    flux = 0.0 if back == 0 else (310 - 280) / (thickness / 0.5 + 1 / back)
    assert (310 - rest) / response == pytest.approx(flux, rel=1e-12, abs=1e-20)


@pytest.mark.parametrize("back", [np.inf, 4.0, 0.0])
def test_modes_are_those_of_mass_and_conduction(back):
    """Phi^T M Phi = 1 and Phi^T K Phi = diag(rates)."""
    wall = HeatWall(0.05, 0.5, 1000, 900, back, 280.0)
    rates, shapes = wall.modes
    inner = slice(None, -1) if back == np.inf else slice(None)
    mass = shapes[inner].T * wall.mass[inner] @ shapes[inner]
    stored = np.diag(np.append(np.ones(10), np.isfinite(back)))
    np.testing.assert_allclose(mass, stored, atol=1e-12)
    stiffness = shapes.T @ wall.conduction[0] @ shapes
    np.testing.assert_allclose(stiffness, np.diag(rates), atol=1e-10 * rates.max())

"""Temperatures over the times of a weather, and their derivatives with respect to inputs.

Time steps are those of BDF2. The nodes of a wall are eliminated facet by facet: with its mass
matrix M, the temperatures H that earlier steps give and the flux q into the surface,

    A U = M H / dt + b + e_0 q,    A = 3/2 M / dt + K,

so that the surface has the temperature r + q / g with r = (A^-1 (M H / dt + b))_0 and
g = 1 / (A^-1)_00. What remains is one equation for each facet, see `balance`. A change of U that is
due to an input of the wall has the same A, and d(M / dt) H + db - dA U in its source.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm

from mi_lcair.errors import InputError
from mi_lcair.heating.temperatures.network import STEP, Change, Network
from mi_lcair.heating.temperatures.wall import CELLS, DAY, Wall
from mi_lcair.physics.blackbody import STEFAN_BOLTZMANN

PERIODIC = 2e-3  # largest distance of a temperature from its periodic value [K]
MOST_DAYS = 60
EARLY = 8  # part of a day after which it is compared with the day before
DAILY = 1e-9  # residual of the balance of a step, as a fraction of the power
ROUGH = 1e-5  # residual of the changes by the columns, as a fraction of the power
BDF2, EULER = 1.5, 1.0  # coefficients of the new temperatures in a step
PARTS = 16  # implicit Euler steps in place of a first step of BDF2


@dataclass(frozen=True)
class Course:
    """Temperatures of the facets over the times of a weather.

    kelvin: (m, n). changes: (columns, m, n), their changes by the columns [K]. residual: largest
    power that is left over [W]. days: number of days that were calculated. drift: largest distance
    of a temperature from its periodic value, as the last day shows it [K].
    """

    kelvin: np.ndarray
    changes: np.ndarray
    residual: float
    days: int = 0
    drift: float = 0.0


class Step:
    """An implicit step of a wall over some seconds.

    mass: M / dt, (nodes, 1). back: b, (nodes, 1). matrix: A, (nodes, nodes). conductance: g.
    """

    def __init__(self, wall: Wall, seconds: float, scheme: float):
        self.mass = (wall.mass() / seconds)[:, None]
        self.back = np.eye(CELLS + 1)[:, -1:] * (wall.outward * wall.back_temperature)
        self.matrix = np.diag(scheme * self.mass[:, 0]) + wall.conduction()
        self.inverse = np.linalg.inv(self.matrix)
        self.conductance = 1 / self.inverse[0, 0]

    def varied(self, history: np.ndarray, nodes: np.ndarray) -> np.ndarray:
        """What a complex step of the wall adds to the source of the changes, (nodes, n)."""
        added = self.mass.imag * history + self.back.imag - self.matrix.imag @ nodes
        return added / STEP


def steady(network: Network, columns=()) -> Course:
    """The temperatures at which nothing changes, in the mean weather of a network."""
    power, conductance = (values.mean(axis=0) for values in network.loads())
    area, free = network.facets.area, network.is_free
    g, r = through_walls(network, Change())
    outward = conductance + area[free] * g[free]
    start = np.full(len(power), network.weather.air_K[0])
    kelvin, residual = network.balance.solve(power + area[free] * (g * r)[free], outward, start)
    rates = np.zeros((len(kelvin), len(columns)))
    for k, column in enumerate(columns):
        rates[:, k] = column.gained(kelvin, 0)
        if column.walls:
            g_changed, r_changed = through_walls(network, column.walls)
            into = g_changed[free] * (r_changed[free] - kelvin)
            rates[:, k] += area[free] * into.imag / STEP
    changes = network.balance.linear(kelvin, outward, rates).T
    return Course(
        kelvin=network.whole(kelvin)[None],
        changes=np.array([network.spread(*pair) for pair in zip(changes, columns)])[:, None],
        residual=residual,
    )


def through_walls(network: Network, change: Change) -> tuple[np.ndarray, np.ndarray]:
    """Conductance and far temperature of the steady walls of all facets, each (n,)."""
    g, r = np.array([network.wall(group, change).steady() for group in network.tables]).T
    return g[network.facets.group], r[network.facets.group]


def course(network: Network, columns=(), start_K: float | None = None) -> Course:
    """Temperatures at the times of a weather.

    Parameters
    ----------
    network : Network
    columns : sequence of Column
        What the temperatures are differentiated by.
    start_K : float or None
        Temperature of everything one step before the first time. None: the times are those of a
        day, which is repeated until it is periodic.

    Raises
    ------
    InputError
        If the days do not become periodic, or a balance does not converge.
    """
    if len(network.weather.seconds) == 1:
        return steady(network, columns)
    start = steady(network).kelvin[0] if start_K is None else start_K
    march = March(network, columns, np.broadcast_to(start, network.facets.area.shape))
    days, drift = 0, np.inf
    if start_K is not None:
        march.series()
        days, drift = 1, 0.0
    while drift >= PERIODIC:
        if days == MOST_DAYS:
            raise InputError(f"the temperatures still change by {drift:.2g} K after {days} days")
        days, drift = days + 1, march.repeat()
    return Course(march.kelvin, march.changes, march.residual, days, drift)


class March:
    """Steps over the times of a network's weather.

    state: temperatures of the nodes of all walls at the last two times, (2, nodes, n) [K].
    tangents: their changes by the columns, (2, columns, nodes, n) [K].
    """

    def __init__(self, network: Network, columns, kelvin: np.ndarray):
        self.network, self.columns = network, columns
        times = network.weather.seconds
        seconds = float(times[1] - times[0])
        self.walls = {
            group: members
            for group, members in zip(network.tables, network.members)
            if network.wall(group).thickness
        }

        def steps(change):
            return {
                scheme: {name: Step(network.wall(name, change), dt, scheme) for name in self.walls}
                for scheme, dt in ((EULER, seconds / PARTS), (BDF2, seconds))
            }

        self.steps = steps(Change())
        # Complex steps of the columns that are of walls
        self.varied = {c: steps(column.walls) for c, column in enumerate(columns) if column.walls}
        profile = np.broadcast_to(kelvin, (CELLS + 1, len(kelvin))).copy()
        for group, members in self.walls.items():
            profile[:, members] = network.wall(group).profile(kelvin[members])
        self.state = np.stack([profile, profile])
        self.tangents = np.zeros((2, len(columns), *profile.shape))
        self.power, self.conductance = network.loads()
        self.kelvin = np.tile(kelvin, (len(times), 1))
        self.changes = np.zeros((len(columns), *self.kelvin.shape))
        self.residual = 0.0
        self.passed = None  # what was `now` at the early time of the day before

    def series(self) -> None:
        """Take the steps to all times. The first, of which no earlier one is known, has parts."""
        before = self.state[1], self.tangents[1]
        for _ in range(PARTS):
            self.step(0, EULER)
        self.state[0], self.tangents[0] = before
        for k in range(1, len(self.kelvin)):
            self.step(k, BDF2)

    def repeat(self) -> float:
        """Take the steps of a day until it is known; returns how far it was from periodic [K].

        A day that goes through the same temperatures and changes early on as the day before goes
        through all others too.
        """
        begin, early = self.now, len(self.kelvin) // EARLY
        for k in range(len(self.kelvin)):
            self.step(k, BDF2)
            if k == early:
                passed, self.passed = self.passed, self.now
                if passed is not None and (drift := abs(self.passed - passed).max()) < PERIODIC:
                    return float(drift)
        change = self.now - begin
        left = self.left(change)
        self.state, self.tangents = self.state + left[0], self.tangents + left[1:]
        return float(abs(change + left).max())

    @property
    def now(self) -> np.ndarray:
        """Temperatures of the nodes and their changes at the last time, (1 + columns, nodes, n)."""
        return np.concatenate([self.state[1:], self.tangents[1]])

    def left(self, change: np.ndarray) -> np.ndarray:
        """How far temperatures still are from periodic ones, from their change over a day.

        A wall below a surface that loses heat in proportion to its temperature changes by
        U = Phi U from day to day, so that (I - Phi)^-1 Phi of a change is left to do. change:
        (..., nodes, n).
        """
        result, facets = np.zeros_like(change), self.network.facets
        loss = np.full(len(facets.area), np.nan)
        slope = 4 * STEFAN_BOLTZMANN * self.kelvin.mean(axis=0) ** 3 * self.network.conductors.total
        loss[self.network.is_free] = self.conductance.mean(axis=0)
        loss = (loss + slope) / facets.area
        for group, members in self.walls.items():
            wall = self.network.wall(group)
            matrix = wall.conduction()
            matrix[0, 0] += loss[members].mean()
            day = expm(-matrix / wall.mass()[:, None] * DAY)
            rest = np.linalg.solve(np.eye(CELLS + 1) - day, day)
            result[..., members] = rest @ change[..., members]
        return result

    def step(self, k: int, scheme: float) -> None:
        """Take the step to a time, of the temperatures and then of their changes."""
        network, steps = self.network, self.steps[scheme]
        area, free = network.facets.area, network.is_free
        history, into = earlier(self.state, scheme), np.zeros(len(area))
        for group, step in steps.items():
            into[self.walls[group]] = step.conductance
        into *= area
        source = {g: s.mass * history[:, self.walls[g]] + s.back for g, s in steps.items()}
        r = self.surfaces(steps, source, history)
        outward = self.conductance[k] + into[free]
        power = self.power[k] + (into * r)[free]
        solved, residual = network.balance.solve(power, outward, self.kelvin[k][free], DAILY)
        self.residual = max(self.residual, residual)
        self.kelvin[k] = network.whole(solved)
        self.state = self.stepped(self.state, steps, source, self.kelvin[k] - r)
        if not self.columns:
            return
        changed = earlier(self.tangents, scheme)
        source = {g: s.mass * changed[..., self.walls[g]] for g, s in steps.items()}
        for c, of_scheme in self.varied.items():
            for group, varied in of_scheme[scheme].items():
                members = self.walls[group]
                source[group][c] += varied.varied(history[:, members], self.state[1][:, members])
        r = self.surfaces(steps, source, changed)
        rates = np.array([column.gained(solved, k) for column in self.columns])
        rates += (into * r)[..., free]
        solved = network.balance.linear(solved, outward, rates.T, ROUGH).T
        surfaces = np.array([network.spread(*pair) for pair in zip(solved, self.columns)])
        self.changes[:, k] = surfaces
        self.tangents = self.stepped(self.tangents, steps, source, surfaces - r)

    def surfaces(self, steps, source, history) -> np.ndarray:
        """Temperatures of the surfaces without a flux, (..., n); 0 without a wall."""
        surface = np.zeros_like(history[..., 0, :])
        for group, members in self.walls.items():
            surface[..., members] = steps[group].inverse[0] @ source[group]
        return surface

    def stepped(self, before, steps, source, above) -> np.ndarray:
        """The last two states, (2, ..., nodes, n). above: surfaces, from those without a flux."""
        nodes = before[1].copy()
        for group, members in self.walls.items():
            step = steps[group]
            source[group][..., 0, :] += step.conductance * above[..., members]
            nodes[..., members] = step.inverse @ source[group]
        return np.stack([before[1], nodes])


def earlier(states: np.ndarray, scheme: float) -> np.ndarray:
    """The temperatures H of a step, from those of the last two times."""
    return states[1] if scheme == EULER else 2 * states[1] - 0.5 * states[0]

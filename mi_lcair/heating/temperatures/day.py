"""Temperatures over the times of a weather, and their derivatives with respect to inputs.

Time steps are those of BDF2. The nodes of a wall are eliminated facet by facet: with its mass
matrix M, the temperatures H that earlier steps give and the flux q into the surface,

    U = P (M H / dt + b) + P e_0 q,    P = (3/2 M / dt + K)^-1,

so that the surface has the temperature r + q / g with r = (P (M H / dt + b))_0 and g = 1 / P_00.
What remains is one equation for each facet, see `balance`.
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
NUMBERS = np.arange(CELLS + 1)  # of the nodes
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
    """An implicit step of a wall over some seconds."""

    def __init__(self, wall: Wall, seconds: float, scheme: float):
        self.mass = (wall.mass() / seconds)[:, None]
        self.inverse = np.linalg.inv(np.diag(scheme * self.mass[:, 0]) + wall.conduction())
        self.back = np.eye(CELLS + 1)[:, -1:] * (wall.outward * wall.back_temperature)
        self.conductance = 1 / self.inverse[0, 0]
        self.is_changed = any(map(np.iscomplexobj, (self.mass, self.inverse, self.back)))

    def source(self, history: np.ndarray) -> np.ndarray:
        """M H / dt + b of temperatures of earlier steps, (nodes, n)."""
        return self.mass * history + self.back

    def surface(self, source: np.ndarray) -> np.ndarray:
        """Temperature of a surface without flux, (n,)."""
        return self.inverse[0] @ source

    def nodes(self, source: np.ndarray, flux: np.ndarray) -> np.ndarray:
        """Temperatures of the nodes, (..., nodes, n); changes the source."""
        source[..., 0, :] += flux
        return self.inverse @ source

    def shift(self, history, change, kelvin) -> tuple[np.ndarray, np.ndarray]:
        """What a change of earlier temperatures (nodes, n) does while the surface keeps its own.

        Returns the changed source, and the change of the flux from the wall to the surface
        [W m^-2], (n,). Both are complex steps for a wall that changes itself.
        """
        if self.is_changed:
            source = self.source(history + 1j * STEP * change)
            return source, (self.conductance * (self.surface(source) - kelvin)).imag / STEP
        source = self.mass * change
        return source, self.conductance * self.surface(source)

    def shifted(self, source, kelvin, change) -> np.ndarray:
        """Changes of the nodes for a changed source and a change of the surface, (nodes, n)."""
        if self.is_changed:
            flux = self.conductance * (kelvin + 1j * STEP * change - self.surface(source))
            return self.nodes(source, flux).imag / STEP
        return self.nodes(source, self.conductance * (change - self.surface(source)))


def steady(network: Network, columns=()) -> Course:
    """The temperatures at which nothing changes, in the first weather of a network."""
    power, conductance = (values[0] for values in network.loads())
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
    if start_K is not None:
        march = March(network, columns, np.full(len(network.facets.area), start_K))
        march.begin()
        march.run(first=1)
        return march.course(1, 0.0)
    begin = steady(network.mean())
    march = March(network, columns, begin.kelvin[0])
    days, drift = 0, np.inf
    while drift >= PERIODIC:
        if days == MOST_DAYS:
            raise InputError(f"the temperatures still change by {drift:.2g} K after {days} days")
        days, drift = days + 1, march.repeat()
    return march.course(days, drift)


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
        changes = [Change(), *(column.walls for column in columns if column.walls)]
        lengths = (EULER, seconds / PARTS), (BDF2, seconds)
        self.steps = [
            {
                scheme: {name: Step(network.wall(name, change), dt, scheme) for name in self.walls}
                for scheme, dt in lengths
            }
            for change in changes
        ]
        plain = [c for c, column in enumerate(columns) if not column.walls]
        others = [[c] for c, column in enumerate(columns) if column.walls]
        # Columns that share steps, and the steps
        self.batches = list(zip([plain, *others], self.steps)) if plain or others else []
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

    def begin(self) -> None:
        """Take the first step, of which no earlier one is known, in parts."""
        before = self.state[1], self.tangents[1]
        for _ in range(PARTS):
            self.step(0, EULER)
        self.state[0], self.tangents[0] = before

    def run(self, first: int = 0) -> None:
        """Take the steps to all times from the first one."""
        for k in range(first, len(self.kelvin)):
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
        """Take the step to a time."""
        network, steps = self.network, self.steps[0][scheme]
        area, free = network.facets.area, network.is_free
        history = earlier(self.state, scheme)
        g, r = np.zeros((2, len(area)))
        sources = {}
        for group, members in self.walls.items():
            sources[group] = steps[group].source(history[:, members])
            g[members], r[members] = steps[group].conductance, steps[group].surface(sources[group])
        into = area * g
        outward = self.conductance[k] + into[free]
        solved, residual = network.balance.solve(
            self.power[k] + (into * r)[free], outward, self.kelvin[k][free], DAILY
        )
        self.residual = max(self.residual, residual)
        self.kelvin[k] = network.whole(solved)
        nodes = self.state[1].copy()
        for group, members in self.walls.items():
            flux = g[members] * (self.kelvin[k][members] - r[members])
            nodes[:, members] = steps[group].nodes(sources[group], flux)
        self.state = np.stack([self.state[1], nodes])
        if self.columns:
            self.step_columns(k, scheme, history, outward)

    def step_columns(self, k: int, scheme: float, history, outward) -> None:
        """Take the step of the changes by the columns, after that of the temperatures."""
        network, kelvin = self.network, self.kelvin[k]
        area, free = network.facets.area, network.is_free
        changed, into = earlier(self.tangents, scheme), np.zeros((len(self.columns), len(area)))
        parts = []
        for columns, steps in self.batches:
            for group, members in self.walls.items():
                step, where = steps[scheme][group], np.ix_(columns, NUMBERS, members)
                shifted = step.shift(history[:, members], changed[where], kelvin[members])
                into[np.ix_(columns, members)] = shifted[1]
                parts.append((step, where, shifted[0]))
        rates = np.array([column.gained(kelvin[free], k) for column in self.columns])
        rates += (area * into)[:, free]
        solved = network.balance.linear(kelvin[free], outward, rates.T, ROUGH).T
        for c, column in enumerate(self.columns):
            self.changes[c, k] = network.spread(solved[c], column)
        new = self.tangents[1].copy()
        for step, (columns, nodes, members), source in parts:
            surface = self.changes[columns[:, 0], k, members[0]]
            new[columns, nodes, members] = step.shifted(source, kelvin[members[0, 0]], surface)
        self.tangents = np.stack([self.tangents[1], new])

    def course(self, days: int, drift: float) -> Course:
        """What the last day gave."""
        return Course(self.kelvin, self.changes, self.residual, days, drift)


def earlier(states: np.ndarray, scheme: float) -> np.ndarray:
    """The temperatures H of a step, from those of the last two times."""
    return states[1] if scheme == EULER else 2 * states[1] - 0.5 * states[0]

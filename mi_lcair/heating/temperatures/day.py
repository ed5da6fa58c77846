"""Temperatures over the times of a weather, and their derivatives with respect to inputs.

Time steps are those of BDF2. The nodes of a wall are eliminated facet by facet: with its mass
matrix M, the temperatures H that earlier steps give and the flux q into the surface,

    A U = M H / dt + b + e_0 q,    A = 3/2 M / dt + K,

so that the surface has the temperature r + q / g with r = (A^-1 (M H / dt + b))_0 and
g = 1 / (A^-1)_00. What remains is one equation for each facet, see `balance`. A change of U that is
due to an input of the wall has the same A, and d(M / dt) H + db - dA U in its source.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import expm

from mi_lcair.errors import InputError
from mi_lcair.heating.temperatures.network import STEP, Network
from mi_lcair.heating.temperatures.wall import CELLS, DAY
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

    kelvin: (m, n). changes: (columns, m, n), their changes by the columns [K]. scatter: (R, m, n),
    those by each randomisation of the paths. residual: largest power that is left over [W]. days:
    number of days that were calculated. drift: largest distance of a temperature from its periodic
    value, as the last day shows it [K].
    """

    kelvin: np.ndarray
    changes: np.ndarray
    scatter: np.ndarray
    residual: float
    days: int = 0
    drift: float = 0.0


class Step:
    """An implicit step of the walls of all facets over some seconds; 0 where there is none.

    mass, back: M / dt and b, (nodes, n). matrices: A, by group.
    """

    def __init__(self, network: Network, seconds: float, scheme: float):
        walls, group, last = network.walls, network.facets.group, np.eye(CELLS + 1)[-1]
        mass = np.array([wall.mass() / seconds for wall in walls])
        back = np.array([last * wall.outward * wall.back_temperature for wall in walls])
        self.mass, self.back, self.members = mass[group].T, back[group].T, network.members
        self.matrices = [
            np.diag(scheme * rate) + wall.conduction() for rate, wall in zip(mass, walls)
        ]

    @cached_property
    def inverses(self) -> list[np.ndarray]:
        """A^-1, by group; 0 without a wall."""
        return [np.linalg.inv(matrix) if matrix.any() else matrix for matrix in self.matrices]

    @cached_property
    def first(self) -> np.ndarray:
        """Row 0 of A^-1, (nodes, n)."""
        return self.times(self.inverses, np.tile(np.eye(CELLS + 1)[:, :1], self.mass.shape[1]))

    @cached_property
    def conductance(self) -> np.ndarray:
        """g, (n,)."""
        return np.divide(1, self.first[0], out=np.zeros(len(self.first.T)), where=self.first[0] > 0)

    def times(self, matrices: list[np.ndarray], values: np.ndarray) -> np.ndarray:
        """Products of the groups' matrices and values of nodes, (..., nodes, n)."""
        products = np.zeros_like(values)
        for matrix, members in zip(matrices, self.members):
            if matrix.any():
                # An array in C's order, unlike values[..., members], is multiplied 50 times faster
                products[..., members] = matrix @ np.take(values, members, axis=-1)
        return products

    def varied(self, history: np.ndarray, nodes: np.ndarray) -> np.ndarray:
        """What a complex step of the walls adds to the source of the changes, (nodes, n)."""
        of_nodes = self.times([matrix.imag for matrix in self.matrices], nodes)
        return (self.mass.imag * history + self.back.imag - of_nodes) / STEP


def steady(network: Network, columns=()) -> Course:
    """The temperatures at which nothing changes, in the mean weather of a network."""
    power, conductance = (values.mean(axis=0) for values in network.loads())
    area, free = network.facets.area, network.is_free
    g, r = network.through_walls()
    outward = conductance + (area * g)[free]
    start = np.full(len(power), network.weather.air_K[0])
    kelvin, residual = network.balance.solve(power + (area * g * r)[free], outward, start)
    rates = network.rates(columns, kelvin, 0)
    for row, column in zip(rates, columns):
        if column.walls:
            g_changed, r_changed = column.walls.through_walls()
            into = area * g_changed * (r_changed - network.whole(kelvin))
            row += into[free].imag / STEP
    changes = network.spread(network.balance.linear(kelvin, outward, rates.T).T, columns)[:, None]
    count = len(columns)
    return Course(network.whole(kelvin)[None], changes[:count], changes[count:], residual)


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
    changes, count = march.changes, len(columns)
    return Course(march.kelvin, changes[:count], changes[count:], march.residual, days, drift)


class March:
    """Steps over the times of a network's weather.

    states: temperatures of the nodes of all walls [K], and then their changes by the columns and
    the randomisations, at the last two times, (2, 1 + changes, nodes, n).
    """

    def __init__(self, network: Network, columns, kelvin: np.ndarray):
        self.network, self.columns = network, columns
        times = network.weather.seconds
        seconds = float(times[1] - times[0])

        def steps(network):
            parts = (EULER, seconds / PARTS), (BDF2, seconds)
            return {scheme: Step(network, dt, scheme) for scheme, dt in parts}

        self.steps = steps(network)
        self.varied = {c: steps(column.walls) for c, column in enumerate(columns) if column.walls}
        count = len(columns) + len(network.traced.replicates)
        self.states = np.zeros((2, 1 + count, CELLS + 1, len(kelvin)))
        for wall, members in zip(network.walls, network.members):
            if wall.thickness:
                self.states[:, 0][..., members] = wall.profile(kelvin[members])
        self.power, self.conductance = network.loads()
        self.kelvin = np.tile(kelvin, (len(times), 1))
        self.changes = np.zeros((count, *self.kelvin.shape))
        self.residual = 0.0
        self.passed = None  # the state at the early time of the day before

    def series(self) -> None:
        """Take the steps to all times. The first, of which no earlier one is known, has parts."""
        before = self.states[1]
        for _ in range(PARTS):
            self.step(0, EULER)
        self.states[0] = before
        for k in range(1, len(self.kelvin)):
            self.step(k, BDF2)

    def repeat(self) -> float:
        """Take the steps of a day until it is known; returns how far it was from periodic [K].

        A day that goes through the same temperatures and changes early on as the day before goes
        through all others too.
        """
        begin, early = self.states[1], len(self.kelvin) // EARLY
        for k in range(len(self.kelvin)):
            self.step(k, BDF2)
            if k == early:
                passed, self.passed = self.passed, self.states[1]
                if passed is not None and (drift := abs(self.passed - passed).max()) < PERIODIC:
                    return float(drift)
        change = self.states[1] - begin
        left = self.left(change)
        self.states = self.states + left
        return float(abs(change + left).max())

    def left(self, change: np.ndarray) -> np.ndarray:
        """How far temperatures still are from periodic ones, from their change over a day.

        A wall below a surface that loses heat in proportion to its temperature changes by
        U = Phi U from day to day, so that (I - Phi)^-1 Phi of a change is left to do. change:
        (..., nodes, n).
        """
        network, result = self.network, np.zeros_like(change)
        loss = np.zeros(len(self.kelvin.T))
        loss[network.is_free] = self.conductance.mean(axis=0)
        slope = 4 * STEFAN_BOLTZMANN * self.kelvin.mean(axis=0) ** 3 * network.conductors.total
        loss = (loss + slope) / network.facets.area
        for wall, members in zip(network.walls, network.members):
            if wall.thickness:
                matrix = wall.conduction()
                matrix[0, 0] += loss[members].mean()
                day = expm(-matrix / wall.mass()[:, None] * DAY)
                rest = np.linalg.solve(np.eye(CELLS + 1) - day, day)
                result[..., members] = rest @ change[..., members]
        return result

    def step(self, k: int, scheme: float) -> None:
        """Take the step to a time, of the temperatures and then of their changes."""
        network, balance, step = self.network, self.network.balance, self.steps[scheme]
        earlier, last = self.states
        history = last if scheme == EULER else 2 * last - 0.5 * earlier
        source = step.mass * history
        source[0] += step.back
        into, free = network.facets.area * step.conductance, network.is_free
        outward = self.conductance[k] + into[free]

        r = np.sum(step.first * source[0], axis=0)
        power = self.power[k] + (into * r)[free]
        kelvin, residual = balance.solve(power, outward, self.kelvin[k][free], DAILY)
        self.residual = max(self.residual, residual)
        self.kelvin[k] = network.whole(kelvin)
        source[0, 0] += step.conductance * (self.kelvin[k] - r)
        nodes = step.times(step.inverses, source[0])

        for c, of_scheme in self.varied.items():
            source[1 + c] += of_scheme[scheme].varied(history[0], nodes)
        r = np.sum(step.first * source[1:], axis=1)
        rates = network.rates(self.columns, kelvin, k) + (into * r)[:, free]
        self.changes[:, k] = network.spread(
            balance.linear(kelvin, outward, rates.T, ROUGH).T, self.columns
        )
        source[1:, 0] += step.conductance * (self.changes[:, k] - r)
        tangents = step.times(step.inverses, source[1:])
        self.states = np.stack([last, np.concatenate([nodes[None], tangents])])

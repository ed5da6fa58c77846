"""Temperatures over the times of a weather, and their derivatives with respect to inputs.

Time steps are those of BDF2. The nodes U of a wall are followed by the amplitudes V of its modes,
U = Phi V, see `wall`. With those that earlier steps give, H, and the flux q into the surface,

    (3/2 / dt + rates) V = H / dt + Phi^T b + Phi_0 q,

so that the surface has the temperature Phi_0 V = r + q / g with known r and g. What remains is one
equation for each facet, see `balance`. A steady state is a step without an end. A change of V that
is due to an input of the wall follows the same equation, with Phi^T (db - dK U - dM dU/dt) in it.
"""

from collections.abc import Sequence

import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.heating.temperatures.balance import CLOSED, SOLVED
from mi_lcair.heating.temperatures.network import STEP, Column, Network
from mi_lcair.heating.temperatures.wall import CELLS, DAY
from mi_lcair.physics.blackbody import STEFAN_BOLTZMANN

PERIODIC = 2e-3  # largest distance of a temperature from its periodic value [K]
MOST_DAYS = 60
DAILY = 1e-9  # residual of the balance of a step, as a fraction of the power
ROUGH = 1e-5  # residual of the changes by the columns, as a fraction of the power
BDF2, EULER = 1.5, 1.0  # coefficients of the new temperatures in a step
PARTS = 16  # implicit Euler steps in place of a first step of BDF2


def course(
    network: Network, columns: Sequence[Column] = (), start_K: float | None = None
) -> "Course":
    """The temperatures at the times of a weather; a steady state if it has one time.

    Parameters
    ----------
    network : Network
    columns : sequence of Column
        What the temperatures are differentiated by.
    start_K : float or None
        Temperature of all surfaces one step before the first time. None: the times are those of a
        day, which is repeated until it is periodic.

    Raises
    ------
    InputError
        If the days do not become periodic, or a balance does not converge.
    """
    result = Course(network, columns, start_K)
    if len(result.kelvin) == 1:
        result.step(0, EULER, result.seconds)
    elif start_K is not None:
        result.series()
    else:
        while not result.days or result.drift >= PERIODIC:
            if result.days == MOST_DAYS:
                raise InputError(
                    f"the temperatures still change by {result.drift:.2g} K after {MOST_DAYS} days"
                )
            result.repeat()
    return result


class Course:
    """Temperatures of the facets over the times of a weather.

    Attributes
    ----------
    kelvin : (m, n)
    changes : (columns + R, m, n)
        Their changes by the columns, and then by each randomisation of the paths [K].
    residual : float
        Largest power that is left over [W].
    days : int
        Number of days that were calculated.
    drift : float
        Largest distance of a temperature from its periodic value, as the last day shows it [K].
    states : (2, 1 + columns + R, modes, n)
        Amplitudes of the modes of all walls, and then their changes, at the last two times.
    rates, surface, back : (modes, n)
        Rates of the modes [1/s], Phi_0, and Phi^T b.
    """

    def __init__(self, network: Network, columns: Sequence[Column], start_K: float | None):
        self.network, self.columns = network, columns
        times = network.weather.seconds
        m, n = len(times), len(network.facets.area)
        self.seconds = float(times[1] - times[0]) if m > 1 else np.inf
        self.power, self.conductance = network.loads()
        self.changes = np.zeros((len(columns) + len(network.traced.replicates), m, n))
        self.residual, self.days, self.drift = 0.0, 0, 0.0
        self.rates, (self.surface, self.back) = np.ones((CELLS + 1, n)), np.zeros((2, CELLS + 1, n))
        self.varied = []  # effect of each column on the walls of a group
        for group, wall, members in network.with_walls:
            rates, shapes = wall.modes
            self.rates[:, members] = rates[:, None]
            self.surface[:, members] = shapes[0][:, None]
            self.back[:, members] = (shapes.T @ wall.conduction[1])[:, None]
            for c, column in enumerate(columns):
                if column.walls:
                    changed = column.walls[group]
                    parts = *changed.conduction, np.diag(changed.mass)
                    K, b, M = (part.imag / STEP for part in parts)
                    b, K, M = shapes.T @ b[:, None], shapes.T @ K @ shapes, shapes.T @ M @ shapes
                    self.varied.append((c, members, b, K, M))
        g, r = self.of_walls(1 / self.rates, self.back)
        kelvin = np.full(n, network.weather.air_K[0] if start_K is None else start_K)
        if start_K is None:
            into = network.facets.area * g
            power, conductance = (load.mean(axis=0) for load in (self.power, self.conductance))
            kelvin, _ = network.balance.solve(power + into * r, conductance + into, kelvin)
        self.states = np.zeros((2, 1 + len(self.changes), CELLS + 1, n))
        self.states[:, 0] = (self.back + self.surface * g * (kelvin - r)) / self.rates
        self.kelvin = np.tile(kelvin, (m, 1))

    @property
    def scatter(self) -> np.ndarray:
        """The changes by the randomisations of the paths, (R, m, n) [K]."""
        return self.changes[len(self.columns) :]

    def of_walls(self, lag: np.ndarray, source: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """g [W m^-2 K^-1], (n,), and r [K], (..., n), of walls with V = lag (source + Phi_0 q)."""
        response = np.sum(self.surface**2 * lag, axis=0)
        g = np.divide(1, response, out=np.zeros_like(response), where=response > 0)
        return g, np.sum(self.surface * lag * source, axis=-2)

    def series(self) -> None:
        """Take the steps to all times. The first, of which no earlier one is known, has parts."""
        before = self.states[1]
        for _ in range(PARTS):
            self.step(0, EULER, self.seconds / PARTS)
        self.states[0] = before
        for k in range(1, len(self.kelvin)):
            self.step(k, BDF2, self.seconds)
        self.days = 1

    def repeat(self) -> None:
        """Take the steps of a day, go on to its periodic state, and say how far away that was.

        Each mode decays, so that no later temperature of a surface differs by more than the drift.
        """
        begin = self.states[1]
        for k in range(len(self.kelvin)):
            self.step(k, BDF2, self.seconds)
        change = self.states[1] - begin
        left = self.left(change)
        self.states = self.states + left
        self.drift = float(np.sum(abs(self.surface * (change + left)), axis=-2).max())
        self.days += 1

    def left(self, change: np.ndarray) -> np.ndarray:
        """How far amplitudes still are from periodic ones, from their change over a day.

        A wall below a surface that loses heat in proportion to its temperature changes by
        V = F V from day to day, so that (1 - F)^-1 F of a change is left to do.
        """
        network, result = self.network, np.zeros_like(change)
        slope = 4 * STEFAN_BOLTZMANN * self.kelvin.mean(axis=0) ** 3 * network.balance.diagonal
        loss = (self.conductance.mean(axis=0) + slope) / network.facets.area
        for _, wall, members in network.with_walls:
            rates, shapes = wall.modes
            matrix = np.diag(rates) + loss[members].mean() * np.outer(shapes[0], shapes[0])
            rates, modes = np.linalg.eigh(matrix)
            rest = modes * (np.exp(-rates * DAY) / -np.expm1(-rates * DAY)) @ modes.T
            result[..., members] = rest @ change[..., members]
        return result

    def step(self, k: int, scheme: float, seconds: float) -> None:
        """Take the step to a time, of the temperatures and then of their changes."""
        network, balance, area = self.network, self.network.balance, self.network.facets.area
        closed, solved = (DAILY, ROUGH) if np.isfinite(seconds) else (CLOSED, SOLVED)
        earlier, last = self.states
        history = last if scheme == EULER else 2 * last - 0.5 * earlier
        source, lag = history / seconds, 1 / (scheme / seconds + self.rates)
        source[0] += self.back
        g, r = self.of_walls(lag, source[0])

        power, conductance = self.power[k] + area * g * r, self.conductance[k] + area * g
        kelvin, residual = balance.solve(power, conductance, self.kelvin[k], closed)
        self.residual, self.kelvin[k] = max(self.residual, residual), kelvin
        source[0] += self.surface * g * (kelvin - r)

        amplitudes = lag * source[0]
        for c, members, b, K, M in self.varied:
            V = amplitudes[:, members]
            slope = (scheme * V - history[0][:, members]) / seconds
            source[1 + c][:, members] += b - K @ V - M @ slope
        _, r = self.of_walls(lag, source[1:])
        power = network.rates(self.columns, kelvin, k) + area * g * r
        self.changes[:, k] = balance.linear(kelvin, conductance, power.T, solved).T
        source[1:] += self.surface * (g * (self.changes[:, k] - r))[:, None]
        self.states = np.stack([last, lag * source])

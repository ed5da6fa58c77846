"""Temperatures of a periodic day by the Fourier components of walls, exchange and weather.

Each component of a wall's flux is its admittance times that of the surface's temperature. The
admittances are those of BDF2 with the steps of the day, so that the result is what the steps
approach from day to day. T^4 and coefficients that change over the day make the components depend
on each other: the residual over time is taken as a power, to which the mean linear balance answers
component by component, until nothing is left.
"""

from collections.abc import Callable, Sequence

import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.heating.temperatures.network import Column, Network
from mi_lcair.physics.blackbody import STEFAN_BOLTZMANN

MOST_ROUNDS, LEFT_K = 200, 1e-4  # rounds, and the change of a temperature at which they end [K]
SOLVED = 1e-3  # residual of each linear system, relative


class Harmonics:
    """The components of a network over its m times.

    rates, surface, back: (modes, n), of the walls, as those of `Course`. symbol: (K,), of the time
    derivative [1/s]. admittance: (K, n) [W m^-2 K^-1]. residual: largest power left over [W].
    """

    def __init__(self, network: Network, rates, surface, back):
        self.network, self.surface, self.back = network, surface, back
        times = network.weather.seconds
        self.count = len(times)
        z = np.exp(-2j * np.pi * np.arange(self.count // 2 + 1) / self.count)
        self.symbol = (1.5 - 2 * z + 0.5 * z**2) / (times[1] - times[0])
        self.lag = 1 / (self.symbol[:, None, None] + rates)
        response = np.sum(surface**2 * self.lag, axis=1)
        self.admittance = np.divide(1, response, out=np.zeros_like(response), where=response != 0)
        self.rest = np.real(self.admittance[0] * np.sum(surface * self.lag[0] * back, axis=0))
        self.power, self.conductance = network.loads()
        self.residual = 0.0

    def flux(self, values: np.ndarray) -> np.ndarray:
        """Fluxes into the walls below temperatures (..., m, n), without the part of the backs."""
        return np.fft.irfft(self.admittance * np.fft.rfft(values, axis=-2), self.count, axis=-2)

    def answered(self, residual: Callable, values: np.ndarray, cubes: np.ndarray) -> np.ndarray:
        """The values (c, m, n) for which the residual [W] vanishes, from others.

        cubes: mean of T^3, (n,), for the slope of the mean balance.
        """
        network, (c, m, n) = self.network, values.shape
        mean = self.conductance.mean(axis=0) + network.facets.area * self.admittance
        conductance = np.tile(mean, (c, 1)).T
        level = np.cbrt(cubes)
        for _ in range(MOST_ROUNDS):
            power = np.fft.rfft(residual(values), axis=1).reshape(-1, n).T
            parts = network.balance.linear(level, conductance, power, SOLVED)
            change = np.fft.irfft(parts.T.reshape(c, -1, n), m, axis=1)
            values = values + change
            if abs(change).max() < LEFT_K * max(1.0, abs(values).max() / 1000):
                return values
        raise InputError('the components do not converge; take method = "steps" of [run]')

    def temperatures(self, start: np.ndarray) -> np.ndarray:
        """Temperatures over the day, (m, n), from those of a mean day, (n,)."""
        area, L = self.network.facets.area, self.network.balance.laplacian

        def residual(values):
            (kelvin,) = values
            emitted = STEFAN_BOLTZMANN * (L @ kelvin.T**4).T
            into = area * (self.flux(kelvin) - self.rest)
            return (self.power - self.conductance * kelvin - emitted - into)[None]

        values = self.answered(residual, np.tile(start, (1, self.count, 1)), start**3)
        self.residual = float(abs(residual(values)).max())
        return values[0]

    def changes(self, kelvin: np.ndarray, columns: Sequence[Column], varied) -> np.ndarray:
        """Changes by the columns and by each randomisation, (c + R, m, n); see `Course`."""
        network, area = self.network, self.network.facets.area
        power = np.array([network.rates(columns, T, k) for k, T in enumerate(kelvin)])
        power = np.swapaxes(power, 0, 1)
        flux = self.admittance * np.fft.rfft(kelvin, axis=0)
        flux[0] -= self.count * self.rest
        for c, members, b, K, M in varied:
            surface, lag = self.surface[:, members], self.lag[:, :, members]
            source = surface * flux[:, None, members]
            source[0] += self.count * self.back[:, members]
            V = lag * source
            term = -(K @ V) - M @ (self.symbol[:, None, None] * V)
            term[0] += self.count * b
            r = self.admittance[:, members] * np.sum(surface * lag * term, axis=1)
            power[c][:, members] += area[members] * np.fft.irfft(r, self.count, axis=0)
        slope, L = 4 * STEFAN_BOLTZMANN * kelvin**3, network.balance.laplacian
        n = len(area)

        def residual(values):
            emitted = (L @ (slope * values).reshape(-1, n).T).T.reshape(values.shape)
            return power - self.conductance * values - emitted - area * self.flux(values)

        return self.answered(residual, np.zeros_like(power), (kelvin**3).mean(axis=0))

"""Conduction through a plane wall of one material, as one spectral element over its depth.

The temperature over the depth is a polynomial of degree `CELLS`, given by its values at the
Gauss-Lobatto nodes. Node 0 lies on the surface that faces the scene. Below the depth of a day's
waves the nodes are apart as the points of an exponential, for waves of longer series. With the mass
matrix M, the stiffness K, and the flux q into the surface and q_b into the back [W m^-2],

    M dU/dt + K U = q e_0 + q_b e_n.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.polynomial import legendre
from scipy.optimize import brentq
from scipy.special import roots_jacobi

CELLS = 10  # intervals between the nodes of a wall
DAY = 86400.0  # [s]
# Depth in penetration depths of the day, or of a longer series. A wave that has gone there and back
# is smaller by exp(-12). Whatever lies deeper conducts the mean flux only.
DEEPEST = 6.0


def gauss_lobatto(degree: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Nodes in -1..1, weights, and the matrix of the derivative at the nodes."""
    last = np.eye(degree + 1)[degree]
    # The zeros of the derivative of a Legendre polynomial are those of a Jacobi polynomial
    x = np.concatenate([[-1.0], roots_jacobi(degree - 1, 1, 1)[0], [1.0]])
    value = legendre.legval(x, last)
    apart = x[:, None] - x + np.eye(degree + 1)
    derivative = value[:, None] / (value * apart)
    np.fill_diagonal(derivative, 0)
    np.fill_diagonal(derivative, -derivative.sum(axis=1))
    return x, 2 / (degree * (degree + 1) * value**2), derivative


NODES, WEIGHTS, DERIVATIVE = gauss_lobatto(CELLS)
INTERVAL = (NODES + 1) / 2  # the nodes in 0..1


@dataclass(frozen=True)
class Wall:
    """A wall, or nothing behind the surface if its thickness is 0.

    thickness [m], conductivity [W m^-1 K^-1], density [kg m^-3], heat_capacity [J kg^-1 K^-1].
    back: coefficient of heat transfer at the back [W m^-2 K^-1]; 0 for an insulated back, infinite
    for a back at a temperature. back_temperature: of the back or of the air behind it [K]. The
    numbers may be complex, for derivatives by complex steps. duration: of the weather [s].
    """

    thickness: complex = 0.0
    conductivity: complex = 1.0
    density: complex = 0.0
    heat_capacity: complex = 0.0
    back: complex = 0.0
    back_temperature: complex = 0.0
    duration: float = DAY

    @property
    def diffusion(self) -> float:
        """Time in which heat diffuses through the wall [s]."""
        return self.thickness**2 * self.density * self.heat_capacity / self.conductivity

    def penetration(self, seconds: float) -> complex:
        """Penetration depth of waves of a period [m]; infinite for a wall that stores no heat."""
        stored = self.density * self.heat_capacity
        return np.sqrt(self.conductivity * seconds / (np.pi * stored)) if stored else np.inf

    @property
    def depth(self) -> complex:
        """Depth down to which heat is stored [m]."""
        deepest = DEEPEST * self.penetration(max(self.duration, DAY))
        return deepest if np.real(self.thickness) > np.real(deepest) else self.thickness

    @cached_property
    def grid(self) -> tuple[np.ndarray, np.ndarray]:
        """Depths of the nodes [m], and their derivative with respect to `INTERVAL`, (nodes,)."""
        longer = np.real(self.depth / (DEEPEST * self.penetration(DAY)))
        if longer <= 1.001:
            return self.depth * INTERVAL, self.depth * np.ones(CELLS + 1)
        # The nodes at the surface are as close as those of a day
        growth = brentq(lambda g: np.expm1(g) / g - longer, 1e-4, 40.0)
        scale = self.depth / np.expm1(growth)
        return scale * np.expm1(growth * INTERVAL), scale * growth * np.exp(growth * INTERVAL)

    @property
    def outward(self) -> complex:
        """Conductance from the deepest node to the back [W m^-2 K^-1]."""
        if self.back == 0:
            return 0.0
        resistance = (self.thickness - self.depth) / self.conductivity
        resistance += 0.0 if np.isinf(np.real(self.back)) else 1 / self.back
        # The difference from a back at a temperature is 1e-6 of the drop over the wall
        return 1 / resistance if resistance else 1e6 * self.conductivity / self.depth

    def steady(self) -> tuple[complex, complex]:
        """Conductance g of the whole wall and temperature r: the flux into it is g (T - r)."""
        if not self.thickness or self.back == 0:
            return 0.0, self.back_temperature
        resistance = self.thickness / self.conductivity
        resistance += 0.0 if np.isinf(np.real(self.back)) else 1 / self.back
        return 1 / resistance, self.back_temperature

    def mass(self) -> np.ndarray:
        """Diagonal of M [J m^-2 K^-1], (nodes,)."""
        return WEIGHTS / 2 * self.density * self.heat_capacity * self.grid[1]

    def conduction(self) -> np.ndarray:
        """K with the conductance of the back on its diagonal [W m^-2 K^-1], (nodes, nodes)."""
        if not self.thickness:
            return np.zeros((CELLS + 1, CELLS + 1))
        along = 2 * self.conductivity * WEIGHTS / self.grid[1]
        matrix = DERIVATIVE.T @ (along[:, None] * DERIVATIVE)
        # An even temperature conducts no heat, whatever the rounding
        matrix -= np.diag(matrix.sum(axis=1))
        return matrix + np.diag([0.0] * CELLS + [1.0]) * self.outward

    def profile(self, surface: np.ndarray) -> np.ndarray:
        """Steady temperatures of the nodes below surface temperatures (n,) [K], (nodes, n)."""
        conductance, _ = self.steady()
        gradient = conductance * (surface - self.back_temperature) / self.conductivity
        return surface - np.multiply.outer(self.grid[0], gradient)

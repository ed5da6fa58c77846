"""Temperatures of surfaces that exchange heat by radiation and linearly with something else.

With the conductors G [m^2] and the Laplacian L = diag(G 1 + G_out) - G, where G_out leads to the
surroundings, the temperatures T solve

    sigma L T^4 + C T = P,

where C [W/K] are linear conductances and P [W] is all power that does not depend on T. L is
symmetric, its off-diagonal elements are not positive and its rows do not sum to less than 0.
Newton's iteration from above therefore converges for any noise of the conductors.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.polynomial import Legendre
from scipy import sparse
from scipy.special import lambertw, roots_jacobi

from mi_lcair.errors import InputError
from mi_lcair.physics.blackbody import STEFAN_BOLTZMANN

ROUNDING = 1e-7  # largest residual by rounding, in the same unit
UNSTEADY = 8  # Newton steps after which they are shortened
MOST_STEPS = 60  # Newton steps; each at least halves the distance to a fourth root
CLOSED = 1e-12  # residual, as a fraction of the power that surfaces exchange
TINY = np.finfo(float).tiny  # beside what may be 0
Leaving = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]


@dataclass(frozen=True, eq=False)
class Balance:
    """Radiative exchange of the facets whose temperatures are sought.

    laplacian: L [m^2], (n, n). STEFAN_BOLTZMANN L T^4 is the power that leaves them.
    """

    laplacian: sparse.csr_array

    @cached_property
    def diagonal(self) -> np.ndarray:
        """Diagonal of L [m^2], (n,)."""
        return self.laplacian.diagonal()

    def solve(
        self, power, conductance, start, closed: float = CLOSED, leaving: Leaving | None = None
    ) -> tuple[np.ndarray, float]:
        """Temperatures [K], (n,), from some start, and the largest residual [W].

        closed: residual at which the iteration ends, as a fraction of the power of a facet.
        leaving: further power that leaves surfaces of some temperatures [W], and its derivative.

        Raises InputError if the iteration does not converge.
        """
        kelvin, before = np.array(start, float), np.inf
        for attempt in range(MOST_STEPS):
            emitted = STEFAN_BOLTZMANN * (self.laplacian @ kelvin**4)
            out, slope = leaving(kelvin) if leaving else (0.0, 0.0)
            residual = power - conductance * kelvin - emitted - out
            # With the power at 1 K, so that a surface without any source cools to 0 K
            scale = STEFAN_BOLTZMANN * self.diagonal * (1 + kelvin**4) + conductance * kelvin
            scale += abs(power) + abs(out)
            worst = float(abs(residual).max(initial=0))
            left = float(np.max(abs(residual) / scale, initial=0))
            # Thin layers that conduct well have a rounding that no step takes away
            if left <= closed or (leaving and before / 2 < left < ROUNDING):
                return kelvin, worst
            before = left
            through = conductance + np.maximum(slope, 0)
            step = self.linear(kelvin, through, residual[:, None], np.sqrt(closed))[:, 0]
            # Where convection sets in, steps may go to and fro
            step = step / (1 + attempt // UNSTEADY if leaving else 1)
            kelvin = np.maximum(kelvin + step, kelvin / 2)
        why = (
            "internal_W_m2 removes more heat from a surface than it gets at 0 K"
            if residual.min() + residual.max() < 0
            else "a surface must be able to lose the heat that it absorbs"
        )
        raise InputError(
            f"the heat balance does not converge: {worst:.3g} W are left over after {MOST_STEPS} "
            f"steps; {why}"
        )

    def linear(self, kelvin, conductance, power, solved: float = CLOSED) -> np.ndarray:
        """Changes of temperature [K], (n, m), that balance small changes of power [W], (n, m).

        Solves (sigma L diag(4 T^3) + diag(C)) x = power by conjugate gradients for diag(4 T^3) x,
        whose matrix is symmetric and positive, for all columns at once. One
        after the other with scipy's cg they take seven times as long.
        """
        slope = 4 * STEFAN_BOLTZMANN * kelvin**3
        shift = np.atleast_2d(conductance.T / slope).T
        inverse = np.reciprocal(self.diagonal[:, None] + shift)
        solution, residual = np.zeros_like(power), power.copy()
        direction = inverse * residual
        before = np.sum(residual * direction, axis=0)
        limit = solved**2 * abs(before)
        for _ in range(10 * len(kelvin)):
            if (abs(before) <= limit).all():
                break
            image = self.laplacian @ direction + shift * direction
            length = before / (np.sum(direction * image, axis=0) + TINY)
            solution += length * direction
            residual -= length * image
            preconditioned = inverse * residual
            after = np.sum(residual * preconditioned, axis=0)
            direction = preconditioned + after / (before + TINY) * direction
            before = after
        return solution / slope[:, None]


# Conduction through a plane wall of one material, as one spectral element over its depth
# ---------------------------------------------------------------------------------------
# The temperature over the depth is a polynomial of degree `CELLS`, given by its values at the
# Gauss-Lobatto nodes. Node 0 lies on the surface that faces the scene. Below the depth of a day's
# waves the nodes are apart as the points of an exponential, for waves of longer series. With the
# mass matrix M, the stiffness K, and the flux q into the surface [W m^-2],
#
#     M dU/dt + K U = b + q e_0,
#
# where K and b have what goes through the back. In the modes U = Phi V with Phi^T M Phi = 1 and
# Phi^T K Phi = diag(rates), each amplitude follows alone.

CELLS = 10  # intervals between the nodes of a wall
DAY = 86400.0  # [s]
# Depth in penetration depths of the day, or of a longer series. A wave that has gone there and back
# is smaller by exp(-12). Whatever lies deeper conducts the mean flux only.
DEEPEST = 6.0


def gauss_lobatto(degree: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Nodes in -1..1, weights, and the matrix of the derivative at the nodes."""
    # The zeros of the derivative of a Legendre polynomial are those of a Jacobi polynomial
    x = np.concatenate([[-1.0], roots_jacobi(degree - 1, 1, 1)[0], [1.0]])
    value, apart = Legendre.basis(degree)(x), x[:, None] - x
    np.fill_diagonal(apart, np.inf)
    derivative = value[:, None] / (value * apart)
    np.fill_diagonal(derivative, -derivative.sum(axis=1))
    return x, 2 / (degree * (degree + 1) * value**2), derivative


NODES, WEIGHTS, DERIVATIVE = gauss_lobatto(CELLS)
INTERVAL = (NODES + 1) / 2  # the nodes in 0..1
LAST = np.arange(CELLS + 1) == CELLS  # whether a node is the deepest
SLOWEST = 1e-30  # rate in place of 0 [1/s]


@dataclass(frozen=True)
class HeatWall:
    """A wall of one material.

    thickness [m], conductivity [W m^-1 K^-1], density [kg m^-3], heat_capacity [J kg^-1 K^-1].
    back: coefficient of heat transfer at the back [W m^-2 K^-1]; 0 for an insulated back, infinite
    for a back at a temperature. back_temperature: of the back or of the air behind it [K]. The
    numbers may be complex, for derivatives by complex steps. duration: of the weather [s].
    """

    thickness: complex
    conductivity: complex
    density: complex
    heat_capacity: complex
    back: complex = 0.0
    back_temperature: complex = 0.0
    duration: float = DAY

    @property
    def diffusion(self) -> float:
        """Time in which heat diffuses through the wall [s]."""
        return self.thickness**2 * self.density * self.heat_capacity / self.conductivity

    def penetration(self, seconds: float) -> complex:
        """Penetration depth of waves of a period [m]."""
        stored = self.density * self.heat_capacity
        return np.sqrt(self.conductivity * seconds / (np.pi * stored))

    @property
    def depth(self) -> complex:
        """Depth down to which heat is stored [m]."""
        deepest = DEEPEST * self.penetration(max(self.duration, DAY))
        return deepest if np.real(self.thickness) > np.real(deepest) else self.thickness

    @cached_property
    def stretch(self) -> np.ndarray:
        """Derivative of the depths of the nodes with respect to `INTERVAL` [m], (nodes,)."""
        longer = np.real(self.depth / (DEEPEST * self.penetration(DAY)))
        if longer <= 1.001:
            return np.full(CELLS + 1, self.depth)
        # expm1(growth) / growth = longer: those at the surface are as close as those of a day
        growth = -1 / longer - np.real(lambertw(-np.exp(-1 / longer) / longer, -1))
        return self.depth * growth / np.expm1(growth) * np.exp(growth * INTERVAL)

    @property
    def along(self) -> np.ndarray:
        """Weights of the squared gradients in K [W m^-2 K^-1], (nodes,)."""
        return 2 * self.conductivity * WEIGHTS / self.stretch

    @property
    def outward(self) -> complex:
        """Conductance from the deepest node to the back [W m^-2 K^-1]; infinite at the back."""
        if self.back == 0:
            return 0.0
        resistance = (self.thickness - self.depth) / self.conductivity
        resistance += 0.0 if np.isinf(self.back) else 1 / self.back
        return 1 / resistance if resistance else np.inf

    @property
    def mass(self) -> np.ndarray:
        """Diagonal of M [J m^-2 K^-1], (nodes,); infinite for a node that keeps its temperature."""
        mass = WEIGHTS / 2 * self.density * self.heat_capacity * self.stretch
        return np.where(LAST & np.isinf(self.outward), np.inf, mass)

    @property
    def conduction(self) -> tuple[np.ndarray, np.ndarray]:
        """K [W m^-2 K^-1] and b [W m^-2], (nodes, nodes) and (nodes,)."""
        matrix = DERIVATIVE.T @ (self.along[:, None] * DERIVATIVE)
        if np.isinf(self.outward):
            return matrix, -matrix[:, -1] * self.back_temperature
        outward = LAST * self.outward
        return matrix + np.diag(outward), outward * self.back_temperature

    @cached_property
    def modes(self) -> tuple[np.ndarray, np.ndarray]:
        """The rates [1/s] and Phi, (modes,) and (nodes, modes)."""
        root = 1 / np.sqrt(self.mass)
        outward = 0.0 if np.isinf(self.outward) else self.outward
        # Singular values have the small rates that the eigenvalues of K lose to rounding
        halves = np.vstack([np.sqrt(self.along)[:, None] * DERIVATIVE, np.sqrt(outward) * LAST])
        _, values, shapes = np.linalg.svd(halves * root, full_matrices=False)
        return np.maximum(values**2, SLOWEST), root[:, None] * shapes.T

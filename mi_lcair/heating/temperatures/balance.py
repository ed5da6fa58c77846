"""Temperatures of surfaces that exchange heat by radiation and linearly with something else.

With the conductors G [m^2] and the Laplacian L = diag(G 1 + G_out) - G, where G_out leads to the
surroundings, the temperatures T solve

    sigma L T^4 + C T = P,

where C [W/K] are linear conductances and P [W] is all power that does not depend on T. L is
symmetric, its off-diagonal elements are not positive and its rows do not sum to less than 0.
Newton's iteration from above therefore converges for any noise of the conductors.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse

from mi_lcair.errors import InputError
from mi_lcair.physics.blackbody import STEFAN_BOLTZMANN

MOST_STEPS = 60  # Newton steps; each at least halves the distance to a fourth root
CLOSED = 1e-12  # residual of the balance, as a fraction of the power that surfaces exchange
SOLVED = 1e-13  # residual of a linear system, as a fraction of its right-hand side


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

    def solve(self, power, conductance, start, closed: float = CLOSED) -> tuple[np.ndarray, float]:
        """Temperatures [K], (n,), from some start, and the largest residual [W].

        closed: residual at which the iteration ends, as a fraction of the power of a facet.

        Raises InputError if the iteration does not converge.
        """
        kelvin = np.array(start, float)
        for _ in range(MOST_STEPS):
            emitted = STEFAN_BOLTZMANN * (self.laplacian @ kelvin**4)
            residual = power - conductance * kelvin - emitted
            # With the power at 1 K, so that a surface without any source cools to 0 K
            scale = STEFAN_BOLTZMANN * self.diagonal * (1 + kelvin**4) + conductance * kelvin
            scale += abs(power)
            worst = float(abs(residual).max(initial=0))
            if (abs(residual) <= closed * scale).all():
                return kelvin, worst
            step = self.linear(kelvin, conductance, residual[:, None], closed**0.5)[:, 0]
            kelvin = np.maximum(kelvin + step, kelvin / 2)
            if (abs(step) < 1e-13 * kelvin).all():
                return kelvin, worst
        why = (
            "internal_W_m2 takes more heat from a surface than it gets at 0 K"
            if kelvin.min() < 1
            else "a surface needs a path for the heat that it takes up"
        )
        raise InputError(
            f"the heat balance does not converge: {worst:.3g} W are left over after {MOST_STEPS} "
            f"steps; {why}"
        )

    def linear(self, kelvin, conductance, power, solved: float = SOLVED) -> np.ndarray:
        """Changes of temperature [K], (n, m), that balance small changes of power [W], (n, m).

        Solves (sigma L diag(4 T^3) + diag(C)) x = power by conjugate gradients for diag(4 T^3) x,
        whose matrix is symmetric and positive, for all columns at once. One
        after the other with scipy's cg they take seven times as long.
        """
        slope = 4 * STEFAN_BOLTZMANN * kelvin**3
        shift = (conductance / slope)[:, None]
        inverse = 1 / (self.diagonal[:, None] + shift)
        solution, residual = np.zeros_like(power), power.copy()
        limit = solved**2 * np.sum(power**2 * inverse, axis=0)
        direction = inverse * residual
        before = np.sum(residual * direction, axis=0)
        for _ in range(10 * len(kelvin) + 10):
            if (before <= limit).all():
                break
            image = self.laplacian @ direction + shift * direction
            length = before / np.maximum(np.sum(direction * image, axis=0), 1e-300)
            solution += length * direction
            residual -= length * image
            preconditioned = inverse * residual
            after = np.sum(residual * preconditioned, axis=0)
            direction = preconditioned + after / np.maximum(before, 1e-300) * direction
            before = after
        return solution / slope[:, None]

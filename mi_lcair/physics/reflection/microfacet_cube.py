"""The parameters of the microfacet model, mapped to the unit cube on which searches run.

The coordinates of alpha, gamma and n are linear in their logarithms between the bounds. That of
rho_d is rho_d itself. k enters the BRDF as k^2 only. With k as a coordinate, the face k = 0
(dielectrics) would be stationary for all data. The coordinate u of k is therefore defined by
k^2 = K^2 (exp(L u) - 1), where L is chosen such that u = 1 is the upper bound.
"""

from math import log

import drjit as dr
import numpy as np

from mi_lcair.physics.reflection.interface import ReflectionModel, Restriction, bundled_parameters

KNEE2 = 0.01  # K^2: the coordinate of k is linear in k^2 below it and in log k above it
SMALLEST_K2 = 1e-24  # added to k^2, so that the derivative of its root is finite at k = 0
# Relative excess over a bound that is accepted, for parameters that were rounded to Float32.
ROUNDING = 1e-6

PARAMETERS = bundled_parameters("microfacet")
LOWER, UPPER = (
    np.array(bounds, dtype=float) for bounds in zip(*((p.lower, p.upper) for p in PARAMETERS))
)
K2_RANGE = float(np.log1p(UPPER[3] ** 2 / KNEE2))


class MicrofacetCube(ReflectionModel):
    """The microfacet model's parameters and search coordinates."""

    name = "microfacet"
    title = "Microfacet"
    parameters = PARAMETERS

    def check_feasible(self, *values: float, form: str = "standard") -> None:
        for parameter, value in zip(self.parameters, values):
            parameter.check(value, f"{self.name}: {parameter.name}", ROUNDING)

    def from_cube(self, u) -> tuple:
        alpha, gamma, n = (
            p.lower * dr.exp(place * log(p.upper / p.lower)) for p, place in zip(PARAMETERS, u[:3])
        )
        k2 = KNEE2 * (dr.exp(K2_RANGE * u[3]) - 1)
        return alpha, gamma, n, dr.sqrt(k2 + SMALLEST_K2), u[4]

    def to_cube(self, values) -> np.ndarray:
        values = np.clip(np.asarray(values, dtype=float), LOWER, UPPER)
        u = values.copy()
        for number in range(3):
            low, high = LOWER[number], UPPER[number]
            u[..., number] = np.log(values[..., number] / low) / np.log(high / low)
        u[..., 3] = np.log1p(values[..., 3] ** 2 / KNEE2) / K2_RANGE
        return np.clip(u, 0, 1)

    def starting_points(self, count: int, seed: int) -> np.ndarray:
        """Random points (count, 5) of the cube; the same seed gives the same points.

        Real surfaces have lobes of width 0.001..1, exponents 0.7..3 and refractive indices 1.2..12.
        Half of the points are metals with k of 1..50. The floor's reflectance is spread evenly in
        its logarithm over 1e-4..1.
        """
        from scipy.stats import qmc  # takes a second to import, and only searches need it

        u = qmc.LatinHypercube(5, rng=np.random.default_rng(seed)).random(count)

        def decades(low, high, place):
            return low * (high / low) ** place

        k = np.where(u[:, 3] < 0.5, decades(1e-3, 1, 2 * u[:, 3]), decades(1, 50, 2 * u[:, 3] - 1))
        alpha, gamma, n = (
            decades(low, high, place)
            for (low, high), place in zip(((1e-3, 1), (0.7, 3), (1.2, 12)), u.T)
        )
        return self.to_cube(np.column_stack([alpha, gamma, n, k, decades(1e-4, 1, u[:, 4])]))


MicrofacetCube.restrictions = (
    Restriction("rho_d = 0", 4),
    Restriction("gamma = 2", 1, float(np.log(2 / LOWER[1]) / np.log(UPPER[1] / LOWER[1]))),
    Restriction("k = 0", 3),
)

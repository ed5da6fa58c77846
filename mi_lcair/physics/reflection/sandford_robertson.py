"""The Sandford-Robertson model and its search coordinates.

The equations and their hemispherical integrals are in `sandford_robertson_equations`.
"""

import drjit as dr
import numpy as np

from mi_lcair.physics.reflection import sandford_robertson_equations
from mi_lcair.physics.reflection import sandford_robertson_equations as sr
from mi_lcair.physics.reflection.interface import ReflectionModel, Restriction, bundled_parameters
from mi_lcair.physics.reflection.sandford_robertson_equations import FORMS, G

# The Sandford-Robertson model's parameters, mapped to the unit cube on which searches run
# ----------------------------------------------------------------------------------------
# With u = (absorbed share, diffuse share of the rest, b^2, place of log e between its bounds), each
# in 0..1,
#
#     epsilon = G u_0,   rho_d = G (1 - u_0) u_1,   b = sqrt(u_2),   e = E_MIN^(1 - u_3),
#
# so that 0 <= epsilon, 0 <= rho_d and epsilon + rho_d <= G(b) hold for every u, and each bound of
# the feasible set is a face of the cube. b enters the BRDF as b^2 only. With b as a coordinate, the
# point b = 0 would be stationary for all data.

PARAMETERS = bundled_parameters("sandford_robertson")
E_MIN = PARAMETERS[3].lower  # smallest e
SMALLEST_B2 = 1e-24  # lower limit of b^2, so that the derivative of its root is finite at b = 0


class SandfordRobertsonCube(ReflectionModel):
    """The Sandford-Robertson model's parameters and search coordinates."""

    name = "sandford_robertson"
    title = "Sandford-Robertson"
    parameters = PARAMETERS
    forms = FORMS
    reciprocal = False
    restrictions = (Restriction("rho_d = 0", 1), Restriction("b = 0", 2))

    def from_cube(self, u) -> tuple:
        absorbed, diffuse, b2, place = u
        on_face = b2 <= SMALLEST_B2
        b = dr.select(on_face, 0, dr.sqrt(dr.maximum(b2, SMALLEST_B2)))
        bound = G(b)
        e = dr.exp((1 - place) * np.log(E_MIN))
        return bound * absorbed, bound * (1 - absorbed) * diffuse, b, e

    def to_cube(self, values) -> np.ndarray:
        epsilon, rho_d, b, e = np.moveaxis(np.asarray(values, dtype=float), -1, 0)
        bound = bound_of_sum(b)
        rest = np.maximum(bound - epsilon, 1e-300)
        place = 1 - np.log(np.maximum(e, E_MIN)) / np.log(E_MIN)
        return np.clip(np.stack([epsilon / bound, rho_d / rest, b * b, place], axis=-1), 0, 1)

    def feasible_range(self, values) -> tuple[np.ndarray, np.ndarray]:
        bound = float(bound_of_sum(values[2]))
        return np.array([0, 0, 0, E_MIN]), np.array([bound, bound, 1, 1])

    def nearest_feasible(self, values, held: int) -> np.ndarray:
        values = np.clip(values, [0, 0, 0, E_MIN], 1)
        bound = float(bound_of_sum(values[2]))
        if values[:2].sum() > bound:
            if held < 2:
                values[held] = min(values[held], bound)
                values[1 - held] = bound - values[held]
            else:
                values[:2] *= bound / values[:2].sum()
        return values

    def starting_points(self, count: int, seed: int) -> np.ndarray:
        """Random points (count, 4) of the cube; the same seed gives the same points.

        As in real surfaces, the diffuse share and e are spread evenly in their logarithms, over
        1e-4..1 and 1e-3..1.
        """
        from scipy.stats import qmc

        u = qmc.LatinHypercube(4, rng=np.random.default_rng(seed)).random(count)
        return np.column_stack(
            [
                0.02 + 0.96 * u[:, 0],
                10 ** (4 * (u[:, 1] - 1)) * 0.98,
                u[:, 2] ** 2,
                1 + 3 * (u[:, 3] - 1) / 5,
            ]
        )

    def bound_names(self, u) -> list[str | None]:
        """Names of the bounds; at the bound epsilon + rho_d = G(b) there is no lobe."""
        full = "epsilon + rho_d = G(b)" if max(u[0], u[1]) >= 1 else None
        return [
            "0" if u[0] <= 0 else full,
            "0" if u[1] <= 0 else full,
            {0: "0", 1: "1"}.get(u[2]),
            {0: f"{E_MIN:g}", 1: "1"}.get(u[3]),
        ]


def bound_of_sum(b) -> np.ndarray:
    """G(b), the upper bound of epsilon + rho_d, for an array b."""
    b = np.asarray(b, dtype=float)
    return np.array(G(dr.scalar.ArrayXf64(b.ravel()))).reshape(b.shape)


class SandfordRobertsonModel(SandfordRobertsonCube):
    """The Sandford-Robertson reflection model (thesis 2.3.4)."""

    has_emissivity = True

    surface = staticmethod(sr.surface)
    check_feasible = staticmethod(sr.check_feasible)
    f = staticmethod(sr.f)
    HDR = staticmethod(sandford_robertson_equations.HDR)
    DHR = staticmethod(sandford_robertson_equations.DHR)
    emissivity = staticmethod(sr.emissivity)

    def floor_HDR(self, S, cos, sin2):
        return S.floor * S.G * sr.g(cos, sin2, S.b)

    def lobe_HDR(self, S, theta_r):
        return sandford_robertson_equations.HDR_lobe(S, theta_r) / sr.e2_H(dr.cos(theta_r), S.e)

    def lobe_scale(self, S, cos, sin2):
        return sr.observer_factor(S, cos, sin2) * sr.e2_H(cos, S.e)

    def sample_lobe(self, S, r, u1, u2, u3):
        half = sr.sample_half_vector(r, S.e, u1, u2)
        return dr.fma(half, 2 * dr.dot(r, half), -r)

    def lobe_pdf(self, S, i, r):
        return sr.lobe_pdf(i, r, S.e)

    def lobe_width(self, S):
        return S.e


MODEL = SandfordRobertsonModel()

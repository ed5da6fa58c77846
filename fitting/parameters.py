"""The feasible set of (epsilon, rho_d, b, e) as a cube, on which every search runs.

With u = (absorbed share, diffuse share of the rest, b^2, place of log e between its bounds), each
in 0..1,

    epsilon = G u_0,   rho_d = G (1 - u_0) u_1,   b = sqrt(u_2),   e = E_MIN^(1 - u_3),

so that 0 <= epsilon, 0 <= rho_d and epsilon + rho_d <= G(b) hold for every u and each bound of the
set is a face of the cube. b enters the BRDF as b^2 only: in b itself the point b = 0 would be
stationary whatever the data.
"""

import drjit as dr
import numpy as np
from drjit.llvm.ad import Float64
from scipy.stats import qmc

from mi_lcair.physics.reflection import sandford_robertson_equations as sr

NAMES = ("epsilon", "rho_d", "b", "e")
E_MIN = 1e-5  # a lobe 0.001 degrees wide, narrower than any instrument resolves
SMALLEST_B2 = 1e-24  # keeps d sqrt/du finite on the face b = 0


def from_cube(u) -> tuple:
    """(epsilon, rho_d, b, e) as Dr.Jit arrays from the four coordinates, Dr.Jit arrays too;
    differentiable.
    """
    absorbed, diffuse, b2, place = u
    b = dr.sqrt(dr.maximum(b2, SMALLEST_B2))
    G = sr.G(b)
    return G * absorbed, G * (1 - absorbed) * diffuse, b, dr.exp((1 - place) * np.log(E_MIN))


def feasible_range(b: float) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper bounds of the four parameters; epsilon and rho_d share the upper bound G(b)
    of their sum.
    """
    G = sr.G(Float64(b))[0]
    return np.array([0, 0, 0, E_MIN]), np.array([G, G, 1, 1])


def to_cube(parameters) -> np.ndarray:
    """Coordinates (..., 4) of parameters (..., 4) in the order of NAMES."""
    epsilon, rho_d, b, e = np.moveaxis(np.asarray(parameters, dtype=float), -1, 0)
    G = np.array(sr.G(Float64(b.ravel()))).reshape(b.shape)
    rest = np.maximum(G - epsilon, 1e-300)
    u = np.stack(
        [epsilon / G, rho_d / rest, b * b, 1 - np.log(np.maximum(e, E_MIN)) / np.log(E_MIN)],
        axis=-1,
    )
    return np.clip(u, 0, 1)


def parameters_at(u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Parameters (n, 4) at coordinates u (n, 4), and their derivatives (n, 4 parameters, 4
    coordinates).
    """
    # each from a graph of its own: b is an interior node of epsilon's, and loses its tangent there
    values, tangents = with_tangents(
        lambda *u: tuple(from_cube(u)[k] for k in range(4)), np.atleast_2d(u)
    )
    values = np.where((np.arange(4) == 2) & (np.atleast_2d(u)[:, 2:3] <= SMALLEST_B2), 0, values)
    return values, tangents


def with_tangents(
    function, u: np.ndarray, repeat=lambda coordinate: coordinate
) -> tuple[np.ndarray, np.ndarray]:
    """`function` of the four coordinates and its derivatives by each, in forward mode.

    u: (n, 4). repeat: spreads one coordinate (n lanes) over the lanes that function works on.
    function returns one Dr.Jit array of m lanes, or k of them. Returns ((m,) or (m, k)) values and
    ((m, 4) or (m, k, 4)) derivatives.
    """
    lanes = [dr.detach(repeat(Float64(np.ascontiguousarray(column)))) for column in u.T]
    dr.enable_grad(lanes)
    outputs = function(*lanes)
    single = not isinstance(outputs, tuple)
    outputs = (outputs,) if single else outputs
    tangents = []
    for lane in lanes:
        dr.set_grad(lane, 1)
        dr.forward_from(lane, flags=dr.ADFlag.ClearInput | dr.ADFlag.ClearInterior)
        tangents.append([dr.grad(output) for output in outputs])
        dr.clear_grad(outputs)
    outputs = [dr.detach(output) for output in outputs]
    dr.eval(outputs, tangents)
    values = np.stack([output.numpy() for output in outputs], axis=-1)
    slopes = np.stack([np.stack([t.numpy() for t in row], axis=-1) for row in tangents], axis=-1)
    return (values[..., 0], slopes[..., 0, :]) if single else (values, slopes)


def starting_points(count: int, seed: int) -> np.ndarray:
    """(count, 4) points of the cube, spread evenly and the same for the same seed.

    The diffuse share and e are spread in decades (1e-4..1 and 1e-3..1), as real surfaces are.
    """
    u = qmc.LatinHypercube(4, rng=np.random.default_rng(seed)).random(count)
    return np.column_stack(
        [
            0.02 + 0.96 * u[:, 0],
            10 ** (4 * (u[:, 1] - 1)) * 0.98,
            u[:, 2] ** 2,
            1 + 3 * (u[:, 3] - 1) / 5,
        ]
    )

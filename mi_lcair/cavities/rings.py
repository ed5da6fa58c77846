"""Effective emissivity of a cavity with diffuse walls, from the radiosity of its rings."""

import numpy as np

from mi_lcair.cavities.exchange import ring_exchange
from mi_lcair.cavities.shape import Shape
from mi_lcair.cavities.view import View

FIRST = 40  # rings of each straight part of the wall at first; their number is doubled
MOST = 2400  # largest number of rings of the whole wall
ENOUGH = 5e-6  # error from which on the rings are not doubled again
GAUSS = np.polynomial.legendre.leggauss(4)  # places in a ring at which its emission is averaged


def effective_emissivity(shape: Shape, emissivity: float, emission, view: View) -> tuple:
    """Effective emissivity of a diffuse wall, and its numerical error.

    The radiosity of ring i is J_i = epsilon B_i + (1 - epsilon) sum_j F_ij J_j (thesis 3.5.2).

    Parameters
    ----------
    shape : Shape
    emissivity : float
        Emissivity of the wall, at all wavelengths of `emission`.
    emission : callable
        Blackbody radiance at depths [m] as a ratio to that at the reference: (n,) to (n, w).
    view : View

    Returns
    -------
    value, error : ndarray, shape (w,)
        For the wavelengths of `emission`.
    """
    counts = [FIRST, 2 * FIRST]
    values = [of_rings(shape, emissivity, emission, view, count) for count in counts]
    while True:
        counts.append(2 * counts[-1])
        values.append(of_rings(shape, emissivity, emission, view, counts[-1]))
        # The error falls as the square of the rings' width. Where the edge of the view crosses a
        # ring, one difference may be small by chance, but not two.
        error = np.max([abs(b - a) for a, b in zip(values[-3:], values[-2:])], axis=0)
        if error.max() <= ENOUGH or 2 * counts[-1] * shape.parts > MOST:
            return values[-1] + (values[-1] - values[-2]) / 3, error


def of_rings(shape: Shape, emissivity: float, emission, view: View, count: int) -> np.ndarray:
    """Effective emissivity with a number of rings for each straight part of the wall."""
    nodes = shape.nodes(count)
    areas = shape.areas(nodes)
    weight = -np.diff(view.passed(*nodes))
    x, w = GAUSS
    z = nodes[1]
    depths = (z[1:] + z[:-1])[:, None] / 2 + np.diff(z)[:, None] / 2 * x
    B = np.einsum("ikw,k->iw", emission(depths.ravel()).reshape(*depths.shape, -1), w / 2)
    matrix = np.eye(len(areas)) - (1 - emissivity) * ring_exchange(nodes, areas)
    return weight @ np.linalg.solve(matrix, emissivity * B)

"""Exchange between the faces of a grey diffuse cube by radiosity of patches.

View factors of rectangles: J. R. Ehlert and T. F. Smith, J. Thermophys. Heat Transfer 7 (1993) 173.
"""

from itertools import product

import numpy as np


def _parallel(x, y, z):
    r, s = np.hypot(x, z), np.hypot(y, z)
    return y * r * np.arctan(y / r) + x * s * np.arctan(x / s) - z**2 / 2 * np.log(r**2 + y**2)


def _perpendicular(x, xi, y):
    r2 = np.maximum(x**2 + xi**2, 1e-300)
    r = np.sqrt(r2)
    return y * r * np.arctan(y / r) - (r2 - y**2) / 4 * np.log(np.maximum(r2 + y**2, 1e-300))


def exchange_of_cube(emissivity: np.ndarray, cells: int) -> np.ndarray:
    """GR between the six faces of a cube of edge 1 m, (6, 6) [m^2].

    Face 2 k lies at 0 and face 2 k + 1 at 1 of axis k. cells: patches along an edge.
    """
    # Patches are small at the edges, where the radiosity bends
    ticks = (1 - np.cos(np.linspace(0, np.pi, cells + 1))) / 2
    ends = np.moveaxis([list(product(t, repeat=2)) for t in (ticks[:-1], ticks[1:])], 0, 1)
    n, area = len(ends), np.prod(ends[:, 1] - ends[:, 0], axis=1)  # ends: (n, end, coordinate)
    signs = [(ends_of, (-1) ** sum(ends_of)) for ends_of in product((0, 1), repeat=4)]
    F = np.zeros((6, n, 6, n))
    for a, b in product(range(6), repeat=2):
        if a // 2 == b // 2:
            if a == b:
                continue
            for (i, j, k, m), sign in signs:
                x = ends[:, None, i, 0] - ends[:, k, 0]
                y = ends[:, None, j, 1] - ends[:, m, 1]
                F[a, :, b] += sign * _parallel(x, y, 1.0)
            continue
        # Coordinates of a patch: along the common edge, and across, away from it
        axes_a, axes_b = ([k for k in range(3) if k != face // 2] for face in (a, b))
        (along,) = set(axes_a) & set(axes_b)
        for (i, j, k, m), sign in signs:
            across = (
                np.abs(ends[:, end, axes.index(other // 2)] - other % 2)
                for end, axes, other in ((i, axes_a, b), (k, axes_b, a))
            )
            x, xi = across
            flip = (-1) ** (a % 2 + b % 2)  # the distance falls where the coordinate rises
            y = ends[:, None, j, axes_a.index(along)] - ends[:, m, axes_b.index(along)]
            F[a, :, b] += flip * sign * _perpendicular(x[:, None], xi, y)
    eps, area = np.repeat(emissivity, n), np.tile(area, 6)
    F = F.reshape(6 * n, 6 * n) / (2 * np.pi * area[:, None])
    G = (eps * area)[:, None] * np.linalg.solve(np.eye(6 * n) - F * (1 - eps), F * eps)
    return G.reshape(6, n, 6, n).sum(axis=(1, 3))


def extrapolated_cube(emissivity: np.ndarray) -> np.ndarray:
    """The limit of small patches: halving them divides the error by 3.1."""
    coarse, fine = (exchange_of_cube(emissivity, cells) for cells in (4, 8))
    return fine + (fine - coarse) / 2.1

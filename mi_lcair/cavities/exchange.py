"""Diffuse exchange between the rings of a convex body of revolution.

Two coaxial discs of radii a and b at a distance h exchange radiation over the area

    A_a F_ab = pi/2 (X - sqrt(X^2 - 4 a^2 b^2)),    X = a^2 + b^2 + h^2

(Howell, A Catalog of Radiation Heat Transfer Configuration Factors, C-41). What passes between two
rings of a convex wall passes the discs between them. Their exchange is therefore a difference of
those of the discs at their edges, and exact for a curved wall too.
"""

from math import pi

import numpy as np


def disc_exchange(a, b, h):
    """Exchange area of two coaxial discs of radii a and b at a distance h, of the unit a^2."""
    X = a**2 + b**2 + h**2
    root = np.sqrt(((a - b) ** 2 + h**2) * ((a + b) ** 2 + h**2))
    return 2 * pi * (a * b) ** 2 / np.maximum(X + root, 1e-300)


def ring_exchange(nodes: np.ndarray, areas: np.ndarray) -> np.ndarray:
    """View factors between rings, (n, n): the share of each row's radiation that reaches a column.

    nodes: radii and depths of the n + 1 circles that bound the rings [m], in order. areas: of the
    rings [m^2]. What is missing to 1 in a row leaves through the first disc, the aperture.
    """
    r, z = nodes
    G = disc_exchange(r[:, None], r, z[:, None] - z)
    # Between rings i < j: G(i+1, j) - G(i+1, j+1) - G(i, j) + G(i, j+1)
    between = np.triu(G[1:, :-1] - G[1:, 1:] - G[:-1, :-1] + G[:-1, 1:], 1)
    discs = pi * r**2
    within = areas - (discs[1:] + discs[:-1] - 2 * np.diagonal(G, 1))
    return (between + between.T + np.diag(within)) / areas[:, None]

"""Exact view factors between patches on the walls of a box.

Source: Howell's catalogue, C-13 and C-15; Gross, Spindler and Hahne 1981.
"""

import numpy as np

WALLS = [(axis, side) for axis in range(3) for side in (0, 1)]  # of the unit cube


def parallel(a, b, distance):
    """Return the view factor from rectangle a to rectangle b in parallel planes.

    a, b: (4,) arrays x1, x2, y1, y2. distance: of the planes.
    """

    def G(x, y, ξ, η):
        u, v, z2 = x - ξ, y - η, distance**2
        p, q = np.sqrt(u**2 + z2), np.sqrt(v**2 + z2)
        return (
            v * p * np.arctan(v / p) + u * q * np.arctan(u / q) - z2 / 2 * np.log(u**2 + v**2 + z2)
        ) / (2 * np.pi)

    total = sum(
        (-1) ** (i + j + k + l) * G(a[i], a[2 + j], b[k], b[2 + l])
        for i in (0, 1)
        for j in (0, 1)
        for k in (0, 1)
        for l in (0, 1)
    )
    return total / ((a[1] - a[0]) * (a[3] - a[2]))


def perpendicular(a, b):
    """Return the view factor from rectangle a to rectangle b in perpendicular planes.

    a, b: (4,) arrays. The first two entries are distances from the planes' common line, the last
    two coordinates along it.
    """

    def G(x, y, ξ, η):
        r2, v = x**2 + ξ**2, y - η
        r = np.sqrt(r2)
        first = v * r * np.arctan(v / r) if r > 0 else 0.0
        s = r2 + v**2
        return (first - 0.25 * (r2 - v**2) * (np.log(s) if s > 0 else 0.0)) / (2 * np.pi)

    total = sum(
        (-1) ** (i + j + k + l) * G(a[i], a[2 + j], b[k], b[2 + l])
        for i in (0, 1)
        for j in (0, 1)
        for k in (0, 1)
        for l in (0, 1)
    )
    return total / ((a[1] - a[0]) * (a[3] - a[2]))


def cube(n):
    """Return the view factors (6 n^2, 6 n^2) between n x n patches on each wall of the unit cube.

    Patches are ordered wall by wall, as in WALLS. Rows add up to 1.
    """
    edges = np.linspace(0, 1, n + 1)
    patches = [
        (
            axis,
            side,
            {(axis + 1) % 3: (edges[i], edges[i + 1]), (axis + 2) % 3: (edges[j], edges[j + 1])},
        )
        for axis, side in WALLS
        for i in range(n)
        for j in range(n)
    ]
    F = np.zeros((len(patches), len(patches)))
    for row, (axis, side, span) in enumerate(patches):
        for column, (other, other_side, other_span) in enumerate(patches):
            if axis == other and side != other_side:
                u, v = (axis + 1) % 3, (axis + 2) % 3
                F[row, column] = parallel(
                    [*span[u], *span[v]], [*other_span[u], *other_span[v]], 1.0
                )
            elif axis != other:
                along = 3 - axis - other
                # Distances from the common line of the two walls.
                away = sorted(abs(x - other_side) for x in span[other])
                back = sorted(abs(x - side) for x in other_span[axis])
                F[row, column] = perpendicular([*away, *span[along]], [*back, *other_span[along]])
    return F

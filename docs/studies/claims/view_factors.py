"""View factors in Float64.

`to_polygon` is Lambert's formula for a point and a polygon (J. H. Lambert, Photometria, 1760).
`parallel_rectangles` and `perpendicular_rectangles` are closed forms for finite rectangles (J. R.
Ehlert and T. F. Smith, View factors for perpendicular and parallel rectangular plates, J.
Thermophys. Heat Transfer 7, 173, 1993). `by_areas` integrates cos cos / (pi d^2) over both areas.
"""

import numpy as np

LARGEST = 400_000  # points that are evaluated at a time


def to_polygon(points, normals, polygon) -> np.ndarray:
    """Shares of the hemispheres of points that a convex polygon fills, (N,).

    Each is the share of cos-weighted directions around the point's normal, whichever side of the
    polygon is seen. What lies below the point's horizon does not count.

    Parameters
    ----------
    points, normals : ndarray, shape (N, 3)
        Points, and unit normals.
    polygon : ndarray, shape (V, 3)
        Its corners, in order.
    """
    points, normals = np.broadcast_arrays(points, normals)
    corners = np.asarray(polygon)[None] - points[:, None]  # (N, V, 3)
    height = np.einsum("nvi,ni->nv", corners, normals)
    total = np.zeros(len(points))
    leaves, enters = np.zeros_like(points), np.zeros_like(points)  # where the horizon is crossed
    crosses = np.zeros(len(points), bool)
    count = corners.shape[1]
    for k in range(count):
        a, b = corners[:, k], corners[:, (k + 1) % count]
        ha, hb = height[:, k], height[:, (k + 1) % count]
        up_a, up_b = ha > 0, hb > 0
        with np.errstate(divide="ignore", invalid="ignore"):
            at_horizon = a + (ha / (ha - hb))[:, None] * (b - a)
        down, up = up_a & ~up_b, ~up_a & up_b
        leaves[down], enters[up] = at_horizon[down], at_horizon[up]
        crosses |= down
        start = np.where(up_a[:, None], a, at_horizon)
        end = np.where(up_b[:, None], b, at_horizon)
        total += np.where(up_a | up_b, of_edge(start, end, normals), 0)
    total += np.where(crosses, of_edge(leaves, enters, normals), 0)
    return np.abs(total) / (2 * np.pi)


def of_edge(a, b, normals) -> np.ndarray:
    """Angle between two directions, times the cosine between their plane's normal and `normals`."""
    cross = np.cross(a, b)
    length = np.linalg.norm(cross, axis=-1)
    angle = np.arctan2(length, np.einsum("ni,ni->n", a, b))
    along = np.einsum("ni,ni->n", cross, normals)
    return np.divide(angle * along, length, out=np.zeros_like(length), where=length > 0)


def midpoints(count: int, order: int = 4) -> tuple[np.ndarray, np.ndarray]:
    """Nodes and weights of `count` panels of Gauss's quadrature on 0..1."""
    x, w = np.polynomial.legendre.leggauss(order)
    nodes = (np.arange(count)[:, None] + (x + 1) / 2) / count
    return nodes.ravel(), np.tile(w / 2 / count, count)


def on_rectangle(centre, u, v, count: int):
    """Points (N, 3) on the rectangle centre +- u +- v and their weights, which add up to 1."""
    x, w = midpoints(count)
    s, t = np.meshgrid(2 * x - 1, 2 * x - 1, indexing="ij")
    points = centre + s.reshape(-1, 1) * u + t.reshape(-1, 1) * v
    return points, np.outer(w, w).ravel()


def by_areas(first, second, count: int = 12) -> float:
    """View factor from one rectangle to another that sees all of it, by areas.

    Each is (centre, u, v) as for `on_rectangle`. Only the front side of the second sends.
    """
    (p, wp), (q, wq) = on_rectangle(*first, count), on_rectangle(*second, count)
    normals = [np.cross(u, v) / np.linalg.norm(np.cross(u, v)) for _, u, v in (first, second)]
    total, step = 0.0, max(1, LARGEST // len(q))
    for k in range(0, len(p), step):
        d = q[None] - p[k : k + step, None]
        d2 = np.einsum("pqi,pqi->pq", d, d)
        cos = np.maximum(d @ normals[0], 0) * np.maximum(-(d @ normals[1]), 0)
        total += wp[k : k + step] @ (cos / d2**2) @ wq
    _, u, v = second
    return float(total * 4 * np.linalg.norm(np.cross(u, v)) / np.pi)


def parallel_rectangles(x, y, xi, eta, z: float) -> float:
    """View factor between rectangles in parallel planes with parallel edges.

    x, y: limits (2,) of the first; xi, eta: those of the second; z: the planes' distance.
    """
    total = 0.0
    for i in range(2):
        for j in range(2):
            for k in range(2):
                for m in range(2):
                    a, b = x[i] - xi[m], y[j] - eta[k]
                    p, q = np.hypot(a, z), np.hypot(b, z)
                    g = b * p * np.arctan(b / p) + a * q * np.arctan(a / q)
                    g -= z**2 / 2 * np.log(a**2 + b**2 + z**2)
                    total += (-1) ** (i + j + k + m) * g
    return total / (2 * np.pi * (x[1] - x[0]) * (y[1] - y[0]))


def perpendicular_rectangles(x, y, eta, z) -> float:
    """View factor from x, y in the plane z = 0 to eta (along y) and z in the plane x = 0."""
    total = 0.0
    for i in range(2):
        for j in range(2):
            for k in range(2):
                for m in range(2):
                    b, c2 = y[j] - eta[k], x[i] ** 2 + z[m] ** 2
                    c = np.sqrt(c2)
                    g = b * c * np.arctan(b / c) if c > 0 else 0.0
                    g -= (c2 - b**2) * np.log(c2 + b**2) / 4 if c2 + b**2 > 0 else 0.0
                    total += (-1) ** (i + j + k + m) * g
    return total / (2 * np.pi * (x[1] - x[0]) * (y[1] - y[0]))

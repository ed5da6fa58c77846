"""What coincides in a model: vertices, which are welded, and triangles in one plane.

Of triangles that overlap in one plane, rounding decides which one a ray hits.
"""

from dataclasses import dataclass

import numpy as np

TOLERANCE = 1e-6  # distance at which vertices count as equal, as a fraction of the extent
FLATNESS = 1e-6  # distance at which planes count as equal, as a fraction of the extent
SAME_DIRECTION = 1e-5  # difference in each coordinate at which unit normals count as parallel
NEAR = 1e-3  # largest distance between two triangles in one plane, as a fraction of their size
SINGLE = 2.0**-22  # a few rounding errors of single precision, as a fraction of a coordinate


@dataclass(frozen=True)
class Overlaps:
    """Pairs of triangles (P, 2) that overlap in one plane.

    back_to_back: pairs that face opposite ways. same_side: pairs that face the same way.
    """

    back_to_back: np.ndarray
    same_side: np.ndarray


def unit_normals(corners: np.ndarray) -> np.ndarray:
    """Unit normals of triangles (n, 3, 3), (n, 3); 0 for those without an area."""
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)


def overlaps(corners: np.ndarray) -> Overlaps:
    """The pairs of triangles (T, 3, 3) that overlap in one plane.

    Triangles that share only an edge or a corner do not overlap.
    """
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.linalg.norm(normals, axis=1)
    usable = np.flatnonzero(areas > 0)
    if len(usable) < 2:
        return Overlaps(np.empty((0, 2), np.int64), np.empty((0, 2), np.int64))
    unit = normals / np.maximum(areas, 1e-300)[:, None]
    pairs = usable[_pairs(corners[usable], unit[usable])]
    pairs = np.unique(np.sort(pairs, axis=1), axis=0)
    pairs = pairs[_is_near(corners[pairs], unit[pairs[:, 0]])]
    opposite = np.einsum("pk,pk->p", normals[pairs[:, 0]], normals[pairs[:, 1]]) < 0
    return Overlaps(pairs[opposite], pairs[~opposite])


def _pairs(corners, unit):
    """Pairs (P, 2) of overlapping triangles with unit normals (T, 3), some of them twice."""
    points = corners.reshape(-1, 3)
    rounding = SINGLE * abs(points).max()  # m, of a coordinate
    flatness = max(FLATNESS * np.ptp(points, axis=0).max(), rounding)
    size = np.median(np.ptp(corners, axis=1).max(axis=1))
    direction = max(SAME_DIRECTION, rounding / size)
    corners = corners - (points.min(axis=0) + points.max(axis=0)) / 2
    # Of a plane's two normals, the one whose first large coordinate is positive
    leading = np.argmax(abs(unit) > 0.5, axis=1)
    unit = unit * np.sign(np.take_along_axis(unit, leading[:, None], axis=1))
    height = np.einsum("tk,tk->t", corners.mean(axis=1), unit)
    pairs = [_copies(corners)]
    # Planes are sorted into cells of two grids, the second one shifted by half a cell. Two planes
    # that rounding puts into different cells of one grid are in the same cell of the other.
    for shift in (0.0, 0.5):
        cells = np.column_stack([unit / direction, height / flatness]) / 4
        _, key = unique_rows(np.floor(cells + shift))
        order = np.argsort(key, kind="stable")
        begins = np.flatnonzero(np.append(True, np.diff(key[order]) != 0))
        sizes = np.diff(begins, append=len(order))
        shared = np.repeat(sizes > 1, sizes)
        mine, first = order[shared], np.repeat(order[begins], sizes)[shared]
        if len(mine):
            flat = _in_plane(corners[mine], unit[first])
            pairs.append(mine[_by_sweep(flat, first, rounding)])
    return np.concatenate(pairs)


def _is_near(corners, unit):
    """Whether pairs of triangles (P, 2, 3, 3) are nearer to each other than a part of their size.

    What counts as one plane follows the whole model, in which a pair may be small. unit: (P, 3),
    the normals of the first triangles.
    """
    middle, size = corners.mean(axis=2), np.ptp(corners, axis=2).max(axis=(1, 2))
    distance = abs(np.einsum("pk,pk->p", middle[:, 1] - middle[:, 0], unit))
    return distance <= NEAR * size + 8 * SINGLE * abs(corners).max(axis=(1, 2, 3))


def _copies(corners):
    """Pairs of triangles with the same three corners, in whatever order."""
    _, corner = unique_rows(corners.reshape(-1, 3))
    _, key = unique_rows(np.sort(corner.reshape(-1, 3), axis=1))
    order = np.argsort(key, kind="stable")
    same = np.flatnonzero(np.diff(key[order]) == 0)
    return np.stack([order[same], order[same + 1]], axis=1)


def _in_plane(corners, normals):
    """Triangles (n, 3, 2), anticlockwise, in the coordinates of planes with these normals."""
    along = np.cross(normals, np.eye(3)[np.argmin(abs(normals), axis=1)])
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    across = np.cross(normals, along)
    flat = np.stack([np.einsum("tck,tk->tc", corners, axis) for axis in (along, across)], axis=-1)
    clockwise = cross(flat[:, 1] - flat[:, 0], flat[:, 2] - flat[:, 0]) < 0
    flat[clockwise] = flat[clockwise][:, ::-1]
    return flat


def _by_sweep(flat, plane, rounding):
    """Overlapping pairs among triangles (n, 3, 2), each in the plane of its number (n,).

    Planes are cut into strips along their longer side, as high as their triangles are on average.
    In each strip a triangle is compared with those that begin before it ends. Triangles that meet
    in several strips are found in each of them.
    """
    low, high = flat.min(axis=1), flat.max(axis=1)
    begins = np.flatnonzero(np.append(True, np.diff(plane) != 0))
    sizes = np.diff(begins, append=len(plane))
    sides = np.maximum.reduceat(high, begins) - np.minimum.reduceat(low, begins)
    is_upright = np.repeat(sides[:, 1] > sides[:, 0], sizes)
    flat[is_upright] = flat[is_upright][..., ::-1] * [1, -1]  # turned, so still anticlockwise
    low, high = flat.min(axis=1), flat.max(axis=1)
    strip = np.repeat(np.add.reduceat(high[:, 1] - low[:, 1], begins) / sizes, sizes)
    bottom, top = (np.floor(edge[:, 1] / strip).astype(np.int64) for edge in (low, high))
    counts = top - bottom + 1
    owner = np.repeat(np.arange(len(flat)), counts)
    number = np.arange(len(owner)) - np.repeat(np.cumsum(counts) - counts - bottom, counts)
    order = np.lexsort((low[owner, 0], number, plane[owner]))
    owner, number = owner[order], number[order]
    low, high, plane, flat = low[owner], high[owner], plane[owner], flat[owner]
    pairs = [np.empty((0, 2), np.int64)]
    active, step = np.arange(len(owner)), 0
    while len(active):  # triangle `active` against the one `step` further on, while boxes meet in x
        step += 1
        active = active[active + step < len(owner)]
        other = active + step
        near = (plane[other] == plane[active]) & (number[other] == number[active])
        near &= low[other, 0] < high[active, 0]
        active, other = active[near], other[near]
        meet = (low[other, 1] < high[active, 1]) & (low[active, 1] < high[other, 1])
        a, b = active[meet], other[meet]
        overlapping = _overlap(flat[a], flat[b], rounding)
        pairs.append(np.stack([a[overlapping], b[overlapping]], axis=1))
    return owner[np.concatenate(pairs)]


def _overlap(a, b, rounding):
    """Whether anticlockwise triangles (n, 3, 2) share more than their border: no edge of either
    separates them, by more than rounding.
    """
    apart = np.zeros(len(a), bool)
    for first, second in ((a, b), (b, a)):
        edges = np.roll(first, -1, axis=1) - first
        sides = cross(edges[:, :, None], second[:, None] - first[:, :, None])  # (n, edge, corner)
        margin = rounding * np.linalg.norm(edges, axis=-1)
        apart |= (sides.max(axis=2) <= margin).any(axis=1)
    return ~apart


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Cross products of vectors in a plane, (..., 2) each, (...)."""
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def weld(vertices):
    """Index (V,) of the vertex that replaces each vertex (V, 3).

    It is the first vertex at the same position or within TOLERANCE of it.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    firsts, position = unique_rows(vertices)
    extent = np.ptp(vertices, axis=0).max()
    near = cKDTree(vertices[firsts], balanced_tree=False, compact_nodes=False).query_pairs(
        TOLERANCE * extent, output_type="ndarray"
    )
    if len(near) == 0:
        return firsts[position]
    links = coo_array((np.ones(len(near), bool), near.T), shape=(len(firsts), len(firsts)))
    _, cluster = connected_components(links, directed=False)
    first_of_cluster = np.full(cluster.max() + 1, len(vertices))
    np.minimum.at(first_of_cluster, cluster, firsts)
    return first_of_cluster[cluster][position]


def unique_rows(rows):
    """Index of the first occurrence of each different row, and for each row its number (M,).

    rows: (M, n). The function does the same as np.unique with axis=0 and is several times faster.
    """
    order = np.lexsort(rows.T)
    in_order = rows[order]
    starts = np.ones(len(rows), bool)
    starts[1:] = (in_order[1:] != in_order[:-1]).any(axis=1)
    inverse = np.empty(len(rows), int)
    inverse[order] = np.cumsum(starts) - 1
    # lexsort is stable, so the first one of equal rows comes first
    return order[starts], inverse

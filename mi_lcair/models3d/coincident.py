"""Search for triangles that overlap in one plane; rounding decides which one a ray hits."""

from dataclasses import dataclass

import numpy as np

FLATNESS = 1e-6  # distance at which planes count as equal, as a fraction of the extent
SAME_DIRECTION = 1e-5  # difference in each coordinate at which unit normals count as parallel
SINGLE = 2.0**-22  # a few rounding errors of single precision, as a fraction of a coordinate
# Largest number of triangles in one plane for which all pairs are tested. For more triangles, only
# centroids are tested.
ALL_PAIRS = 4000
MOST_TESTED = 100_000  # largest number of centroids tested in one plane; of more, every n-th
AT_ONCE = 2_000_000  # candidate pairs in memory at once


@dataclass(frozen=True)
class Overlaps:
    """Pairs of triangles (P, 2) that overlap in one plane.

    back_to_back: pairs that face opposite ways. same_side: pairs that face the same way.
    """

    back_to_back: np.ndarray
    same_side: np.ndarray


def overlaps(corners: np.ndarray) -> Overlaps:
    """The pairs of triangles (T, 3, 3) that overlap in one plane.

    All exact copies are found. In planes of up to ALL_PAIRS triangles, all partial overlaps are
    found. In larger planes, only triangles that cover another one's centroid are found. Triangles
    that share only an edge or a corner do not overlap.
    """
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.linalg.norm(normals, axis=1)
    usable = np.flatnonzero(areas > 0)
    if len(usable) < 2:
        return Overlaps(np.empty((0, 2), np.int64), np.empty((0, 2), np.int64))
    pairs = usable[_pairs(corners[usable], normals[usable] / areas[usable, None])]
    pairs = np.unique(np.sort(pairs, axis=1), axis=0)
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
    done = set()  # large planes that were already tested in the first grid
    for shift in (0.0, 0.5):
        cells = np.column_stack([unit / direction, height / flatness]) / 4
        key = _hashed(np.floor(cells + shift).astype(np.int64))
        order = np.argsort(key, kind="stable")
        begins = np.flatnonzero(np.append(True, np.diff(key[order]) != 0))
        sizes = np.diff(begins, append=len(order))
        for large in np.flatnonzero(sizes > ALL_PAIRS):
            mine = order[begins[large] : begins[large] + sizes[large]]
            if (len(mine), mine[0]) not in done:
                done.add((len(mine), mine[0]))
                flat = _in_plane(corners[mine], np.broadcast_to(unit[mine[0]], (len(mine), 3)))
                pairs.append(mine[_by_centroids(flat, rounding)])
        in_small_planes = np.repeat((sizes > 1) & (sizes <= ALL_PAIRS), sizes)
        first = np.repeat(order[begins], sizes)[in_small_planes]
        mine = order[in_small_planes]
        flat = _in_plane(corners[mine], unit[first])
        pairs.append(mine[_by_sweep(flat, first, rounding)])
    a, b = np.concatenate(pairs).T
    same = (abs(unit[a] - unit[b]) < 8 * direction).all(axis=1)
    same &= abs(height[a] - height[b]) < 8 * flatness  # two planes may share a hash
    return np.stack([a[same], b[same]], axis=1)


def _copies(corners):
    """Pairs of triangles with the same three corners, in whatever order."""
    key = np.sort(_hashed((corners + 0.0).reshape(-1, 3).view(np.int64)).reshape(-1, 3), axis=1)
    key = _hashed(key)
    order = np.argsort(key, kind="stable")
    same = np.flatnonzero(np.diff(key[order]) == 0)
    a, b = order[same], order[same + 1]
    equal = (corners[a][:, :, None] == corners[b][:, None]).all(axis=-1)  # (P, corner, corner)
    is_copy = equal.any(axis=2).all(axis=1) & equal.any(axis=1).all(axis=1)
    return np.stack([a[is_copy], b[is_copy]], axis=1)


def _hashed(rows):
    """One number for each row of integers (n, m); equal rows have equal numbers."""
    total = np.zeros(len(rows), np.uint64)
    for column in rows.T:
        total = (total ^ column.astype(np.uint64)) * np.uint64(0x9E3779B97F4A7C15)
        total ^= total >> np.uint64(32)
        total *= np.uint64(0xD6E8FEB86659FD93)
        total ^= total >> np.uint64(29)
    return total


def _in_plane(corners, normals):
    """Triangles (n, 3, 2), anticlockwise, in the coordinates of planes with these normals."""
    along = np.cross(normals, np.eye(3)[np.argmin(abs(normals), axis=1)])
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    across = np.cross(normals, along)
    flat = np.stack([np.einsum("tck,tk->tc", corners, axis) for axis in (along, across)], axis=-1)
    clockwise = _cross(flat[:, 1] - flat[:, 0], flat[:, 2] - flat[:, 0]) < 0
    flat[clockwise] = flat[clockwise][:, ::-1]
    return flat


def _by_sweep(flat, plane, rounding):
    """All overlapping pairs among triangles (n, 3, 2), each in the plane of its number (n,)."""
    if len(flat):
        # along the longer side of each plane, where the fewest boxes meet
        low, high = flat.min(axis=1), flat.max(axis=1)
        begins = np.flatnonzero(np.append(True, np.diff(plane) != 0))
        sides = np.maximum.reduceat(high, begins) - np.minimum.reduceat(low, begins)
        is_upright = np.repeat(sides[:, 1] > sides[:, 0], np.diff(begins, append=len(plane)))
        flat[is_upright] = flat[is_upright][..., ::-1] * [1, -1]  # turned, so still anticlockwise
    low, high = flat.min(axis=1), flat.max(axis=1)
    order = np.lexsort((low[:, 0], plane))
    low, high, plane, flat = low[order], high[order], plane[order], flat[order]
    pairs = [np.empty((0, 2), np.int64)]
    active, step = np.arange(len(order)), 0
    while len(active):  # triangle `active` against the one `step` further on, while boxes meet in x
        step += 1
        active = active[active + step < len(order)]
        other = active + step
        near = (plane[other] == plane[active]) & (low[other, 0] < high[active, 0])
        active, other = active[near], other[near]
        meet = (low[other, 1] < high[active, 1]) & (low[active, 1] < high[other, 1])
        a, b = active[meet], other[meet]
        overlapping = _overlap(flat[a], flat[b], rounding)
        pairs.append(np.stack([a[overlapping], b[overlapping]], axis=1))
    return order[np.concatenate(pairs)]


def _by_centroids(flat, rounding):
    """Pairs among triangles (n, 3, 2) of which one covers the other's centroid."""
    points = flat.mean(axis=1)
    tested = np.arange(0, len(flat), -(-len(flat) // MOST_TESTED))
    low, high = flat.min(axis=1), flat.max(axis=1)
    size = np.maximum((high - low).max(axis=1), 1e-30)
    level = np.ceil(np.log2(size)).astype(np.int64)  # a triangle covers at most 2 x 2 cells
    pairs = []
    for step in np.unique(level):
        mine = np.flatnonzero(level == step)
        cell = 2.0**step
        corner = np.floor(low[mine] / cell).astype(np.int64)
        keys = np.concatenate(
            [_key_of(corner + np.array(shift)) for shift in ((0, 0), (1, 0), (0, 1), (1, 1))]
        )
        owners = np.tile(mine, 4)
        order = np.argsort(keys, kind="stable")
        keys, owners = keys[order], owners[order]
        wanted = _key_of(np.floor(points[tested] / cell).astype(np.int64))
        begins = np.searchsorted(keys, wanted, side="left")
        counts = np.searchsorted(keys, wanted, side="right") - begins
        for begin, end in _chunks(counts):
            number = counts[begin:end]
            first = np.repeat(np.arange(begin, end), number)
            offset = np.arange(len(first)) - np.repeat(np.cumsum(number) - number, number)
            a, b = tested[first], owners[begins[first] + offset]
            inside = (a != b) & _contains(flat[b], points[a], rounding)
            pairs.append(np.stack([a[inside], b[inside]], axis=1))
    return np.concatenate(pairs)


def _chunks(counts):
    """Runs (begin, end) of entries with no more than about AT_ONCE of what they count."""
    total = np.cumsum(counts)
    begin = 0
    while begin < len(counts):
        before = total[begin - 1] if begin else 0
        end = max(begin + 1, int(np.searchsorted(total, before + AT_ONCE, side="right")))
        yield begin, end
        begin = end


def _key_of(cells):
    """One number for each cell (n, 2) of a grid."""
    return cells[:, 0] * np.int64(2**31) + cells[:, 1]


def _contains(triangles, points, rounding):
    """Whether anticlockwise triangles (n, 3, 2) hold points (n, 2) in their inside."""
    edges = np.roll(triangles, -1, axis=1) - triangles
    margin = rounding * np.linalg.norm(edges, axis=-1)
    return (_cross(edges, points[:, None] - triangles) > margin).all(axis=1)


def _overlap(a, b, rounding):
    """Whether anticlockwise triangles (n, 3, 2) share more than their border: no edge of either
    separates them, by more than rounding.
    """
    apart = np.zeros(len(a), bool)
    for first, second in ((a, b), (b, a)):
        edges = np.roll(first, -1, axis=1) - first
        sides = _cross(edges[:, :, None], second[:, None] - first[:, :, None])  # (n, edge, corner)
        margin = rounding * np.linalg.norm(edges, axis=-1)
        apart |= (sides.max(axis=2) <= margin).any(axis=1)
    return ~apart


def _cross(a, b):
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]

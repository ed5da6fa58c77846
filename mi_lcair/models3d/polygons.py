"""Triangulation of simple polygons that are plane or nearly plane."""

import numpy as np

from mi_lcair.coincident import cross

# Ratio of height to longest edge at which a triangle counts as a sliver, without area.
SLIVER = 1e-6
# Largest number of corners of a facet that is not convex; the time grows with its square.
MOST_CLIPPED = 2000
# Rounding error of a product of two lengths, as a fraction of the polygon's size squared.
ROUNDING = 1e-9


def triangulate(vertices, corners, first):
    """Triangles of polygonal facets.

    Slivers are left out. A facet without any triangle is degenerate.

    Parameters
    ----------
    vertices : (V, 3)
    corners : (N,)
        As in `Obj`.
    first : (F + 1,)
        As in `Obj`.

    Returns
    -------
    triangles : (T, 3)
        Indices of vertices.
    owners : (T,)
        The facet of each triangle, in ascending order.
    off_plane : (F,)
        Largest distance of a facet's corners from its mean plane.
    crossed : (F,)
        Mask of the facets that cut or fold back on themselves, or that are not convex and have more
        than MOST_CLIPPED corners. Their triangles are meaningless.
    """
    sizes = np.diff(first)
    off_plane, crossed = np.zeros(len(sizes)), np.zeros(len(sizes), bool)
    triangles, owners = [], []
    for size in np.unique(sizes):
        facets = np.flatnonzero(sizes == size)
        polygons = corners[first[facets, None] + np.arange(size)]
        indices, owner, off_plane[facets], crossed[facets] = _same_size(vertices, polygons)
        triangles.append(indices)
        owners.append(facets[owner])
    triangles, owners = np.concatenate(triangles), np.concatenate(owners)
    keep = np.flatnonzero(~_is_sliver(vertices[triangles]))
    order = keep[np.argsort(owners[keep], kind="stable")]
    return triangles[order], owners[order], off_plane, crossed


def _same_size(vertices, polygons):
    """triangulate() for polygons (M, n) of one size: triangles, whose they are, distance from
    plane, crossed.
    """
    count, size = polygons.shape
    if size == 3:
        return polygons, np.arange(count), np.zeros(count), np.zeros(count, bool)
    points = vertices[polygons] - vertices[polygons[:, :1]]
    # Newell's formula: area times unit normal
    normals = 0.5 * np.cross(points, np.roll(points, -1, axis=1)).sum(axis=1)
    areas = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.divide(normals, areas, out=np.zeros_like(normals), where=areas > 0)
    heights = np.einsum("mnk,mk->mn", points - points.mean(axis=1, keepdims=True), normals)
    off_plane = abs(heights).max(axis=1)

    fans = polygons[:, _fan(size)]  # (M, n - 2, 3)
    is_fan = _smallest(vertices, fans, normals) > 0
    if size == 4:
        # Of two diagonals at least one is right, also where a corner is reflex.
        turned = np.roll(polygons, -1, axis=1)[:, _fan(4)]
        is_turned = ~is_fan & (_smallest(vertices, turned, normals) >= 0)
        fans = np.where(is_turned[:, None, None], turned, fans)
        is_fan |= is_turned | (_smallest(vertices, fans, normals) >= 0)
    else:
        # Less than a full turn, so that no triangle covers another
        is_fan &= _angle_at_first(points, normals) < 2 * np.pi

    flat = _is_sliver(vertices[fans]).all(axis=1)  # no area at all: any fan will do
    folded = ~flat & (areas[:, 0] <= SLIVER * np.ptp(points, axis=1).max(axis=1) ** 2)
    is_fan = (is_fan | flat) & ~folded
    triangles, owners = [fans[is_fan].reshape(-1, 3)], [np.repeat(np.flatnonzero(is_fan), size - 2)]
    crossed = np.zeros(count, bool)
    for polygon in np.flatnonzero(~is_fan):
        names = polygons[polygon]
        ears = (
            None
            if size == 4 or folded[polygon] or size > MOST_CLIPPED
            else clip_ears(_projected(points[polygon], normals[polygon]), names)
        )
        crossed[polygon] = ears is None
        if ears:
            triangles.append(names[ears])
            owners.append(np.full(len(ears), polygon))
    return np.concatenate(triangles), np.concatenate(owners), off_plane, crossed


def clip_ears(points, names):
    """Triangles (index triples) of a simple polygon in the plane; None if it crosses itself.

    points (n, 2), anticlockwise; names (n,): corners of the same name are the same point, so that a
    polygon may touch itself, as where a cut leads to a hole. Corners on a straight line may end up
    in no triangle. Meisters' theorem: a simple polygon always has two ears.
    """
    if _crosses_itself(points, names):
        return None
    left, triangles = list(range(len(points))), []
    while len(left) > 2:
        position, is_flat = _find_ear(points, names, np.array(left))
        if position is None:
            return None
        if not is_flat:
            triangles.append((left[position - 1], left[position], left[(position + 1) % len(left)]))
        del left[position]
    return triangles


def _find_ear(points, names, left):
    """(position in `left`, whether it is flat) of a corner that can be cut off: a spike, an ear, or
    a corner on a line.
    """
    ears = np.stack([np.roll(left, 1), left, np.roll(left, -1)], axis=1)
    corners = points[ears]
    flat = _is_sliver(corners)
    arriving, leaving = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 1]
    spikes = flat & (np.einsum("nk,nk->n", arriving, leaving) <= 0)
    if spikes.any():
        return np.argmax(spikes), True
    left_turns = cross(arriving, leaving) > 0
    rounding = ROUNDING * np.ptp(points, axis=0).max() ** 2
    # First without another corner in the ear or on its border, then, where the polygon touches
    # itself, inside only.
    for margin in (-rounding, rounding):
        for position in np.flatnonzero(left_turns & ~flat):
            a, b, c = names[ears[position]]
            others = points[left[(names[left] != a) & (names[left] != b) & (names[left] != c)]]
            a, b, c = corners[position]
            inside = (
                (cross(b - a, others - a) > margin)
                & (cross(c - b, others - b) > margin)
                & (cross(a - c, others - c) > margin)
            )
            if not inside.any():
                return position, False
    return (np.argmax(flat), True) if flat.any() else (None, False)


def _crosses_itself(points, names):
    """Whether two edges of the closed polygon cross, each in its inside."""
    ends, end_names = np.roll(points, -1, axis=0), np.roll(names, -1)
    rounding = ROUNDING * np.ptp(points, axis=0).max() ** 2
    for a, b, *ends_of_edge in zip(points, ends, names, end_names):
        apart = ~np.isin(names, ends_of_edge) & ~np.isin(end_names, ends_of_edge)
        c, d = points[apart], ends[apart]
        parts = [
            (cross(b - a, c - a), cross(b - a, d - a)),
            (cross(d - c, a - c), cross(d - c, b - c)),
        ]
        if np.all(
            [(np.minimum(*sides) < -rounding) & (np.maximum(*sides) > rounding) for sides in parts],
            axis=0,
        ).any():
            return True
    return False


def _fan(size):
    """Corners (n - 2, 3) of the triangles that meet at corner 0."""
    return np.stack([np.zeros(size - 2, int), np.arange(1, size - 1), np.arange(2, size)], axis=1)


def _smallest(vertices, fans, normals):
    """The smallest area (M,) of each fan's triangles, seen along the normal, as a fraction of the
    whole; slivers are 0.
    """
    corners = vertices[fans]
    areas = np.einsum(
        "mtk,mk->mt",
        np.cross(corners[:, :, 1] - corners[:, :, 0], corners[:, :, 2] - corners[:, :, 0]),
        normals,
    )
    return np.where(_is_sliver(corners), 0, areas).min(axis=1)


def _angle_at_first(points, normals):
    """The angle (M,) that polygons (M, n, 3) span as seen from corner 0, which is the origin."""
    spokes, following = points[:, 1:-1], points[:, 2:]
    left = np.einsum("mnk,mk->mn", np.cross(spokes, following), normals)
    return np.arctan2(left, np.einsum("mnk,mnk->mn", spokes, following)).sum(axis=1)


def _is_sliver(corners):
    """Whether the height of triangles (..., 3, 2 or 3) is below SLIVER of their longest edge."""
    edges = np.roll(corners, -1, axis=-2) - corners
    a, b = edges[..., 0, :], edges[..., 1, :]
    doubled_area = abs(cross(a, b)) if a.shape[-1] == 2 else np.linalg.norm(np.cross(a, b), axis=-1)
    return doubled_area <= SLIVER * np.einsum("...k,...k->...", edges, edges).max(axis=-1)


def _projected(points, normal):
    """Points (n, 3) in a plane's own coordinates (n, 2), anticlockwise about its normal."""
    along = np.cross(normal, np.eye(3)[np.argmin(abs(normal))])
    along /= np.linalg.norm(along)
    return np.stack([points @ along, points @ np.cross(normal, along)], axis=1)

"""The edges of triangles at which a surface may end."""

import numpy as np

from mi_lcair.coincident import SINGLE

FLAT = 1e-6  # distance of a vertex from a plane, in parts of the extent, at which it lies in it


class ModelEdges:
    """The edges of triangles at which a surface may end, as a point or a direction sees it.

    ends: two vertices of each edge (E, 2). opposite: the third vertex of each of its triangles, -1
    for none, (E, K). beside: the numbers of these triangles, (E, K). Edges between two triangles of
    one kind in one plane are left out.

    surface: MovedMesh. kinds: a number of each triangle, (T,).
    """

    def __init__(self, surface, kinds=None):
        vertices, triangles, same = surface.vertices, surface.triangles, surface.welded
        sides = np.concatenate([np.roll(triangles, k, axis=1) for k in range(3)])
        ends = np.sort(same[sides[:, :2]], axis=1)
        proper = (np.diff(np.sort(same[triangles], axis=1), axis=1) > 0).all(axis=1)
        some = np.flatnonzero(np.tile(proper, 3))
        sides, ends = sides[some], ends[some]
        _, first, edge, count = np.unique(
            ends, axis=0, return_index=True, return_inverse=True, return_counts=True
        )
        unique, edge = sides[first, :2], edge.ravel()
        order = np.argsort(edge, kind="stable")
        place = np.arange(len(edge)) - np.repeat(np.cumsum(count) - count, count)
        opposite = np.full((len(unique), count.max()), -1)
        opposite[edge[order], place] = sides[order, 2]
        beside = np.full(opposite.shape, -1)
        beside[edge[order], place] = some[order] % len(triangles)
        a, b = vertices[unique].swapaxes(0, 1)
        self.length = np.linalg.norm(b - a, axis=1)
        third = vertices[opposite] - a[:, None]
        normal = np.cross(b - a, third[:, 0])
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
        height = np.abs(np.einsum("ek,ejk->ej", normal, third)).max(
            axis=1, where=opposite >= 0, initial=0
        )
        along = (b - a) / np.maximum(self.length, 1e-300)[:, None]
        across = np.cross(normal, along)
        far = np.einsum("ek,ejk->ej", across, third)
        beyond = np.where(opposite >= 0, far * far[:, :1], 1).min(axis=1) < 0
        of_kind = np.zeros(len(triangles)) if kinds is None else kinds
        alike = (of_kind[beside] == of_kind[beside[:, :1]])[:, 1:] | (beside[:, 1:] < 0)
        flat = FLAT * np.ptp(vertices[: surface.of_model], axis=0).max()
        flat = flat + SINGLE * np.abs(vertices[unique]).max(axis=(1, 2))
        keep = ~((height < flat) & beyond & alike.all(axis=1))
        self.ends, self.opposite, self.beside = unique[keep], opposite[keep], beside[keep]
        self.length = self.length[keep]

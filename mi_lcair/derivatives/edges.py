"""The edges of triangles at which a surface may end, and where parts of a surface meet."""

from functools import cached_property

import mitsuba as mi
import numpy as np
from scipy.spatial import cKDTree

from mi_lcair.coincident import SINGLE, unit_normals
from mi_lcair.plugins.emission.triangles import numbers_of_triangles

# Distances in parts of the extent: of a vertex from a plane at which it lies in it, and at which
# surfaces touch
FLAT, INSET = 1e-6, 1e-5
GRAZING, PLACES = 1e-3, (0.23, 0.51, 0.79)  # cosine of a ray along a surface; places on an edge
APART = 1e-3  # least velocity, in parts of the largest one, at which parts come apart


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
            ends @ [len(vertices), 1], return_index=True, return_inverse=True, return_counts=True
        )
        unique = sides[first, :2]
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


class Contacts:
    """Where parts of a surface touch or pass through each other.

    surface: MovedMesh. edges: its ModelEdges. by_curves: whether `curves` are searched for.
    """

    def __init__(self, surface, edges: ModelEdges, by_curves: bool = False):
        self.surface, self.edges, self.by_curves = surface, edges, by_curves
        self.number = numbers_of_triangles(surface.meshes)

    def meets_itself(self, velocities=None) -> bool:
        """Whether a part of the model touches another one, or passes through at unknown `curves`.

        Where parts touch, they may come apart or pass through each other. With velocities of the
        vertices (V, 3), this counts only if they do, but so does what lies on an edge or a vertex,
        and what passes through.
        """
        if velocities is not None:
            apart = np.abs(velocities - velocities[self.surface.welded]).max()
            if apart > APART * np.abs(velocities).max() or velocities[self.ends_within_edges].any():
                return True
        passes, touches = self.meetings(velocities)
        return touches or (passes and self.curves is None)

    def meetings(self, velocities=None) -> tuple[bool, bool]:
        """Whether an edge passes through a triangle of another part, and whether it touches one.

        Only those count of which a part moves. With velocities of the vertices (V, 3), only touches
        count that come apart or pass through.
        """
        vertices, edges = self.surface.vertices, self.edges
        moves = self.surface.moving >= 0 if velocities is None else velocities.any(axis=1)
        if not len(edges.ends):
            return False, False
        a, b = (vertices[edges.ends[:, k]] for k in range(2))
        along, inset = (b - a) / edges.length[:, None], INSET * self.surface.extent
        lengths = np.maximum(edges.length - 2 * inset, 0)
        edge, place = np.nonzero(edges.opposite >= 0)
        # Short rays through the planes of an edge's triangles, just beyond the edge
        third = vertices[edges.opposite[edge, place]] - a[edge]
        into = third - along[edge] * np.sum(third * along[edge], axis=1, keepdims=True)
        into /= np.linalg.norm(into, axis=1, keepdims=True)
        normal = np.cross(along[edge], into)
        beyond = [a[edge] + t * (b - a)[edge] - inset * (into + normal) for t in PLACES]
        rays = [(np.arange(len(a)), a + inset * along, along, lengths, np.full(len(a), np.nan))]
        short = np.full(len(edge), 2 * inset)
        rays += [(edge, o, normal, short, 0 * short + t) for o, t in zip(beyond, PLACES)]
        number, start, to, length, t = map(np.concatenate, zip(*rays))
        ray = mi.Ray3f(mi.Point3f(start.T), mi.Vector3f(to.T), mi.Float(length), 0, [])
        pi = self.surface.scene.mi.ray_intersect_preliminary(ray)
        hit = self.number.at(pi.shape, pi.prim_index, pi.is_valid()).numpy().astype(int) - 1
        met, number, to, t = (values[hit >= 0] for values in (hit, number, to, t))
        same, triangles = self.surface.welded, self.surface.triangles[met]
        shares = (same[triangles][:, :, None] == same[edges.ends[number, None]]).any(axis=(1, 2))
        normals = unit_normals(vertices[triangles])
        shares |= ~moves[edges.ends[number]].any(axis=1) & ~moves[triangles].any(axis=1)
        meets = ~shares & (np.abs(np.sum(normals * to, axis=1)) > GRAZING)
        if velocities is not None and meets.any():
            u, v = pi.prim_uv.numpy()[:, hit >= 0]
            of_edges = np.einsum("kn,nkx->nx", [1 - t, t], velocities[edges.ends[number]])
            corners = self.surface.as_traced[met]
            apart = of_edges - np.einsum("kn,nkx->nx", [1 - u - v, u, v], velocities[corners])
            apart = np.abs(np.sum(normals * apart, axis=1))
            meets &= ~(apart <= APART * np.abs(velocities).max())  # NaN where one passes through
        return bool((meets & np.isnan(t)).any()), bool((meets & ~np.isnan(t)).any())

    @cached_property
    def curves(self) -> tuple[np.ndarray, np.ndarray] | None:
        """The straight curves in which two triangles pass through each other.

        At both ends, an edge of one triangle meets the other one: their vertices, (n, 2, 5). Also
        the numbers of the two triangles, (n, 2). None if not all ends are found.
        """
        if not self.by_curves:
            return None
        vertices, triangles = self.surface.vertices, self.surface.triangles
        edges = ModelEdges(self.surface, np.arange(len(triangles)))
        a, b = vertices[edges.ends].swapaxes(0, 1)
        along, inset = (b - a) / edges.length[:, None], INSET * self.surface.extent
        edge, t, found = np.arange(len(a)), np.full(len(a), inset), [np.zeros((0, 2), int)]
        while len(edge):
            start, rest = a[edge] + t[:, None] * along[edge], edges.length[edge] - t - inset
            ray = mi.Ray3f(mi.Point3f(start.T), mi.Vector3f(along[edge].T), mi.Float(rest), 0, [])
            pi = self.surface.scene.mi.ray_intersect_preliminary(ray, active=mi.Bool(rest > 0))
            met = self.number.at(pi.shape, pi.prim_index, pi.is_valid()).numpy().astype(int) - 1
            on, t = met >= 0, t + pi.t.numpy() + inset
            edge, t = edge[on], t[on]
            found.append(np.stack([edge, met[on]], axis=1))
        edge, met = np.concatenate(found).T
        same = self.surface.welded
        shares = (same[triangles[met]][:, :, None] == same[edges.ends[edge, None]]).any(axis=(1, 2))
        edge, met = edge[~shares], met[~shares]
        rows, k = np.nonzero(edges.beside[edge] >= 0)
        pairs = np.sort(np.stack([edges.beside[edge[rows], k], met[rows]], axis=1), axis=1)
        pairs, number, count = np.unique(pairs, axis=0, return_inverse=True, return_counts=True)
        moves = (self.surface.moving >= 0)[triangles[pairs]].any(axis=(1, 2))
        if (count[moves] != 2).any():
            return None
        order = np.argsort(number.ravel(), kind="stable")
        rows = rows[order][moves[number.ravel()[order]]]
        ends = np.concatenate([edges.ends[edge], triangles[met]], axis=1)[rows]
        return ends.reshape(-1, 2, 5), pairs[moves]

    @cached_property
    def ends_within_edges(self) -> np.ndarray:
        """Where an edge ends within another one, so that both are the edge of a surface.

        The vertices of the other one and of the end, (n, 3).
        """
        vertices, edges = self.surface.vertices, self.edges
        ends = np.unique(self.surface.welded[edges.ends])
        a, b = vertices[edges.ends].swapaxes(0, 1)
        near = cKDTree(vertices[ends]).query_ball_point((a + b) / 2, edges.length * (0.5 - APART))
        edge, point = np.repeat(np.arange(len(near)), list(map(len, near))), vertices[ends]
        number = np.concatenate(near).astype(int)
        point = point[number] - a[edge]
        along = ((b - a) / edges.length[:, None])[edge]
        beside = np.linalg.norm(np.cross(along, point), axis=1)
        within = beside < INSET * self.surface.extent
        return np.column_stack([edges.ends[edge], ends[number]])[within]

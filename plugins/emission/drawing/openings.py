"""Openings of hollow bodies: reflected paths that would escape through them are drawn again."""

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.plugins.emission.drawing.light_tree import LightTree
from mi_lcair.plugins.emission.drawing.panels import Panels
from mi_lcair.plugins.emission.triangles import (
    TriangleTable,
    is_faceted,
    loops,
    random_integer,
    set_triangles,
    triangle_corners,
)

MOST_LIDS = 8  # of a scene; the largest ones are kept
MOST_EDGES = 32  # of a lid; an outline with more is followed by some of its corners
TRIES = 3  # directions of a reflection, of which the last one is kept wherever it goes
# Largest density of a reflected direction, relative to that of the draw toward the lids, for which
# it is drawn again. It keeps the weights of the other paths positive.
LARGEST_SHARE = 0.9


class Openings:
    """The openings of a scene's hollow bodies, closed by lids of triangles.

    Where rays that escape meet no radiance, a reflected path ends in nothing if it leaves through
    an opening. Such rare ends are most of the noise of a cavity. Let E be directions that leave
    through a lid, and P their probability for a reflection. A direction drawn toward the lids gives
    an unbiased estimate of P. A reflected direction in E is drawn again, up to n = TRIES times. If
    one before the last is not in E, the path goes on along it with the weight 1 - P; otherwise
    along the last one, with the weight 1. The mean is that of single tries, since
    (1 - P) (1 + P + ... + P^(n-2)) + P^(n-1) = 1. The variance from escapes falls from about P to
    P^n.

    The lids only choose what is drawn again. The mean does not depend on them.

    panels: the triangles of the lids. tree: draws them by what would arrive from them.
    """

    def __init__(self, triangles: np.ndarray):
        """triangles: those of all lids, (n, 3, 3) [m]."""
        mesh = mi.Mesh("lids", 3 * len(triangles), len(triangles))
        set_triangles(mesh, triangles, np.arange(3 * len(triangles)))
        even = np.ones(len(triangles))
        self.panels = Panels(TriangleTable([mesh]), even, even > 0)
        self.tree = LightTree(self.panels)
        self.count = dr.opaque(mi.UInt32, len(self.panels.first))

    @staticmethod
    def of(scene) -> "Openings | None":
        """The openings of a scene's meshes; None without any, or if escaping rays meet radiance."""
        meshes = [shape for shape in scene.shapes() if is_faceted(shape)]
        if not meshes or scene.environment() is not None:
            return None
        corners = np.concatenate([np.stack(triangle_corners(mesh), axis=1) for mesh in meshes])
        lids = sorted(map(lid, outlines(corners)), key=area)[-MOST_LIDS:]
        lids = [triangles for triangles in lids if area(triangles) > 0]
        return Openings(np.concatenate(lids)) if lids else None

    def reflect(self, scene, emitters, hit, sampler, bs, weight) -> tuple:
        """The direction in which a reflected path goes on, see the class.

        Parameters
        ----------
        scene : mi.Scene
        emitters : EmitterTable
            Its rays start at the hit.
        hit : Hit
            Where paths are reflected that go on.
        sampler : mi.Sampler
        bs, weight : mi.BSDFSample3f, mi.Spectrum
            The first try: direction, and BSDF times cosine divided by its density.

        Returns
        -------
        (bs, weight, factor) : tuple
            The direction, its weight, and the factor of the path's throughput.
        """
        ctx, si, bsdf = mi.BSDFContext(), hit.si, hit.bsdf
        receiver = emitters.receiver(si)
        smooth = hit.goes_on & mi.has_flag(bsdf.flags(), mi.BSDFFlags.Smooth)

        number = dr.float64_array_t(mi.Float)(random_integer(sampler.next_2d())) * 2.0**-32
        panel, probability = self.tree.draw(number, receiver, smooth)
        seen = self.panels.seen(panel, receiver, smooth)
        d, _, density = seen.draw(sampler.next_2d())
        first, distance = self.crossed(receiver.p, d, smooth)
        pdf = bsdf.pdf(ctx, si, si.to_local(d), smooth)
        share = probability * seen.along(d, distance)
        ray = emitters.spawn_ray(si, d)
        in_E = self.leaves(scene, ray, pdf, share, smooth & (first == panel))
        P = dr.select(in_E, pdf / (probability * density), 0)

        leaves = mi.Bool(smooth)
        for _ in range(TRIES - 1):
            leaves &= ~mi.has_flag(bs.sampled_type, mi.BSDFFlags.Delta)
            d = si.to_world(bs.wo)
            panel, distance = self.crossed(receiver.p, d, leaves)
            leaves &= panel < self.count
            share = self.tree.probability(panel, receiver, leaves)
            share *= self.panels.seen(panel, receiver, leaves).along(d, distance)
            leaves = self.leaves(scene, emitters.spawn_ray(si, d), bs.pdf, share, leaves)
            again = bsdf.sample(ctx, si, sampler.next_1d(), sampler.next_2d(), leaves)
            bs, weight = dr.select(leaves, again[0], bs), dr.select(leaves, again[1], weight)
        return bs, weight, dr.select(leaves | ~smooth, 1, 1 - P)

    def leaves(self, scene, ray, pdf, share, active) -> mi.Bool:
        """Whether directions of rays that cross a lid are in E.

        pdf: density of the reflection. share: that of the draw toward the lids; both [1/sr].
        """
        active = active & (pdf > 0) & (pdf <= LARGEST_SHARE * share)
        return active & ~scene.ray_test(ray, active)

    @dr.syntax
    def crossed(self, p, d, active) -> tuple[mi.UInt32, mi.Float]:
        """Number of the first panel of the list that a ray crosses, and its distance [m].

        The number of all panels if it crosses none.
        """
        panel, distance, active = mi.UInt32(0), mi.Float(0), mi.Bool(active)
        while dr.hint(active, label="lids"):
            corner, *edges = (
                dr.gather(mi.Vector4f, self.panels.rows, 3 * panel + row).xyz for row in range(3)
            )
            # T. Moeller, B. Trumbore, J. Graph. Tools 2 (1997) 21
            across, to = dr.cross(d, edges[1]), p - corner
            scale, up = dr.rcp(dr.dot(edges[0], across)), dr.cross(to, edges[0])
            u, v = scale * dr.dot(to, across), scale * dr.dot(d, up)
            distance = scale * dr.dot(edges[1], up)
            is_rectangle = dr.gather(mi.UInt32, self.panels.kinds, panel) > 0
            end = dr.select(is_rectangle, dr.maximum(u, v), u + v)
            active &= ~((dr.minimum(u, v) >= 0) & (end <= 1) & (distance > 0))
            panel += dr.select(active, mi.UInt32(1), 0)
            active &= panel < self.count
        return panel, distance


def area(triangles) -> float:
    """Area of triangles, (n, 3, 3) [m^2]."""
    edges = triangles[:, 1:] - triangles[:, :1]
    return 0.5 * float(np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1).sum())


def lid(outline) -> np.ndarray:
    """Triangles between the corners of a closed line, (n, 3), and their centre, (m, 3, 3) [m]."""
    corners = outline[:: -(-len(outline) // MOST_EDGES)]
    centre = np.broadcast_to(corners.mean(axis=0), corners.shape)
    return np.stack([centre, corners, np.roll(corners, -1, axis=0)], axis=1)


def outlines(corners) -> list[np.ndarray]:
    """Closed lines of the edges that belong to one triangle only, each (n, 3) [m].

    corners: those of the triangles, (triangles, 3, 3), Float32. Corners at the same place are one.
    """
    vertices = corners.reshape(-1, 3) + np.float32(0)  # -0 becomes 0, which has other bytes
    # As bytes, which are sorted three times as fast as rows
    _, places, number = np.unique(vertices.view("V12"), return_index=True, return_inverse=True)
    triangles, places = number.reshape(-1, 3), vertices[places]
    edges = np.sort(np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2).reshape(-1, 2))
    edges, count = np.unique(edges[edges[:, 0] != edges[:, 1]], axis=0, return_counts=True)
    return [places[line] for line in loops(edges[count == 1])]

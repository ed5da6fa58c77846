"""Edges of triangles, and points attached to triangles, with derivatives of what these show."""

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.coincident import SINGLE

FLAT = 1e-6  # distance of a vertex from a plane, in parts of the extent, at which it lies in it
TURN = 1e-3  # change of a direction from which the slope of a reflection or an emission is taken


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


@dataclass
class AttachedPlace:
    """A point of a surface and its frame, with derivatives, and the interaction without them.

    twice_area: of its triangle [m^2]; 1 for other surfaces. triangle: from 1, or 0.
    """

    si: mi.SurfaceInteraction3f
    p: mi.Point3f
    s: mi.Vector3f
    t: mi.Vector3f
    n: mi.Vector3f
    twice_area: mi.Float
    triangle: mi.UInt32

    def growth(self, place: "AttachedPlace") -> mi.Float:
        """1, with the derivatives of the solid angle in which another place sees its triangle."""
        between = self.p - place.p
        cosine = dr.abs(dr.dot(self.n, dr.normalize(between)))
        solid_angle = cosine * self.twice_area / dr.squared_norm(between)
        return solid_angle / dr.detach(solid_angle)

    def density(self, bsdf, toward, to, active) -> mi.Float:
        """Density with which a reflection takes a direction, without derivatives [1/sr]."""
        wi, wo = dr.detach(self.local(toward)), dr.detach(self.local(to))
        return bsdf.pdf(mi.BSDFContext(), self.at(wi), wo, active)

    def local(self, direction) -> mi.Vector3f:
        return mi.Vector3f(*(dr.dot(direction, axis) for axis in (self.s, self.t, self.n)))

    def at(self, wi) -> mi.SurfaceInteraction3f:
        si = mi.SurfaceInteraction3f(self.si)
        si.wi = wi
        return si

    def detached(self, bsdf, toward, to, active) -> mi.Float:
        """Reflection toward a direction times cosine, without derivatives."""
        wi, wo = self.local(dr.detach(toward)), self.local(to)
        return bsdf.eval(mi.BSDFContext(), self.at(dr.detach(wi)), dr.detach(wo), active)[0]

    def reflection(self, bsdf, toward, to, active) -> mi.Float:
        """Reflection times cosine, with its derivatives by both directions."""
        ctx, wi, wo = mi.BSDFContext(), self.local(toward), self.local(to)
        wi0, wo0 = dr.detach(wi), dr.detach(wo)
        value = lambda i, o: bsdf.eval(ctx, self.at(i), o, active)[0]  # noqa: E731
        f = value(wi0, wo0)
        return f + slope(lambda i: value(i, wo0), wi) + slope(lambda o: value(wi0, o), wo)

    def reflectance(self, bsdf, toward, active) -> mi.Float:
        """Hemispherical reflectance of a lobe, less its value: its derivatives."""
        value = lambda w: bsdf.eval_diffuse_reflectance(self.at(w), active)[0]  # noqa: E731
        return slope(value, self.local(toward))

    def emission(self, scene, toward, active) -> mi.Float:
        """Emission toward a direction, with its derivatives."""
        emitter, wi = self.si.emitter(scene, active), self.local(toward)
        value = lambda w: emitter.eval(self.at(w), active)[0]  # noqa: E731
        here = dr.select(self.si.is_valid(), slope(value, wi), 0)
        return value(dr.select(self.si.is_valid(), dr.detach(wi), self.si.wi)) + here


def cosines_above(n, corners: list) -> mi.Float:
    """Integral of the cosine to a normal over a triangle's directions above the horizon [sr]."""

    def between(p, q):  # Lambert's formula
        p, q = (v * dr.rsqrt(dr.maximum(dr.squared_norm(v), 1e-30)) for v in (p, q))
        normal = dr.cross(p, q)
        sine = dr.sqrt(dr.maximum(dr.squared_norm(normal), 1e-12))
        return dr.dot(n, normal) * dr.atan2(sine, dr.dot(p, q)) / sine

    total, sets, rises = mi.Float(0), mi.Vector3f(0, 0, 1), mi.Vector3f(0, 0, 1)
    cut = mi.Bool(False)
    for p, q in zip(corners, corners[1:] + corners[:1]):
        from_p, from_q = dr.dot(n, p), dr.dot(n, q)
        crosses = (from_p > 0) != (from_q > 0)
        place = p + from_p / dr.select(crosses, from_p - from_q, 1) * (q - p)
        total += dr.select(
            (from_p > 0) | (from_q > 0),
            between(dr.select(from_p > 0, p, place), dr.select(from_q > 0, q, place)),
            0,
        )
        sets = dr.select(crosses & (from_p > 0), place, sets)
        rises = dr.select(crosses & (from_q > 0), place, rises)
        cut |= crosses
    return dr.abs(total + dr.select(cut, between(sets, rises), 0)) / 2


def derivative_of(number) -> mi.Float:
    """0, with the derivatives of a number."""
    return number - dr.detach(number)


def slope(function, direction) -> mi.Float:
    """0, with the derivatives of a function of a direction."""
    here = dr.detach(direction)
    change = mi.Float(0)
    with dr.suspend_grad():
        slopes = []
        for axis in mi.coordinate_system(here):
            ends = [function(dr.normalize(here + side * TURN * axis)) for side in (1, -1)]
            slopes.append((axis, (ends[0] - ends[1]) / (2 * TURN)))
    for axis, of_axis in slopes:
        moves = dr.dot(axis, direction)
        change += of_axis * (moves - dr.detach(moves))
    return change

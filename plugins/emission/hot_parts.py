"""The few brightest parts of a scene, toward which reflected rays are guided."""

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.plugins.derivatives import own_memory
from mi_lcair.plugins.emission import triangles
from mi_lcair.plugins.emission.draw_table import emits_behind, is_mesh

BRIGHT = 0.5  # part of the brightest source's radiance from which on sources are alike
MOST_PARTS = 8
# Share of the directions that are drawn toward hot parts, where a reflected ray meets them with a
# chance of less than RARE. Elsewhere the reflection finds them itself.
GUIDED, RARE = 0.2, 0.5


@dataclass
class HotParts:
    """Spheres around the triangles that are at least BRIGHT times as bright as the brightest.

    They only choose what is drawn, and the mean does not depend on them. They are kept with an
    `Aim`, for one state of the scene.

    spheres: centre and radius of each [m]. axes: mean normal of its triangles; 0 if they emit on
    both sides.
    """

    spheres: list[mi.Vector4f]
    axes: list[mi.Vector3f]

    @staticmethod
    def of(emitters) -> "HotParts | None":
        """Those of an `EmitterTable`; None if one is no mesh, or if a radiance has no bound."""
        corners, normals = [], []
        for emitter, bound in emitters.bounds.items():
            if bound is None:
                return None
            is_hot = bound >= BRIGHT * emitters.brightest
            if not is_hot.any():
                continue
            if not is_mesh(emitter):
                return None
            shape = emitter.get_shape()
            p = np.stack(triangles.triangle_corners(shape), axis=1).astype(np.float64)
            p = p[np.broadcast_to(is_hot, len(p))]
            sign = 0 if emits_behind(emitter) else -1 if shape.has_flipped_normals() else 1
            corners.append(p)
            normals.append(sign * np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]))
        if not corners:
            return None
        parts = divided(np.concatenate(corners), np.concatenate(normals))
        spheres = [mi.Vector4f(sphere_around(p).tolist()) for p, _ in parts]
        lengths = [max(np.linalg.norm(n, axis=1).sum(), 1e-300) for _, n in parts]
        axes = [mi.Vector3f((n.sum(axis=0) / s).tolist()) for (_, n), s in zip(parts, lengths)]
        own_memory([*spheres, *axes])
        return HotParts(spheres, axes)

    def seen(self, si, bsdf, active) -> "SeenParts":
        """The parts as seen from the hits `si`, where paths are reflected."""
        mirrored = si.to_world(mi.reflect(si.wi))
        nearest, least, total, cones = mirrored, mi.Float(dr.inf), mi.Float(0), []
        for sphere, axis in zip(self.spheres, self.axes):
            to = mi.Vector3f(sphere.xyz - si.p)
            distance = dr.norm(to)
            sin, d = dr.minimum(sphere.w / distance, 1), to / distance
            cos, along = dr.safe_sqrt(1 - dr.square(sin)), dr.dot(d, mirrored)
            # 1 - cos keeps its digits for a small part
            height = dr.select(dr.dot(axis, to) < sphere.w, dr.square(sin) / (1 + cos), 0)
            apart = dr.safe_acos(along) - dr.safe_asin(sin)
            edge = d * cos + dr.normalize(mirrored - along * d) * sin
            is_nearest = (height > 0) & (apart < least)
            nearest = dr.select(is_nearest, dr.select(apart > 0, edge, mirrored), nearest)
            least = dr.select(is_nearest, apart, least)
            total += height
            cones.append((d, height))
        pdf = bsdf.pdf(mi.BSDFContext(), si, si.to_local(nearest), active)
        is_delta = mi.has_flag(bsdf.flags(), mi.BSDFFlags.Delta)
        chance = dr.select(is_delta & (least < 0), 1, dr.minimum(pdf * dr.two_pi * total, 1))
        chance = dr.select(active, chance, 0)
        share = dr.select((chance > 0) & (chance < RARE) & ~is_delta, GUIDED, 0)
        return SeenParts(cones, total, chance, share)


def darker(emitters) -> float:
    """Radiance of the brightest emitter of an `EmitterTable` that is not hot [W m^-2 sr^-1]."""
    bounds = (bound for bound in emitters.bounds.values() if bound is not None)
    return max(float(b[b < BRIGHT * emitters.brightest].max(initial=0.0)) for b in bounds)


@dataclass(frozen=True)
class SeenParts:
    """The parts as seen from a point: cones, in which directions are drawn with even density.

    cones: direction of each axis, and 1 less the cosine of the opening; 0 for a part that does not
    face the point. total: sum of the latter. chance: about the probability that a reflected ray
    meets a part, if nothing hides it. It is the solid angle of the cones times the density of their
    direction that is nearest to that of a mirror. share: that of the directions that are drawn in
    the cones.
    """

    cones: list[tuple[mi.Vector3f, mi.Float]]
    total: mi.Float
    chance: mi.Float
    share: mi.Float

    @property
    def weight_of_hit(self) -> mi.Float:
        """About the weight of a direction that meets a part, for a reflectance of 1."""
        probability = dr.lerp(self.chance, 1, self.share)
        return dr.select(probability > 0, self.chance / probability, 0)

    def sample(self, ctx, si, bsdf, number, sample, active) -> tuple:
        """As `mi.BSDF.sample`, of the mixture of the BSDF's own density and that of the cones."""
        is_drawn = number < self.share
        rest = dr.select(is_drawn, 0, (number - self.share) / (1 - self.share))
        bs, weight = bsdf.sample(ctx, si, rest, sample, active)
        place = dr.select(is_drawn, number / self.share, 0) * self.total
        start, axis, height = mi.Float(0), mi.Vector3f(0, 0, 1), mi.Float(0)
        for d, of_cone in self.cones:
            is_it = (place >= start) & (of_cone > 0)
            axis, height = dr.select(is_it, d, axis), dr.select(is_it, of_cone, height)
            start += of_cone
        depth, (sin, cos) = sample.y * height, dr.sincos(dr.two_pi * sample.x)
        radius = dr.safe_sqrt(depth * (2 - depth))
        drawn = mi.Frame3f(axis).to_world(mi.Vector3f(radius * cos, radius * sin, 1 - depth))
        bs.wo = dr.select(is_drawn, si.to_local(drawn), bs.wo)
        f, pdf = bsdf.eval_pdf(ctx, si, bs.wo, active & is_drawn)
        f, pdf = dr.select(is_drawn, f, weight * bs.pdf), dr.select(is_drawn, pdf, bs.pdf)
        to, inside = si.to_world(bs.wo), mi.Float(0)
        for d, height in self.cones:
            is_inside = (height > 0) & (dr.squared_norm(to - d) <= 2 * height)
            inside += dr.select(is_inside, mi.Float(1), 0)
        of_cones = inside / dr.maximum(dr.two_pi * self.total, 1e-30)
        is_mixed = active & (self.share > 0)
        bs.pdf = dr.select(is_mixed, dr.lerp(pdf, of_cones, self.share), pdf)
        return bs, dr.select(is_mixed, dr.select(bs.pdf > 0, f / bs.pdf, 0), weight)


def sphere_around(corners) -> np.ndarray:
    """Centre and radius of a sphere around triangles (n, 3, 3), (4,)."""
    points = corners.reshape(-1, 3)
    centre = (points.min(axis=0) + points.max(axis=0)) / 2
    return np.append(centre, np.linalg.norm(points - centre, axis=1).max())


def divided(corners, normals) -> list[tuple[np.ndarray, np.ndarray]]:
    """Triangles (n, 3, 3) and their normals (n, 3) in up to MOST_PARTS parts.

    A part is divided in the middle where that halves the sum of the squared radii of the spheres.
    """
    done, parts = [], [(corners, normals)]
    while parts:
        part = parts.pop(0)
        centres = part[0].mean(axis=1)
        along = centres[:, np.argmax(np.ptp(centres, axis=0))]
        is_first = along < (along.min() + along.max()) / 2
        pays = is_first.any() and len(done) + len(parts) + 2 <= MOST_PARTS
        if pays:
            halves = [tuple(values[of] for values in part) for of in (is_first, ~is_first)]
            squares = [sphere_around(of)[3] ** 2 for of, _ in (*halves, part)]
            pays = squares[0] + squares[1] < squares[2] / 2
        parts, done = (parts + halves, done) if pays else (parts, [*done, part])
    return done

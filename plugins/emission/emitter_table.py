"""What emits in a scene: labels, and a mixture of facets and other emitters to draw directions
from.
"""

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.plugins.emission.field_of_view import FieldOfView
from mi_lcair.plugins.emission.radiance_bound import radiance_bound
from mi_lcair.plugins.emission.sources import OTHER, Sources
from mi_lcair.plugins.emission.triangles import (
    Choice,
    TriangleTable,
    is_faceted,
    pointer_id,
    random_integer,
    triangle_corners,
)

OFFSET = 64 * 2.0**-24  # of the scene's extent: above the rounding of a hit's position


@dataclass
class EmitterSample:
    """A direction toward an emitter: ds.pdf [1/sr] as seen from where the ray starts, the first hit
    along the ray, and whether that is what was drawn.

    bound: upper bound of the radiance [W m^-2 sr^-1] of what was drawn, hidden or not.
    """

    ds: mi.DirectionSample3f
    hit: mi.SurfaceInteraction3f
    emitter: mi.EmitterPtr
    counts: mi.Bool
    bound: mi.Float
    all_surfaces: bool

    def radiance(self, si):
        """What the emitter sends back toward `si`, with derivatives [W m^-2 sr^-1]."""
        if self.all_surfaces:
            return self.emitter.eval(self.hit, self.counts)
        hit = self.counts & mi.has_flag(self.emitter.flags(), mi.EmitterFlags.Surface)
        return self.emitter.eval(self.hit, hit) + self.emitter.eval_direction(
            si, self.ds, self.counts & ~hit
        )


def can_be_hit(emitter) -> bool:
    """Whether a ray that was not aimed at the emitter can meet it; a point light or a parallel beam
    is met by none.
    """
    return not emitter.flags() & int(mi.EmitterFlags.Delta)


def one_band(thermal):
    """The band in which all thermal emitters of a scene emit; None if none names one."""
    bands = {emitter.band.name: emitter.band for emitter in thermal if emitter.band is not None}
    if len(bands) > 1:
        raise InputError(
            f"the scene mixes bands: {', '.join(sorted(bands))}; all thermal emitters must name the same"
        )
    return next(iter(bands.values()), None)


class EmitterTable:
    """The emitters of a scene, by label and as one density over directions.

    `labels`: the groups of the thermal emitters, and `other` if the scene holds anything else.
    `sources`: what emission is told apart by. `draws`: whether there is anything to draw.

    `sample` and `pdf` mix the triangles of emitting meshes, drawn by area times a bound of their
    radiance, with every other emitter, drawn evenly. With `sampling` all emitters are drawn,
    otherwise only those that no path can hit.

    `brightest`: bound of the radiance of any emitter that can be hit [W m^-2 sr^-1]. `unbounded`:
    descriptions of the emitters for which no bound is known.
    """

    def __init__(self, scene, sampling: bool, by_spectrum: bool = False):
        emitters = list(scene.emitters())
        thermal = [emitter for emitter in emitters if hasattr(emitter, "group")]
        unlabelled = len(thermal) < len(emitters) or any(
            not hasattr(shape.emitter(), "group") for shape in scene.shapes()
        )
        self.labels = sorted(
            {emitter.group for emitter in thermal} | ({OTHER} if unlabelled else set())
        )
        ids = {pointer_id(mi.EmitterPtr(emitter)): emitter for emitter in emitters}
        label_of = np.full(
            max(ids, default=0) + 1, self.labels.index(OTHER) if unlabelled else 0, dtype=np.uint32
        )
        for key, emitter in ids.items():
            label_of[key] = self.labels.index(getattr(emitter, "group", OTHER))
        self.label_of = mi.UInt32(label_of)
        background = [
            key
            for key, emitter in ids.items()
            if getattr(emitter, "facet_type", "model") != "model"
        ]
        self.is_background = mi.UInt32(
            np.isin(np.arange(len(label_of)), background).astype(np.uint32)
        )

        self.band = one_band(thermal)
        self.sources = Sources(emitters, self.labels, self.band, by_spectrum)
        bounds = scene.bbox()
        self.least_offset = mi.Float(
            OFFSET * max(np.abs(bounds.min).max(), np.abs(bounds.max).max())
        )

        hittable = [emitter for emitter in emitters if can_be_hit(emitter)]
        bounds = {emitter: radiance_bound(emitter) for emitter in hittable}
        self.unbounded = [describe(emitter) for emitter in hittable if bounds[emitter] is None]
        self.bounds = [(emitter.get_shape(), bounds[emitter]) for emitter in hittable]
        largest = [float(bound.max()) for bound in bounds.values() if bound is not None]
        self.brightest = max(largest, default=0.0)

        self.opaque_brightest = dr.opaque(mi.Float, self.brightest)

        drawn = emitters if sampling else [e for e in emitters if not can_be_hit(e)]
        meshes = [
            emitter
            for emitter in drawn
            if can_be_hit(emitter) and emitter.get_shape() and is_faceted(emitter.get_shape())
        ]
        others = [emitter for emitter in drawn if emitter not in meshes]
        self.triangles = None
        weights = []
        if meshes:
            table = TriangleTable([emitter.get_shape() for emitter in meshes])
            # an unbounded emitter may be as bright as any: weights decide the noise alone
            known = [self.brightest or 1.0 if bounds[e] is None else bounds[e] for e in meshes]
            radiance = np.concatenate(
                [np.broadcast_to(*of_one) for of_one in zip(known, table.counts)]
            )
            weights = radiance * table.area
            self.triangles = table if weights.sum() > 0 else None
        self.others = None
        if others:
            self.others = mi.UInt32([pointer_id(mi.EmitterPtr(emitter)) for emitter in others])
        self.draws = self.triangles is not None or bool(others)
        if self.draws:
            share = 0.0 if self.triangles is None else 1.0 if not others else 0.5
            parts = [np.full(len(others), (1 - share) / max(len(others), 1))]
            if self.triangles is not None:
                parts.insert(0, share * weights / weights.sum())
            choice = Choice(np.concatenate(parts))
            self.choice, self.triangle_count = choice, len(choice.probability) - len(others)
            self.probability = mi.Float(choice.probability)
            of_others = [0.0 if bounds.get(e) is None else float(bounds[e].max()) for e in others]
            if self.triangles is not None:
                self.density = table.density(choice.probability[: self.triangle_count])
                of_others = np.append(radiance, of_others)
            self.bound = mi.Float(np.array(of_others))
            dr.make_opaque(self.probability, self.bound)
        dr.make_opaque(self.label_of, self.is_background, self.others, self.least_offset)

    def leave(self, si, d):
        """The point just off the surface where a ray in the direction `d` starts. Mitsuba's own
        offset, (1 + |p|) 9e-5 m, is coarse in a small scene; Float32 needs only some rounding
        errors of the scene's extent. A ray that is reflected starts as far back toward the
        observer: a hit on the very edge of two walls lies on both, and the offset from one does not
        leave the other.
        """
        mitsuba = (1 + dr.max(dr.abs(si.p))) * mi.math.RayEpsilon
        offset = dr.minimum(mitsuba, self.least_offset)
        cos = dr.dot(si.n, d)
        observer = si.to_world(si.wi)
        back = dr.select(cos * dr.dot(si.n, observer) > 0, dr.minimum(offset, 0.5 * si.t), 0)
        return dr.fma(observer, back, dr.fma(si.n, dr.mulsign(offset, cos), si.p))

    def spawn_ray(self, si, d):
        return mi.Ray3f(self.leave(si, d), d)

    def brightest_in_view(self, sensor) -> float:
        """Bound of the radiance of any emitter that a sensor may see directly [W m^-2 sr^-1]."""
        field = FieldOfView(sensor)
        brightest = 0.0
        for shape, bound in self.bounds:
            if bound is None or bound.max() <= brightest:
                continue
            hidden = field.excludes(hulls(shape)) if shape else np.zeros(1, bool)
            seen = np.broadcast_to(bound, hidden.shape) if len(bound) == 1 else bound
            brightest = max(brightest, float(seen[~hidden].max(initial=0.0)))
        return brightest

    def label(self, emitter):
        """Index into `labels` of an emitter pointer; that of `other` for a null pointer."""
        return dr.gather(mi.UInt32, self.label_of, dr.reinterpret_array(mi.UInt32, emitter))

    def is_model(self, emitter):
        """Whether what carries this emitter (or none) belongs to the model, not to its background."""
        return (
            dr.gather(mi.UInt32, self.is_background, dr.reinterpret_array(mi.UInt32, emitter)) == 0
        )

    def sample(self, scene, si, sample1, sample2, active):
        """Draws a direction from what emits and traces it to its first hit.

        sample1: uniform 2D sample that picks the triangle or other emitter. sample2: uniform 2D
        sample that picks the point on it. A sample counts only if the first hit is what was drawn;
        otherwise emitters that overlap or hide each other would be counted in each other's place.

        Directions are aimed from where the ray will start, and the density is the solid angle's as
        seen from there. Aimed from si.p, a ray would miss what is as near as its offset.
        """
        ds = dr.zeros(mi.DirectionSample3f)
        index = self.choice.pick(random_integer(sample1), active)
        from_triangles = active & (index < self.triangle_count)
        from_others = active & ~from_triangles
        bound = dr.gather(mi.Float, self.bound, index, active)
        if self.triangles is not None:
            _, ds.p, ds.n = self.triangles.point(index, sample2, from_triangles)
            ds.d = ds.p - self.leave(si, ds.p - si.p)
            ds.dist = dr.norm(ds.d)
            ds.d /= ds.dist
            ds.pdf = solid_angle_density(
                dr.gather(mi.Float, self.density, index, from_triangles), ds.dist, ds.d, ds.n
            )
        if self.others is not None:
            other = dr.reinterpret_array(
                mi.EmitterPtr,
                dr.gather(mi.UInt32, self.others, index - self.triangle_count, from_others),
            )
            # the first aim tells on which side of the surface the ray will start
            aim, _ = other.sample_direction(si, sample2, from_others)
            start = dr.zeros(mi.Interaction3f)
            start.p, start.time = self.leave(si, aim.d), si.time
            ds_other, value = other.sample_direction(start, sample2, from_others)
            of_beam = value[0] * ds_other.pdf  # irradiance over the cosine, of a point or a beam
            bound = dr.select(from_others & ds_other.delta, of_beam, bound)
            ds_other.pdf *= dr.gather(mi.Float, self.probability, index, from_others)
            ds = dr.select(from_triangles, ds, ds_other)

        hit = scene.ray_intersect(self.spawn_ray(si, ds.d), active)
        emitter, counts = hit.emitter(scene, active), mi.Bool(False)
        if self.triangles is not None:
            found, known = self.triangles.find(
                hit.shape, hit.prim_index, from_triangles & hit.is_valid()
            )
            counts = known & (found == index)
        if self.others is not None:
            # A line meets a sphere, cylinder, disk or rectangle at most twice, from different
            # sides. Side and shape identify the point. A distance would need a tolerance, which is
            # wrong beside the shape or at grazing incidence.
            same_side = dr.dot(hit.n, ds.d) * dr.dot(ds.n, ds.d) > 0
            nothing_before = ~hit.is_valid() | (hit.t > ds.dist * (1 - 1e-4))
            on_surface = mi.has_flag(other.flags(), mi.EmitterFlags.Surface)
            counts |= from_others & dr.select(
                on_surface, (emitter == other) & same_side, nothing_before
            )
            emitter = dr.select(from_triangles, emitter, other)
        return EmitterSample(ds, hit, emitter, counts & (ds.pdf > 0), bound, self.others is None)

    def by_chance(self, drawn, pdf, delta):
        """Bound of what one path may gain at a reflection, per throughput after it, from a source
        that other paths have not met [W m^-2 sr^-1].

        pdf: density of the reflected direction [1/sr]; delta: whether it has none.

        A source of radiance L adds at most L mis(pdf, drawn) where the reflected ray hits it, and
        at most L mis(drawn, pdf) pdf / drawn where it was drawn. With the power heuristic and
        r = pdf / drawn that is L (r^2 + r) / (1 + r^2). Over a diffuse floor r is small, and the
        sum is about the radiance that floor would reflect if the source were in sight. In a narrow
        lobe r is large, and the sum is L. A mirror sees sources by chance alone, the brightest too.
        The emitter that was drawn stands for all; `bound` is its radiance, or its irradiance if it
        is a point or a beam.
        """
        r = dr.minimum(pdf / drawn.ds.pdf, 1e6)
        share = dr.select(drawn.ds.delta, r, (r + 1) * r / (dr.square(r) + 1))
        return dr.select(delta, self.opaque_brightest, drawn.bound * share)

    def pdf(self, scene, start, si, emitter, active):
        """Density with which `sample` draws the direction in which `si` was hit, as seen from where
        the ray started [1/sr].
        """
        density = mi.Float(0)
        known = mi.Bool(False)
        if self.triangles is not None:
            triangle, known = self.triangles.find(si.shape, si.prim_index, active & si.is_valid())
            density = solid_angle_density(
                dr.gather(mi.Float, self.density, triangle, known),
                si.t,
                si.to_world(si.wi),
                si.n,
            )
        if self.others is not None:
            before = dr.zeros(mi.Interaction3f)
            before.p = start
            ds = mi.DirectionSample3f(scene, si, before)
            other = emitter.pdf_direction(before, ds, active & ~known)
            # every other emitter has the same probability, the last one's
            last = dr.width(self.probability) - 1
            probability = dr.gather(mi.Float, self.probability, mi.UInt32(last), active)
            density = dr.select(known, density, other * probability)
        return density


def solid_angle_density(per_area, distance, direction, normal):
    """What a density per area [1/m^2] is per solid angle [1/sr]."""
    return per_area * dr.square(distance) / dr.maximum(dr.abs_dot(direction, normal), 1e-20)


def hulls(shape) -> np.ndarray:
    """Corners (sets, points, 3) [m] of each triangle of a mesh, or of another shape's bounding
    box.
    """
    if is_faceted(shape):
        return np.stack(triangle_corners(shape), axis=1).astype(np.float64)
    box = shape.bbox()
    return np.array([[np.ravel(box.corner(k)) for k in range(8)]], dtype=np.float64)


def describe(emitter) -> str:
    """An emitter in a message: its kind and the shape that it belongs to."""
    kind = emitter.class_name() if type(emitter) is mi.Emitter else type(emitter).__name__
    shape = emitter.get_shape()
    return kind + (f" of shape '{shape.id()}'" if shape and shape.id() else "")

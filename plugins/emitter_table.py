"""What emits in a scene: labels, and a mixture of facets and other emitters to draw directions
from.
"""

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.plugins.sources import OTHER, Sources
from mi_lcair.plugins.triangles import Facets, is_faceted, pointer_id

OFFSET = 64 * 2.0**-24  # of the scene's extent: above the rounding of a hit's position


@dataclass
class EmitterSample:
    """A direction toward an emitter: ds.pdf [1/sr], the first hit along it, and whether that is
    what was drawn.
    """

    ds: mi.DirectionSample3f
    hit: mi.SurfaceInteraction3f
    emitter: mi.EmitterPtr
    counts: mi.Bool
    all_surfaces: bool

    def radiance(self, si):
        """What the emitter sends back toward `si`, with derivatives [W m^-2 sr^-1]."""
        if self.all_surfaces:
            return self.emitter.eval(self.hit, self.counts)
        hit = self.counts & mi.has_flag(self.emitter.flags(), mi.EmitterFlags.Surface)
        return self.emitter.eval(self.hit, hit) + self.emitter.eval_direction(
            si, self.ds, self.counts & ~hit
        )


def source(emitter):
    """Blackbody or given radiance of a thermal emitter, one value or one per facet; None for a
    texture.
    """
    return emitter.derived if emitter.radiance is None else emitter.radiance


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
    `sources`: what emission is told apart by. `sample` and `pdf` mix the facets of thermal meshes,
    drawn by area times blackbody radiance, with every other emitter, drawn evenly.
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

        meshes = [
            emitter
            for emitter in thermal
            if is_faceted(emitter.get_shape()) and source(emitter) is not None
        ]
        weights = [dr.detach(source(emitter)).numpy() for emitter in meshes]
        emitting = sampling and sum(float(weight.sum()) for weight in weights) > 0
        self.facets = (
            Facets([emitter.get_shape() for emitter in meshes], weights) if emitting else None
        )
        known = [source(emitter) for emitter in thermal if source(emitter) is not None]
        # what a path may bring unannounced; the radiance of the brightest thermal source, 0 where
        # sources are drawn
        self.brightest = (
            0.0
            if sampling or not known
            else max(float(dr.max(dr.detach(values))[0]) for values in known)
        )
        others = [
            emitter for emitter in emitters if sampling and (emitter not in meshes or not emitting)
        ]
        self.other_count = len(others)
        self.others = (
            mi.UInt32([pointer_id(mi.EmitterPtr(emitter)) for emitter in others])
            if others
            else None
        )
        self.facet_share = 0.0 if not emitting else 1.0 if not others else 0.5
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

        A sample counts only if the first hit is what was drawn; otherwise emitters that overlap or
        hide each other would be counted in each other's place.
        """
        ds = dr.zeros(mi.DirectionSample3f)
        from_facets = active & (sample1 < self.facet_share)
        from_others = active & ~from_facets
        if self.facets:
            facet, _, ds.p, ds.n, density = self.facets.sample(sample2, from_facets)
            # from where the ray will start: aimed from si.p it would pass the point at the height
            # of the ray's offset, and miss what is within that distance of a facet's edge
            ds.d = ds.p - self.leave(si, ds.p - si.p)
            ds.dist = dr.norm(ds.d)
            ds.d /= ds.dist
            ds.pdf = (
                self.facet_share
                * density
                * dr.square(ds.dist)
                / dr.maximum(dr.abs_dot(ds.d, ds.n), 1e-20)
            )
        if self.others is not None:
            reused = (sample1 - self.facet_share) / (1 - self.facet_share)
            index = dr.minimum(mi.UInt32(reused * self.other_count), self.other_count - 1)
            other = dr.reinterpret_array(
                mi.EmitterPtr, dr.gather(mi.UInt32, self.others, index, from_others)
            )
            ds_other, _ = other.sample_direction(si, sample2, from_others)
            ds_other.pdf *= (1 - self.facet_share) / self.other_count
            ds = dr.select(from_facets, ds, ds_other)

        hit = scene.ray_intersect(self.spawn_ray(si, ds.d), active)
        emitter, counts = hit.emitter(scene, active), mi.Bool(False)
        if self.facets:
            found, known = self.facets.find(hit.shape, hit.prim_index, from_facets & hit.is_valid())
            counts = known & (found == facet)
        if self.others is not None:
            on_surface = mi.has_flag(other.flags(), mi.EmitterFlags.Surface)
            at_point = (emitter == other) & (dr.abs(hit.t - ds.dist) < 1e-3 * ds.dist)
            nothing_before = ~hit.is_valid() | (hit.t > ds.dist * (1 - 1e-4))
            counts |= from_others & dr.select(on_surface, at_point, nothing_before)
            emitter = dr.select(from_facets, emitter, other)
        return EmitterSample(ds, hit, emitter, counts & (ds.pdf > 0), self.others is None)

    def pdf(self, scene, p_before, si, emitter, active):
        """Density with which `sample` at `p_before` draws the direction in which `si` was hit
        [1/sr].
        """
        density = mi.Float(0)
        known = mi.Bool(False)
        if self.facets:
            facet, known = self.facets.find(si.shape, si.prim_index, active & si.is_valid())
            per_area = dr.gather(mi.Float, self.facets.density, facet, known)
            density = (
                self.facet_share
                * per_area
                * dr.square(si.t)
                / dr.maximum(dr.abs(dr.dot(si.n, si.to_world(si.wi))), 1e-20)
            )
        if self.others is not None:
            before = dr.zeros(mi.Interaction3f)
            before.p = p_before
            ds = mi.DirectionSample3f(scene, si, before)
            other = emitter.pdf_direction(before, ds, active & ~known)
            density = dr.select(known, density, other * (1 - self.facet_share) / self.other_count)
        return density

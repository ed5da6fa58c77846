"""Recorder of what the first ray of a path hits."""

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi

from mi_lcair.plugins.emission.emitter_table import EmitterTable
from mi_lcair.plugins.recorders.recorder import Recorder


@dataclass
class FirstHit(Recorder):
    """The first hit of each path.

    facets: numbering of facets with the method `number(shape, prim_index, active)`; None: facets
    are not numbered. model_only: whether only paths that first hit the model are followed. range:
    distance [m], 0 if nothing is hit. seen: number of the group's label. of_model: 1 if the hit
    belongs to the model, 0 if to the background. facet: its number. transmittance: of all that the
    ray passes, 0 if anything is behind it, also a sky.

    Its channels are seen.LABEL, hit and range; with `model_only` the last two. `hit` is the share
    of what is behind the scene that the path hides, and `range` is weighted with it.
    """

    scene: mi.Scene
    emitters: EmitterTable
    facets: Any
    model_only: bool
    range: mi.Float
    seen: mi.UInt32
    of_model: mi.Float
    facet: mi.UInt32
    transmittance: mi.Float

    @staticmethod
    def of(scene, emitters: EmitterTable, facets=None, model_only: bool = False) -> "FirstHit":
        nothing = mi.Float(0), mi.UInt32(0), mi.Float(0), mi.UInt32(0), mi.Float(0)
        return FirstHit(scene, emitters, facets, model_only, *nothing)

    def begin(self, first, ray, active) -> mi.Bool:
        """Note the first hit.

        A facet is hit where its surface reflects and emits. A ray that passes between two triangles
        of an outline hits the back of a one-sided surface, which is no view of that facet.
        """
        needed = mi.RayFlags.Minimal if self.facets is None else mi.RayFlags.ShadingFrame
        si = first.compute_surface_interaction(ray, needed, active)
        emitter, hit = si.emitter(self.scene, active), si.is_valid()
        self.range = dr.select(hit, si.t, 0)
        self.seen = self.emitters.label(emitter, ray.d)
        self.of_model = dr.select(hit & self.emitters.is_model(emitter), mi.Float(1), 0)
        if self.facets is not None:
            flags = si.bsdf().flags()
            faces = dr.select(
                si.wi.z > 0,
                mi.has_flag(flags, mi.BSDFFlags.FrontSide),
                mi.has_flag(flags, mi.BSDFFlags.BackSide),
            )
            self.facet = self.facets.number(si.shape, si.prim_index, hit & faces)
        return active & (self.of_model > 0) if self.model_only else active

    def escape(self, active, throughput):
        self.transmittance = dr.select(active, throughput, self.transmittance)

    def samples(self, L) -> dict:
        hit = dr.select(self.range > 0, 1 - self.transmittance, 0)
        channels = {"hit": hit, "range": hit * self.range}
        if self.model_only:
            return channels
        labels = enumerate(self.emitters.labels)
        return channels | {f"seen.{label}": dr.select(self.seen == k, L, 0) for k, label in labels}

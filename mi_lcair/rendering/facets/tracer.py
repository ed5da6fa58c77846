"""Steps from facet to facet, for paths that the walk cannot follow.

The walk follows light from the observer, in the band of the scene, and sums radiance. Heat exchange
needs the scene's surfaces in other bands, and notes every facet that absorbs. The energy audit
follows light forward, with the two directions of a BRDF swapped, and splits the flux at each hit.
"""

from collections.abc import Callable
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.plugins.emission.emissivity import SIDES, reflects
from mi_lcair.plugins.emission.triangles import pointer_id
from mi_lcair.plugins.paths.offsets import Offsets
from mi_lcair.rendering.facets.table import FacetTable


@dataclass(frozen=True, eq=False)
class Surface:
    """A BSDF and its emissivity; equal BSDFs of a scene share one.

    emissivity: a function of an interaction and of `active`. mode: Radiance for paths against the
    light, Importance for paths with it.
    """

    bsdf: mi.BSDF
    emissivity: Callable[..., mi.Float]
    mode: mi.TransportMode = mi.TransportMode.Radiance

    @property
    def sides(self) -> tuple[int, ...]:
        """The sides that emit: 1 in front, -1 behind."""
        return tuple(side for side, flag in SIDES if self.bsdf.flags() & int(flag))

    def respond(self, si, u, v, active):
        """What `FacetTracer.respond` returns, for hits of this surface."""
        bs, weight = self.bsdf.sample(mi.BSDFContext(self.mode), si, u, v, active)
        has_side = reflects(int(self.bsdf.flags()), si.wi.z)
        return has_side, mi.Float(self.emissivity(si, active)), bs.wo, weight[0]


class FacetTracer:
    """Traces rays through a scene, step by step.

    table: the facets of the scene. surfaces: the different surfaces. of_shape: index of the surface
    of each shape.
    """

    def __init__(self, scene, table: FacetTable, surfaces: list[Surface], of_shape: list[int]):
        self.scene, self.table, self.surfaces = scene.mi, table, surfaces
        self.name, self.offsets = scene.name, Offsets(scene.mi)
        self.ids = [pointer_id(mi.ShapePtr(shape)) for shape in scene.mi.shapes()]
        of_pointer = np.zeros(max(self.ids) + 1, dtype=np.uint32)
        of_pointer[self.ids] = of_shape
        self.surface_of = mi.UInt32(of_pointer)
        dr.eval(self.surface_of)

    def meet(self, ray, active=True) -> tuple[mi.SurfaceInteraction3f, mi.UInt32]:
        """What rays hit, and the number of its facet; ABSENT (2^32 - 1) if there is no hit."""
        pi = self.scene.ray_intersect_preliminary(ray, coherent=False, active=active)
        si = pi.compute_surface_interaction(ray, mi.RayFlags.All, active)
        return si, self.table.number(si.shape, si.prim_index, si.is_valid())

    def respond(self, si, active, u=0.5, v=0.5):
        """Emissivity of the surfaces at hits toward `si.wi`, and a direction with its weight.

        Before them comes whether the surface has this side. u, v: random numbers for the direction,
        in which the path goes on.
        """
        targets = [surface.respond for surface in self.surfaces]
        arguments = si, mi.Float(u), mi.Point2f(v), active
        if len(targets) == 1:
            return targets[0](*arguments)
        pointer = dr.reinterpret_array(mi.UInt32, si.shape)
        surface = dr.gather(mi.UInt32, self.surface_of, pointer, active)
        return dr.switch(surface, targets, *arguments)

    def leave(self, si, d) -> mi.Ray3f:
        """The ray that leaves a surface in a direction of the world."""
        return mi.Ray3f(self.offsets.leave(si, d), d)

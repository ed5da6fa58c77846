"""Recorder of the triangles that a path meets, for derivatives with respect to their vertices."""

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.plugins.emission.triangles import PrimitiveTable
from mi_lcair.plugins.paths.launch import Launch, ParallelRays
from mi_lcair.plugins.recorders.recorder import Emission, Recorder, Recorders, Store

PASSED = 8  # further triangles of a path that are kept in a scene with surfaces that rays pass


@dataclass
class MetTriangles(Recorder):
    """Triangles that each path meets: with its rays, and with those toward drawn emitters.

    count: number of hits of each path so far. store: the triangles.
    """

    count: mi.UInt32
    store: Store

    def note(self, hit) -> None:
        """Note the triangle of a hit, an interaction of any kind."""
        store = self.store
        number = store.table.at(hit.shape, hit.prim_index, hit.is_valid())
        store.note(self.count, self.count < store.slots, number=number)
        self.count += 1

    def begin(self, first, ray, active) -> mi.Bool:
        self.note(first)
        return active

    def emission(self, emission: Emission) -> None:
        if emission.toward is not None:
            self.note(emission.toward)
        elif emission.hit is not None:
            self.note(emission.hit)


def met_triangles(tracer, sensor, launch: Launch, triangles: PrimitiveTable) -> tuple:
    """Trace the paths of a launch that begins on facets, see `FacetStarts`.

    Call it inside the context `BouncePath.prepared`. triangles: their numbers, from 1 on, and 0 for
    everything else.

    Returns
    -------
    L : ndarray, shape (paths,)
        Radiance of each path; 0 if it does not see the triangle on which it began, or NaN
        [W m^-2 sr^-1].
    start : ndarray, shape (paths,)
        That triangle.
    met : ndarray, shape (paths, slots)
        Triangles that it meets, -1 for what is no triangle of these meshes.
    """
    hits = 2 + tracer.max_bounces * (1 + len(tracer.emitters.tables))
    slots = 1 + hits + (PASSED if tracer.emitters.passes else 0)
    with dr.suspend_grad():
        paths = launch.paths_from(sensor.sampler())
        store = Store(triangles, paths.lane, slots, number=(mi.UInt32, 0))
        met, rays = MetTriangles(mi.UInt32(0), store), ParallelRays.of(sensor) or sensor
        L, _, weight, facet = tracer.follow(paths, rays, lambda cell: Recorders([met]))
        start, L = triangles.at(facet.shape, facet.primitive), dr.select(weight > 0, L, 0)
        # One kernel traces the paths and fills the store
        dr.eval(L, start, store.arrays)
    (met,) = store.of_paths()
    # The number of the only triangle of a scene is a constant of the kernel
    start = np.broadcast_to(start.numpy().astype(np.int64) - 1, launch.paths)
    return L.numpy().astype(float), start, met.astype(np.int64) - 1

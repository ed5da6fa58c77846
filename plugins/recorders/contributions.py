"""Recorder of the radiance by the facet that emitted it, for a matrix of facet radiances."""

from contextlib import contextmanager
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.plugins.emission.triangles import ABSENT, PrimitiveTable, pointer_id
from mi_lcair.plugins.paths.launch import Launch, ParallelRays
from mi_lcair.plugins.recorders.first_hit import FirstHit
from mi_lcair.plugins.recorders.recorder import Emission, Recorder, Recorders, Store


def column_table(emitters, columns) -> PrimitiveTable:
    """Table that finds the column of a hit: the number of the facet that emits there.

    emitters: the emitters whose facets have columns. columns: for each of them the columns of the
    primitives of its shape, (primitives,) UInt32; ABSENT for a primitive without a column.
    """
    return PrimitiveTable([pointer_id(mi.EmitterPtr(e)) for e in emitters], columns, ABSENT)


@dataclass
class ByFacet(Recorder):
    """Contributions of each path by the facet that emitted them.

    rest: radiance from everything that has no column [W m^-2 sr^-1]. count: number of contributions
    of each path so far. store: the contributions.
    """

    rest: mi.Float
    count: mi.UInt32
    store: Store

    def emission(self, emission: Emission) -> None:
        value = emission.radiance
        column = self.store.table.at(emission.emitter, emission.prim)
        has_column = (column != ABSENT) & ~emission.beyond
        self.rest += dr.select(has_column, 0, value)
        adds = has_column & (value != 0)
        self.store.note(self.count, adds, column=column, value=value)
        self.count += dr.select(adds, mi.UInt32(1), 0)


@dataclass(frozen=True)
class Contributions:
    """Contributions of the paths of a launch to columns, as NumPy arrays.

    path, column: the path and the column of each contribution, ordered by path, (n,). value:
    radiance for a blackbody radiance of 1, in Float64, (n,). rest: radiance of each path from
    everything without a column [W m^-2 sr^-1], (paths,). valid: whether a path's radiance is
    finite, (paths,). Invalid paths have no contributions, and their rest is 0.
    """

    path: np.ndarray
    column: np.ndarray
    value: np.ndarray
    rest: np.ndarray
    valid: np.ndarray


def slots(tracer) -> int:
    """Largest number of contributions of a path: one per vertex, and one per drawn emitter."""
    return 1 + tracer.max_bounces * (1 + len(tracer.emitters.tables))


def contributions(
    tracer, sensor, launch: Launch, table: PrimitiveTable, model_only: bool = False
) -> Contributions:
    """Trace the paths of a launch and record what each facet contributes.

    model_only: follow only the paths that first hit the model.

    Call it inside the context `BouncePath.prepared`, with `unit_radiance` for the emitters of
    `table`.

    Raises InputError for a scene with surfaces that rays pass, where a path may have more
    contributions than `slots`.
    """
    if tracer.emitters.passes:
        raise InputError(
            "a surface of BSDF plume with a transmittance > 0 has no contributions by facet; set "
            "its transmittance to 0"
        )
    with dr.suspend_grad():
        paths = launch.paths_from(sensor.sampler())
        kinds = {"column": (mi.UInt32, ABSENT), "value": (mi.Float, 0)}
        store = Store(table, paths.lane, slots(tracer), **kinds)
        parts = [FirstHit.of(tracer.scene, tracer.emitters, None, True)] if model_only else []
        parts.append(ByFacet(mi.Float(0), mi.UInt32(0), store))
        L, recorders, *_ = tracer.follow(
            paths, ParallelRays.of(sensor) or sensor, lambda cell: Recorders(parts)
        )
        rest = recorders.of(ByFacet).rest
        # One kernel traces the paths and fills the store
        dr.eval(L, rest, store.arrays)
    valid = np.isfinite(L.numpy()) & np.isfinite(rest.numpy())
    column, value = store.of_paths()
    path, slot = np.nonzero((column != ABSENT) & valid[:, None])
    return Contributions(
        path,
        column[path, slot].astype(np.int32),
        value[path, slot].astype(np.float64),
        np.where(valid, rest.numpy(), 0).astype(np.float64),
        valid,
    )


@contextmanager
def unit_radiance(emitters):
    """Context manager in which these emitters radiate as if their blackbody radiance were 1.

    A path's contribution is then the factor of the facet's blackbody radiance, also for a facet
    that is too cold to radiate. The tables of the tracer keep the emitters' own radiances.
    """
    kept = [emitter.derived for emitter in emitters]
    try:
        for emitter, derived in zip(emitters, kept):
            emitter.derived = dr.full(mi.Float, 1, dr.width(derived))
            dr.make_opaque(emitter.derived)
        yield
    finally:
        for emitter, derived in zip(emitters, kept):
            emitter.derived = derived

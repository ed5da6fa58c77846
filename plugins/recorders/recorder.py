"""What a recorder is: the events of a path of which the walk tells it, and what it gives.

A recorder is a dataclass, because Dr.Jit carries its arrays through the loop. A path calls its
methods in this order:

    begin     the first ray has hit something, or has escaped
    meet      the path is at a surface
    escape    the first ray passes surfaces, such as plumes, and meets nothing behind them
    emission  radiance reaches the sensor along the path, met by its ray or brought by a direction
              that was drawn toward an emitter
    reflect   the direction of the next ray is sampled
"""

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.plugins.emission.emitter_table import BinnedRadiance, DrawnDirection
from mi_lcair.plugins.emission.hot_parts import SeenParts
from mi_lcair.plugins.emission.triangles import PrimitiveTable


@dataclass(frozen=True)
class Emission:
    """Radiance that reaches the sensor along a path.

    radiance: part of the path's radiance [W m^-2 sr^-1]. bounce: number of its reflections. beyond:
    whether these are more than the walk follows, so that it belongs to the closure. emitter: what
    emitted it. parts: numbers of its parts that did, and their shares of the radiance. weight: the
    part of `radiance` per radiance of the emitting surface; 0 where no surface emits. hit: the
    emitting surface; None for the sun. drawn_to: the direction in which it was drawn from the
    surface where the path is, in that surface's frame; None if a ray met it. before: `radiance` of
    a drawn direction per value of the BSDF at that surface; None if a ray met it. latent: radiance
    along a latent path; None where nothing is explored, see `columns/tables.py`. by_bin: its parts
    by source and bin of wavelength; None in a scene without spectral materials. toward: what a ray
    in the drawn direction hits, the emitter or what hides it; None if a ray met it.
    """

    radiance: mi.Float
    bounce: mi.UInt32
    beyond: mi.Bool
    emitter: mi.EmitterPtr
    parts: list[tuple[mi.UInt32, mi.Float]]
    weight: mi.Float
    hit: mi.SurfaceInteraction3f | None
    drawn_to: mi.Vector3f | None = None
    before: mi.Float | None = None
    latent: mi.Float | None = None
    by_bin: BinnedRadiance | None = None
    toward: mi.PreliminaryIntersection3f | None = None

    @property
    def prim(self) -> mi.UInt32:
        """The primitive of a surface that emitted it."""
        return self.parts[0][0]


@dataclass(frozen=True)
class Reflection:
    """A sampled direction.

    bsdf: the surface. bounce: number of reflections before. throughput: that before. weight: BSDF
    times cosine divided by the density. to: the direction, in the surface's frame. pdf: its density
    [1/sr]. is_delta: whether it has none. drawn: the direction drawn toward an emitter; None if
    none are drawn. active: whether the path goes on from here. receives: whether it is reflected
    and then receives emission. becomes_latent: whether it becomes a latent path; None where nothing
    is explored, see `columns/tables.py`. mirrored: radiance that surfaces emit toward here along
    the mirror direction [W m^-2 sr^-1]; None unless a recorder needs it. seen: the hot parts as
    seen from here; None where rays are not guided.
    """

    bsdf: mi.BSDFPtr
    bounce: mi.UInt32
    throughput: mi.Float
    weight: mi.Float
    to: mi.Vector3f
    pdf: mi.Float
    is_delta: mi.Bool
    drawn: DrawnDirection | None
    active: mi.Bool
    receives: mi.Bool
    becomes_latent: mi.Bool | None
    mirrored: mi.Float | None
    seen: SeenParts | None = None


class Recorder:
    """Base class of recorders. A recorder overrides the events that it needs.

    needs_drawn_hit: whether the hit of a drawn direction must be known for every shape, not for
    meshes only. needs_mirrored: whether it needs `Reflection.mirrored`.
    """

    needs_drawn_hit = False
    needs_mirrored = False

    def begin(self, first: mi.PreliminaryIntersection3f, ray: mi.Ray3f, active) -> mi.Bool:
        """Note the first hit; returns the paths that are followed."""
        return active

    def meet(self, bsdf: mi.BSDFPtr, wi: mi.Vector3f) -> None:
        """Note the surface, seen from the direction `wi` in its frame."""

    def escape(self, active, throughput: mi.Float) -> None:
        """Note the first ray's throughput where it meets nothing, not even a sky."""

    def emission(self, emission: Emission) -> None:
        """Note radiance that reaches the sensor."""

    def reflect(self, reflection: Reflection) -> None:
        """Note a sampled direction."""

    def samples(self, L: mi.Float) -> dict:
        """What was recorded, by name: one value for each path. L: radiance [W m^-2 sr^-1]."""
        return {}


@dataclass
class Recorders:
    """Several recorders, of which each is told of each event."""

    parts: list

    @property
    def needs_drawn_hit(self) -> bool:
        return any(part.needs_drawn_hit for part in self.parts)

    @property
    def needs_mirrored(self) -> bool:
        return any(part.needs_mirrored for part in self.parts)

    def begin(self, first, ray, active) -> mi.Bool:
        for part in self.parts:
            active = part.begin(first, ray, active)
        return active

    def meet(self, bsdf, wi) -> None:
        for part in self.parts:
            part.meet(bsdf, wi)

    def escape(self, active, throughput) -> None:
        for part in self.parts:
            part.escape(active, throughput)

    def emission(self, emission: Emission) -> None:
        for part in self.parts:
            part.emission(emission)

    def reflect(self, reflection: Reflection) -> None:
        for part in self.parts:
            part.reflect(reflection)

    def samples(self, L) -> dict:
        return {name: value for part in self.parts for name, value in part.samples(L).items()}

    def of(self, kinds):
        """The recorder of a class, or of one of several classes; None if there is none."""
        return next((part for part in self.parts if isinstance(part, kinds)), None)

    def without(self, kinds) -> "Recorders":
        """The recorders that are not of these classes."""
        return Recorders([part for part in self.parts if not isinstance(part, kinds)])


# Sums that each path keeps for itself while it is followed


def zeros(count: int, Float: type | None = None) -> dr.Local | None:
    """A path's own array of zeros, of Mitsuba's floats or of another type; None for no entries."""
    Float = mi.Float if Float is None else Float
    return dr.alloc_local(Float, count, value=Float(0)) if count else None


def add_to(local: dr.Local, index: mi.UInt32, value: mi.Float) -> None:
    """Add a value to one entry of a path's own array."""
    local.write(local.read(index) + value, index)


def entries(local: dr.Local | None) -> list[mi.Float]:
    """All entries of a path's own array; none if it is None."""
    return [] if local is None else [local.read(mi.UInt32(k)) for k in range(len(local))]


class Store:
    """Numbers that the paths of a launch note, with `slots` entries of each kind for each path.

    It is no PyTree, because the loop must not carry arrays that are longer than the number of
    paths. table: the numbers of primitives. empty: for each kind its array type and the number that
    stands for no entry.
    """

    def __init__(self, table: PrimitiveTable, lane: mi.UInt32, slots: int, **empty):
        self.table, self.lane, self.slots = table, lane, dr.opaque(mi.UInt32, slots)
        size = dr.width(lane) * slots
        self.arrays = {name: dr.full(kind, none, size) for name, (kind, none) in empty.items()}
        dr.make_opaque(self.arrays)

    def note(self, slot: mi.UInt32, active: mi.Bool, **numbers) -> None:
        """Write numbers of each kind into a slot of each path."""
        for name, number in numbers.items():
            dr.scatter(self.arrays[name], number, self.lane * self.slots + slot, active)

    def of_paths(self) -> list[np.ndarray]:
        """The arrays of all kinds, (paths, slots)."""
        paths = dr.width(self.lane)
        return [array.numpy().reshape(paths, -1) for array in self.arrays.values()]

"""Recorder of the radiance by number of reflections."""

from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.plugins.emission.emitter_table import EmitterTable
from mi_lcair.plugins.emission.hot_parts import BRIGHT
from mi_lcair.plugins.emission.sources import WAVELENGTHS, Sources
from mi_lcair.plugins.emission.triangles import ABSENT, PrimitiveTable, pointer_id
from mi_lcair.plugins.paths.launch import Launch, ParallelRays
from mi_lcair.plugins.recorders import recorder

BOUNCE_CHANNELS = 17  # bounce channels in images and tables; the last holds all counts from 16 on
MAX_BOUNCE_CHANNELS = 65  # the last one holds every bounce count from 64 on
# Numbers of bounce channels that are recorded. There are few, because each needs its own kernel.
SIZES = (6, 17, 33, MAX_BOUNCE_CHANNELS)


@dataclass
class ByBounce(recorder.Recorder):
    """Radiance by number of reflections, and what the closure adds [W m^-2 sr^-1].

    Its channels are bounce.N and closure. The last number holds more reflections too.
    """

    sums: dr.Local
    closure: mi.Float

    @staticmethod
    def up_to(max_bounces: int) -> "ByBounce":
        size = next(size for size in SIZES if size > min(max_bounces, SIZES[-1] - 1))
        return ByBounce(recorder.zeros(size), mi.Float(0))

    def emission(self, emission: recorder.Emission) -> None:
        radiance, beyond = emission.radiance, emission.beyond
        self.closure += dr.select(beyond, radiance, 0)
        place = dr.minimum(emission.bounce, len(self.sums) - 1)
        recorder.add_to(self.sums, place, dr.select(beyond, 0, radiance))

    def entries(self) -> list[mi.Float]:
        """Radiance after 0, 1, ... reflections of each path [W m^-2 sr^-1]."""
        return recorder.entries(self.sums)

    def samples(self, L) -> dict:
        channels = {f"bounce.{k}": value for k, value in enumerate(self.entries())}
        return channels | {"closure": self.closure}


# Recorder of the radiance by what emitted it
# -------------------------------------------


@dataclass
class BySource(recorder.Recorder):
    """Radiance by source [W m^-2 sr^-1].

    by_wavelength: radiance from blackbodies at the wavelengths of `Sources` [W m^-2 sr^-1 um^-1],
    where there are too many blackbodies to record each separately. labels: the groups. most: the
    largest number of reflections that counts; None: all count. Its channels are group.LABEL and,
    in a tracer with sources by spectrum, source.N and wavelength.N. They begin with the prefix
    `up_to_prefix`.
    """

    sources: Sources
    labels: list
    sums: dr.Local
    by_wavelength: list
    most: int | None = None

    @staticmethod
    def of(sources: Sources, labels: list, most: int | None = None) -> "BySource":
        count = 0 if sources.share is None else WAVELENGTHS
        wavelengths, sums = (
            [mi.Float(0) for _ in range(count)],
            recorder.zeros(len(sources.recorded)),
        )
        return BySource(sources, labels, sums, wavelengths, most)

    def emission(self, emission: recorder.Emission) -> None:
        value = dr.select(emission.beyond, 0, emission.radiance)
        if self.most is not None:
            value = dr.select(emission.bounce <= self.most, value, 0)
        for part, share_of_part in emission.parts:
            entry, of_part = self.sources.entry(emission.emitter, part), value * share_of_part
            recorder.add_to(self.sums, self.sources.number(entry), of_part)
            if self.by_wavelength:
                for k, share in enumerate(self.sources.shares(entry)):
                    self.by_wavelength[k] += of_part * share

    def samples(self, L) -> dict:
        groups = {label: mi.Float(0) for label in self.labels}
        by_source = recorder.entries(self.sums)
        for source, value in zip(self.sources.recorded, by_source):
            groups[source.group] += value
        channels = {f"group.{label}": value for label, value in groups.items()}
        if self.sources.by_spectrum and not self.sources.by_bin:
            channels |= {f"source.{k}": value for k, value in enumerate(by_source)}
        channels |= {f"wavelength.{k}": value for k, value in enumerate(self.by_wavelength)}
        return {f"{up_to_prefix(self.most)}{name}": value for name, value in channels.items()}


def up_to_prefix(most: int | None) -> str:
    """Beginning of the names of channels of at most so many reflections; "" for all."""
    return "" if most is None else f"upto.{most}."


# Recorder of what the first ray of a path hits
# ---------------------------------------------


@dataclass
class FirstHit(recorder.Recorder):
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


@dataclass
class FirstEmission(recorder.Recorder):
    """Radiance that the first surface of each path emits toward the observer [W m^-2 sr^-1].

    is_first: whether the path is still there.
    """

    radiance: mi.Float
    is_first: mi.Bool

    def emission(self, emission: recorder.Emission) -> None:
        self.radiance = dr.select(self.is_first, emission.radiance, self.radiance)
        self.is_first = mi.Bool(False)


# Recorder of the radiance by the facet that emitted it, for a matrix of facet radiances
# --------------------------------------------------------------------------------------


def column_table(emitters, columns) -> PrimitiveTable:
    """Table that finds the column of a hit: the number of the facet that emits there.

    emitters: the emitters whose facets have columns. columns: for each of them the columns of the
    primitives of its shape, (primitives,) UInt32; ABSENT for a primitive without a column.
    """
    return PrimitiveTable([pointer_id(mi.EmitterPtr(e)) for e in emitters], columns, ABSENT)


@dataclass
class ByFacet(recorder.Recorder):
    """Contributions of each path by the facet that emitted them.

    rest: radiance from everything that has no column [W m^-2 sr^-1]. count: number of contributions
    of each path so far. store: the contributions.
    """

    rest: mi.Float
    count: mi.UInt32
    store: recorder.Store

    def emission(self, emission: recorder.Emission) -> None:
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
        store = recorder.Store(table, paths.lane, slots(tracer), **kinds)
        parts = [FirstHit.of(tracer.scene, tracer.emitters, None, True)] if model_only else []
        parts.append(ByFacet(mi.Float(0), mi.UInt32(0), store))
        L, recorders, *_ = tracer.follow(
            paths, ParallelRays.of(sensor) or sensor, lambda cell: recorder.Recorders(parts)
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


# Recorder of the number of rays of a path
# ----------------------------------------


@dataclass
class Segments(recorder.Recorder):
    """Number of rays of each path, as the channel `segments`.

    Rays toward drawn emitters are not counted.
    """

    count: mi.Float

    def meet(self, bsdf, wi) -> None:
        self.count += 1

    def samples(self, L) -> dict:
        # The first ray of a path that is not followed was traced too
        return {"segments": dr.maximum(self.count, 1)}


# Recorder of what a source would add that no path has hit, for the error of a radiance
# -------------------------------------------------------------------------------------

# Names of what is added up over paths, and of that of which the largest value counts
SUMMED = "draws", "squares", "chances", "chance_squares", "potential", "potential_squares"
LARGEST = "largest", "darker"


@dataclass
class UnmetSource(recorder.Recorder):
    """What a source would add that a path could have hit after a reflection.

    The scatter of the paths' radiance cannot see a source that none of them has hit. Where emitters
    are drawn, `EmitterTable.by_chance` bounds what one such hit would add.

    draws: number of reflections, at which directions toward emitters may be drawn, each times the
    throughput. squares: the same with the squared throughput. chances: chances of meeting one of
    the `HotParts`, each times the throughput; None where rays are not guided. chance_squares: the
    same times the throughput of a hit. The others are None where nothing is drawn. potential,
    potential_squares: sums of the bounds of sources that are at least BRIGHT, and of their squares,
    in parts of the radiance of the brightest source. largest: largest bound [W m^-2 sr^-1]. darker:
    that of other sources.
    """

    emitters: EmitterTable
    draws: mi.Float
    squares: mi.Float
    chances: mi.Float | None
    chance_squares: mi.Float | None
    potential: mi.Float | None
    potential_squares: mi.Float | None
    largest: mi.Float | None
    darker: mi.Float | None

    @staticmethod
    def of(emitters: EmitterTable, guides: bool = False) -> "UnmetSource":
        # Dr.Jit may fail on a loop with variables that never change
        drawn = [mi.Float(0) if emitters.draws else None for _ in range(4)]
        chances = [mi.Float(0) if guides else None for _ in range(2)]
        return UnmetSource(emitters, mi.Float(0), mi.Float(0), *chances, *drawn)

    def reflect(self, reflection: recorder.Reflection) -> None:
        if reflection.seen is not None:
            before = dr.select(reflection.receives, reflection.throughput, 0)
            chance = before * reflection.seen.chance
            self.chances += chance
            self.chance_squares += before * chance * reflection.seen.weight_of_hit
        receives = reflection.receives & (reflection.weight != 0)
        throughput = dr.select(receives, reflection.throughput * reflection.weight, 0)
        self.draws += throughput
        self.squares += dr.square(throughput)
        if reflection.drawn is not None:
            bound = self.emitters.by_chance(reflection.drawn, reflection.pdf, reflection.is_delta)
            bound = dr.select(throughput > 0, throughput * bound, 0)  # NaN beside no draw
            brightest = self.emitters.opaque_brightest
            is_bright = reflection.is_delta | (reflection.drawn.bound >= BRIGHT * brightest)
            part = dr.select(is_bright & (brightest > 0), bound / brightest, 0)
            self.potential += part
            self.potential_squares += dr.square(part)
            self.largest = dr.maximum(self.largest, bound)
            self.darker = dr.maximum(self.darker, dr.select(is_bright, 0, bound))

    def of_paths(self, weight) -> tuple[dict[str, mi.Float], dict[str, mi.Float]]:
        """What paths with these weights contribute by name: what is added up, and the rest."""
        noted = {name: value for name, value in vars(self).items() if name in SUMMED + LARGEST}
        noted = {
            name: value * (dr.square(weight) if "squares" in name else weight)
            for name, value in noted.items()
            if value is not None
        }
        summed = {name: noted.pop(name) for name in SUMMED if name in noted}
        return summed, noted


def in_all_windows(sums: dict[str, np.ndarray]) -> dict[str, float]:
    """What windows have noted, taken together; `sums` by name."""
    noted = {name: sums.get(name, np.zeros(1)) for name in SUMMED + LARGEST}
    return {name: np.sum(v) if name in SUMMED else np.max(v) for name, v in noted.items()}

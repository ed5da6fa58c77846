"""Channels that `bounce_path` records beside the radiance, and statistics of its pixels."""

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from mi_lcair.plugins.emission.sources import WAVELENGTHS, Sources
from mi_lcair.plugins.paths.tail import COUNTS, Tail, add_tail

MAX_BOUNCE_CHANNELS = 65  # the last one holds every bounce count from 64 on
# Numbers of bounce channels that are recorded. There are few, because each needs its own kernel.
SIZES = (6, 17, 33, MAX_BOUNCE_CHANNELS)


@dataclass
class Channels:
    """Radiance of each sample by bounce count and by source, and properties of the first hit.

    by_bounce, by_source: radiance by number of reflections and by source [W m^-2 sr^-1].
    by_wavelength: radiance from blackbodies at the wavelengths of `Sources` [W m^-2 sr^-1 um^-1],
    recorded where there are too many blackbodies to record each separately. last: radiance after
    the last COUNTS numbers of reflections, for the geometric tail. closure: radiance that the
    closure adds. range: distance of the first hit [m], 0 if there is none. seen: index of its
    group's label. of_model: 1 if it belongs to the model, 0 if to the background. facet: its
    number. model_only: whether paths are followed only if they first hit the model. segments:
    number of rays of each path; None if they are not counted.
    """

    by_bounce: dr.Local
    by_source: dr.Local
    by_wavelength: list
    last: dr.Local
    closure: mi.Float | None = None
    range: mi.Float | None = None
    seen: mi.UInt32 | None = None
    of_model: mi.Float | None = None
    facet: mi.UInt32 | None = None
    model_only: bool = False
    segments: mi.Float | None = None

    @staticmethod
    def empty(
        max_bounces: int,
        closure: str,
        sources: Sources | None,
        model_only: bool = False,
        count_segments: bool = False,
    ) -> "Channels":
        """Channels of value 0; `sources` None records only what the closure needs."""
        zeros = lambda count: dr.alloc_local(mi.Float, count, value=mi.Float(0)) if count else None
        return Channels(
            zeros(next(size for size in SIZES if size > min(max_bounces, SIZES[-1] - 1))),
            zeros(len(sources.list) if sources else 0),
            [
                mi.Float(0)
                for _ in range(WAVELENGTHS if sources and sources.share is not None else 0)
            ],
            zeros(COUNTS if closure == "tail" else 0),
            mi.Float(0),
            mi.Float(0),
            mi.UInt32(0),
            mi.Float(0),
            mi.UInt32(0),
            model_only,
            mi.Float(0) if count_segments else None,
        )

    def meet(self, first, emitters, emitter, facets):
        """Record the first hit of each path.

        A facet is hit where its surface reflects and emits. A ray that passes between two triangles
        of an outline hits the back of a one-sided surface, which is no view of that facet.

        Parameters
        ----------
        first : mi.SurfaceInteraction3f
            With its shading frame if facets are numbered.
        emitters : EmitterTable
        emitter : mi.EmitterPtr
            The emitter at the first hit.
        facets : object or None
            Numbering of facets, see `PathTracer.trace`.
        """
        hit = first.is_valid()
        self.range = dr.select(hit, first.t, 0)
        self.seen = emitters.label(emitter)
        self.of_model = dr.select(hit & emitters.is_model(emitter), mi.Float(1), 0)
        if facets is not None:
            flags = first.bsdf().flags()
            faces = dr.select(
                first.wi.z > 0,
                mi.has_flag(flags, mi.BSDFFlags.FrontSide),
                mi.has_flag(flags, mi.BSDFFlags.BackSide),
            )
            self.facet = facets.number(first.shape, first.prim_index, hit & faces)

    def add(self, value, bounce, sources: Sources, emitter, prim_index, max_bounces):
        """Add radiance to the channels.

        Parameters
        ----------
        value : mi.Float
            Radiance [W m^-2 sr^-1].
        bounce : mi.UInt32
            Number of reflections after its emission.
        sources : Sources or None
        emitter : mi.EmitterPtr
        prim_index : mi.UInt32
            The primitive of the emitter's shape that emitted the radiance.
        max_bounces : mi.UInt32
            Radiance with more reflections belongs to the closure.
        """
        beyond = bounce > max_bounces
        self.closure += dr.select(beyond, value, 0)
        value = dr.select(beyond, 0, value)
        add_to(self.by_bounce, dr.minimum(bounce, len(self.by_bounce) - 1), value)
        if self.by_source is not None or self.by_wavelength:
            entry = sources.entry(emitter, prim_index)
        if self.by_source is not None:
            add_to(self.by_source, sources.number(entry), value)
        if self.by_wavelength:
            for k, share in enumerate(sources.shares(entry)):
                self.by_wavelength[k] += value * share
        if self.last is not None:
            place = mi.Int32(bounce) + (COUNTS - 1) - mi.Int32(max_bounces)
            add_to(self.last, mi.UInt32(dr.maximum(place, 0)), dr.select(place >= 0, value, 0))

    def samples(self, L, labels: list[str], sources: Sources, of_model: bool) -> dict:
        """All channels by name.

        The names are bounce.N, closure, group.LABEL, seen.LABEL, range, hit (1 or 0), segments (if
        they were counted) and target (the radiance of paths that first hit the model). With
        `model_only` every channel holds only the part of those paths.

        Parameters
        ----------
        L : mi.Float
            Radiance of each sample [W m^-2 sr^-1].
        labels : list of str
        sources : Sources
        of_model : bool
            Add source.N and wavelength.N where they were recorded, as with `model_only`. Add also,
            for each channel, the channel "target.NAME" with the part of paths that first hit the
            model.

        Returns
        -------
        dict
            One value per sample for each name.
        """
        groups = {label: mi.Float(0) for label in labels}
        by_source = entries(self.by_source)
        for source, value in zip(sources.list, by_source):
            groups[source.group] += value
        found = {f"bounce.{k}": value for k, value in enumerate(entries(self.by_bounce))}
        found["closure"] = self.closure
        found |= {f"group.{label}": value for label, value in groups.items()}
        found |= {
            f"seen.{label}": dr.select(self.seen == k, L, 0) for k, label in enumerate(labels)
        }
        if of_model or self.model_only:
            if sources.by_spectrum:
                found |= {f"source.{k}": value for k, value in enumerate(by_source)}
            found |= {f"wavelength.{k}": value for k, value in enumerate(self.by_wavelength)}
        if self.segments is not None:
            found["segments"] = self.segments
        found |= {"range": self.range, "hit": dr.select(self.range > 0, mi.Float(1), 0)}
        if self.model_only or of_model:
            on_model = {name: value * self.of_model for name, value in found.items()}
            found = (
                on_model
                if self.model_only
                else found | {f"target.{name}": value for name, value in on_model.items()}
            )
        return found | {"target": L * self.of_model}

    def add_tail(self) -> tuple[mi.Float, Tail]:
        """Set the closure to the geometric tail; return it with the sums that give its error."""
        last = entries(self.last)
        dr.eval(last, self.of_model)
        self.closure, tail = add_tail(last, self.of_model)
        return self.closure, tail


def add_to(local: dr.Local, index: mi.UInt32, value: mi.Float) -> None:
    """Add a value to one entry of a path's own array."""
    local.write(local.read(index) + value, index)


def entries(local: dr.Local | None) -> list[mi.Float]:
    """All entries of a path's own array; none if it is None."""
    return [] if local is None else [local.read(mi.UInt32(k)) for k in range(len(local))]

"""What one pass of `bounce_path` records beside the radiance, and how samples become pixels."""

from dataclasses import dataclass, field
from math import gcd

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.plugins.emission.sources import WAVELENGTHS, Sources
from mi_lcair.plugins.paths.tail import COUNTS, Tail, add_tail

SUMMED_IN_FLOAT32 = 8
MAX_BOUNCE_CHANNELS = 65  # the last one holds every bounce count from 64 on


@dataclass
class Channels:
    """Radiance per sample, split by bounce count, by emitting source and by the group first seen [W
    m^-2 sr^-1].

    `by_wavelength`: what the blackbodies among them emit, at the nodes of `Sources` [W m^-2 sr^-1
    um^-1], where they are too many to be told apart. `last`: the last bounce counts, kept apart for
    the geometric tail. Of the first hit: `range`, its distance [m], 0 for an escape;
    `seen`, its label; `of_model`, 1 where it belongs to the model, not to the background; `facet`,
    its number. `model_only`: whether nothing but paths that first meet the model counts.
    `segments`: rays that were followed, where they are counted.
    """

    by_bounce: list
    by_source: list
    by_wavelength: list
    last: list = field(default_factory=list)
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
        """sources: by what emission is told apart; None for the closure's needs alone."""
        zeros = lambda count: [mi.Float(0) for _ in range(count)]
        return Channels(
            zeros(min(max_bounces + 1, MAX_BOUNCE_CHANNELS)),
            zeros(len(sources.list) if sources else 0),
            zeros(WAVELENGTHS if sources and sources.share is not None else 0),
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
        """Notes what a ray meets first: a surface interaction and its emitter."""
        hit = first.is_valid()
        self.range = dr.select(hit, first.t, 0)
        self.seen = emitters.label(emitter)
        self.of_model = dr.select(hit & emitters.is_model(emitter), mi.Float(1), 0)
        if facets is not None:
            self.facet = facets.number(first.shape, first.prim_index, hit)

    def add(self, value, bounce, sources: Sources, emitter, prim_index, max_bounces: int):
        """Adds radiance that was reflected `bounce` times and emitted by the primitive `prim_index`
        of an emitter.
        """
        beyond = bounce > max_bounces
        self.closure += dr.select(beyond, value, 0)
        value = dr.select(beyond, 0, value)
        channel = dr.minimum(bounce, len(self.by_bounce) - 1)
        for k in range(len(self.by_bounce)):
            self.by_bounce[k] += dr.select(channel == k, value, 0)
        if self.by_source:
            entry = sources.entry(emitter, prim_index)
            source = sources.number(entry)
            for k in range(len(self.by_source)):
                self.by_source[k] += dr.select(source == k, value, 0)
        if self.by_wavelength:
            for k, share in enumerate(sources.shares(entry)):
                self.by_wavelength[k] += value * share
        for k in range(len(self.last)):
            self.last[k] += dr.select(bounce + COUNTS == max_bounces + 1 + k, value, 0)

    def samples(self, L, labels: list[str], sources: Sources, of_model: bool) -> dict:
        """Every channel by its name: bounce.N, closure, group.LABEL, seen.LABEL, target (what the
        model's facets send), range and hit (1 or 0), segments where they were counted.

        of_model: also, under the same names after "target.", as much of each as lies on the model's
        facets, and source.N and wavelength.N where these were told apart. With `model_only` all
        names mean what lies there.
        """
        groups = {label: mi.Float(0) for label in labels}
        for source, value in zip(sources.list, self.by_source):
            groups[source.group] += value
        found = {f"bounce.{k}": value for k, value in enumerate(self.by_bounce)}
        found["closure"] = self.closure
        found |= {f"group.{label}": value for label, value in groups.items()}
        found |= {
            f"seen.{label}": dr.select(self.seen == k, L, 0) for k, label in enumerate(labels)
        }
        if of_model:
            if sources.by_spectrum:
                found |= {f"source.{k}": value for k, value in enumerate(self.by_source)}
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
        """Makes the geometric tail the closure; returns it, and what its error follows from."""
        dr.eval(self.last, self.of_model)
        self.closure, tail = add_tail(self.last, self.of_model)
        return self.closure, tail


@dataclass
class Pixels:
    """Statistics of one pass over a run of pixels; NumPy, Float64.

    count: finite samples of each pixel; mean and squares (sum of squared deviations from the mean)
    of the radiance. channels: by name, means of each pixel in equal parts of its samples, (parts,
    pixels), of part_count finite samples. invalid: NaN or infinite samples, left out. chance: the
    largest contribution that a source might have made to one of the paths, and did not. tail: of
    closure = tail, else None.
    """

    count: np.ndarray
    mean: np.ndarray
    squares: np.ndarray
    channels: dict[str, np.ndarray]
    part_count: np.ndarray
    invalid: int
    chance: float
    tail: Tail | None


def sums(values, size: int) -> np.ndarray:
    """Sums of `size` consecutive values each, Float64. Only few are summed in Float32, in which a
    sum of 16,000 equal numbers would be off by 1e-5.
    """
    few = gcd(size, SUMMED_IN_FLOAT32)
    partial = dr.block_sum(values, few).numpy().reshape(-1, size // few)
    return partial.sum(axis=1, dtype=np.float64)


def pixel_statistics(found, spp: int, in_parts: bool = False) -> Pixels:
    """Reduces samples (`spp` consecutive ones per pixel) to pixels.

    Deviations are taken from the pixel's own mean: in Float32 the variance would drown in the
    square of the mean. in_parts: the channels in two parts (where spp is even), so that their
    scatter tells their standard errors.
    """
    L, chance = found.radiance, found.chance
    finite = dr.isfinite(L)
    samples = {name: dr.select(finite, value, 0) for name, value in found.channels.items()}
    L, valid = dr.select(finite, L, 0), dr.select(finite, mi.Float(1), 0)
    # one kernel: each reduction would otherwise trace the paths again
    dr.eval(finite, L, valid, samples, chance)
    count, total = sums(valid, spp), sums(L, spp)
    mean = total / np.maximum(count, 1)
    deviation = dr.select(finite, L - dr.repeat(mi.Float(mean), spp), 0)
    squares = sums(dr.square(deviation), spp)

    parts = 2 if in_parts and spp % 2 == 0 else 1

    def by_part(value):
        return sums(value, spp // parts).reshape(-1, parts).T

    part_count = by_part(valid)
    channels = {name: by_part(value) / np.maximum(part_count, 1) for name, value in samples.items()}
    return Pixels(
        count=count,
        mean=mean,
        squares=squares,
        channels=channels,
        part_count=part_count,
        invalid=dr.width(L) - int(count.sum()),
        chance=float(dr.max(chance)[0]),
        tail=found.tail,
    )

"""Directions drawn toward emitters, what rays along them hit, and radiance by bin."""

from dataclasses import dataclass, field, replace

import drjit as dr
import mitsuba as mi


@dataclass
class DrawnDirection:
    """A direction drawn toward an emitter; whether the emitter can be seen along it is not known.

    ds: the direction, with the density `ds.pdf` [1/sr] for the point where the ray starts.
    compared: the density that multiple importance sampling compares with that of the reflection; a
    function of the direction, which `ds.pdf` nearly equals [1/sr]. index: number of the drawn
    panel, or, beyond those, of another emitter. other: the drawn emitter where it is not a panel of
    a mesh; None if the table has only panels. may_radiate: False where the drawn emitter is known
    to send nothing along the direction. bound: upper bound of the radiance of the drawn panel or
    emitter, hidden or not [W m^-2 sr^-1].
    """

    ds: mi.DirectionSample3f
    compared: mi.Float
    index: mi.UInt32
    other: mi.EmitterPtr | None
    may_radiate: mi.Bool
    bound: mi.Float


@dataclass
class EmitterSample:
    """The first hit along a drawn direction.

    drawn: the direction. hit: the first hit of the ray, where that is the drawn panel. emitter: the
    emitter that sends radiance along the ray. counts: whether the first hit is the drawn point, so
    that the sample counts. of_panel: whether it counts and the point is on a panel of a mesh.
    transmittance: that of the surfaces which the ray passes; None in a scene without such
    surfaces. passed: how often it passes each of the table's `spectral_plumes`. met: what the ray
    hits, the drawn point or not.
    """

    drawn: DrawnDirection
    hit: mi.SurfaceInteraction3f
    emitter: mi.EmitterPtr
    counts: mi.Bool
    of_panel: mi.Bool
    transmittance: mi.Float | None = None
    passed: list[mi.UInt32] = field(default_factory=list)
    met: mi.PreliminaryIntersection3f | None = None

    def radiance(self, si):
        """Radiance from the emitter toward `si`, with derivatives [W m^-2 sr^-1]."""
        drawn, of_panel = self.drawn, self.of_panel
        radiance = self.emitter.eval(self.hit, of_panel)
        if drawn.other is not None:
            radiance += drawn.other.eval_direction(si, drawn.ds, self.counts & ~of_panel)
        return radiance if self.transmittance is None else radiance * self.transmittance


@dataclass(frozen=True)
class BinnedRadiance:
    """Radiance of an emitter as the bins of a path see it, before the throughput of the walk.

    radiance: in-band radiance [W m^-2 sr^-1]. base: radiance of which each bin has the share of the
    source, times its factor. sources: number of the source of each part of the emitter, and its
    share of `base`. factors: of the bins.
    """

    radiance: mi.Float
    base: mi.Float
    sources: list[tuple[mi.UInt32, mi.Float]]
    factors: dr.Local

    def times(self, factor: mi.Float) -> "BinnedRadiance":
        """The radiance times a factor."""
        return replace(self, radiance=self.radiance * factor, base=self.base * factor)

"""Directions drawn toward emitters, and what rays along them hit."""

from dataclasses import dataclass

import mitsuba as mi


@dataclass
class DrawnDirection:
    """A direction drawn toward an emitter; whether the emitter can be seen along it is not known.

    ds: the direction, with the density `ds.pdf` [1/sr] for the point where the ray starts. index:
    what was drawn, as an index into the table of probabilities. other: the drawn emitter where it
    is not a triangle of a mesh; None if the table has only triangles. may_radiate: False where the
    drawn emitter is known to send nothing along the direction. bound: upper bound of the radiance
    of the drawn triangle or emitter, hidden or not [W m^-2 sr^-1].
    """

    ds: mi.DirectionSample3f
    index: mi.UInt32
    other: mi.EmitterPtr | None
    may_radiate: mi.Bool
    bound: mi.Float


@dataclass
class EmitterSample:
    """The first hit along a drawn direction.

    drawn: the direction. hit: the first hit of the ray, where that is the drawn triangle. emitter:
    the emitter that sends radiance along the ray. counts: whether the first hit is the drawn point,
    so that the sample counts. of_triangle: whether it counts and the point is on a triangle of a
    mesh. transmittance: that of the surfaces which the ray passes; None in a scene without such
    surfaces.
    """

    drawn: DrawnDirection
    hit: mi.SurfaceInteraction3f
    emitter: mi.EmitterPtr
    counts: mi.Bool
    of_triangle: mi.Bool
    transmittance: mi.Float | None = None

    def radiance(self, si):
        """Radiance from the emitter toward `si`, with derivatives [W m^-2 sr^-1]."""
        drawn, of_triangle = self.drawn, self.of_triangle
        radiance = self.emitter.eval(self.hit, of_triangle)
        if drawn.other is not None:
            radiance += drawn.other.eval_direction(si, drawn.ds, self.counts & ~of_triangle)
        return radiance if self.transmittance is None else radiance * self.transmittance

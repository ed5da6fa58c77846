"""Probabilities with which the triangles and the other emitters of a scene are drawn.

`UnmetSources` bounds the radiance of those that no path has hit, which the paths' scatter cannot
show.
"""

from dataclasses import dataclass
from functools import partial

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.plugins.emission.radiance_bound import can_be_hit
from mi_lcair.plugins.emission.triangles import Choice, TriangleTable, is_faceted, pointer_id

# A part of an emitter that is expected to be drawn this often is drawn with a probability of 95 %
FEW_DRAWS = 3.0
SIMILAR = 2.0  # ratio of the radiances of facets of an emitter that stand for each other


@dataclass(frozen=True)
class UnmetSources:
    """Upper bound of the radiance of sources that no path has hit.

    always: radiance of the brightest source that a path meets by chance alone [W m^-2 sr^-1].
    probability, radiance: the parts of emitters that are drawn, by rising probability of a draw,
    and the largest radiance of each part and of those before it [W m^-2 sr^-1].
    """

    always: float
    probability: np.ndarray
    radiance: np.ndarray

    def bound(self, draws: np.ndarray) -> np.ndarray:
        """The bound after these numbers of draws [W m^-2 sr^-1].

        A part of an emitter that is drawn less than FEW_DRAWS times on average is met by chance,
        as if it were not drawn at all. What is drawn more often shows in `Sums.chance`, be it
        hidden or not.
        """
        rare = FEW_DRAWS / np.maximum(draws, 1e-30)
        count = np.searchsorted(self.probability, rare)
        return np.maximum(self.always, np.append(0.0, self.radiance)[count])


def parts_of_emitters(radiances: list, probabilities: list) -> tuple[np.ndarray, np.ndarray]:
    """Probability and radiance for `UnmetSources`.

    A part of an emitter are all its facets from a certain radiance on. Facets of up to SIMILAR
    times its radiance less count as drawn instead of them.

    Parameters
    ----------
    radiances, probabilities : list of ndarray
        For each emitter, the radiance of its facets [W m^-2 sr^-1] and the probability of a draw.
    """
    parts = [(np.empty(0), np.empty(0))]
    for radiance, probability in zip(radiances, probabilities):
        order = np.argsort(-radiance, kind="stable")
        falling = radiance[order]
        similar = np.searchsorted(-falling, -falling / SIMILAR, side="right")
        parts.append((np.cumsum(probability[order])[similar - 1], falling))
    probability, radiance = map(np.concatenate, zip(*parts))
    order = np.argsort(probability, kind="stable")
    return probability[order], np.maximum.accumulate(radiance[order])


class DrawTable:
    """What is drawn: the triangles of emitting meshes, and then all other emitters.

    Triangles have probabilities proportional to area times an upper bound of the radiance, other
    emitters equal ones. If there are both, each part gets one half.

    triangles: the `TriangleTable`; None without meshes. others: pointers to the other emitters as
    integers; None without any. choice: draws an index. density: density per area of a triangle
    [1/m^2], probability of another emitter. bound: bound of the radiance [W m^-2 sr^-1].
    density_and_bound: pairs of both. ends: end of each emitter's triangles, and then of each other
    emitter. probability_of_other: that of one of the other emitters. all_surfaces: whether all
    other emitters are surfaces.
    """

    def __init__(self, emitters, bounds: dict, brightest: float):
        """bounds: bound of the radiance of the emitters that a ray can hit; None if unknown."""
        meshes = [emitter for emitter in emitters if is_mesh(emitter)]
        others = [emitter for emitter in emitters if not is_mesh(emitter)]
        self.triangles, weights, radiance = None, np.empty(0), np.empty(0)
        if meshes:
            table = TriangleTable([emitter.get_shape() for emitter in meshes])
            # An emitter without a known bound is drawn as if it were the brightest one. The weights
            # change the noise only, not the expected value.
            known = [brightest or 1.0 if bounds[e] is None else bounds[e] for e in meshes]
            radiance = np.concatenate([np.broadcast_to(*pair) for pair in zip(known, table.counts)])
            weights = radiance * table.area
            if weights.sum() > 0:
                self.triangles = table
            else:
                weights, radiance = np.empty(0), np.empty(0)
        self.triangle_count = len(weights)
        self.others = None
        if others:
            self.others = mi.UInt32([pointer_id(mi.EmitterPtr(emitter)) for emitter in others])
        self.all_surfaces = all(e.flags() & int(mi.EmitterFlags.Surface) for e in others)
        self.is_empty = self.triangles is None and not others
        if not self.is_empty:
            share = 0.0 if self.triangles is None else 1.0 if not others else 0.5
            of_others = np.full(len(others), (1 - share) / max(len(others), 1))
            of_triangles = share * weights / weights.sum() if share else weights
            self.choice = Choice(np.concatenate([of_triangles, of_others]))
            self.set_density(others, bounds, radiance)
            counts = [*(self.triangles.counts if self.triangles else []), *(1 for _ in others)]
            self.ends = np.cumsum(counts)
        dr.make_opaque(self.others)

    def set_density(self, others, bounds: dict, radiance) -> None:
        """Set the densities that follow from `choice`. radiance: bounds of the triangles."""
        density = self.choice.probability.copy()
        if self.triangles is not None:
            of_triangles = density[: self.triangle_count]
            density[: self.triangle_count] = self.triangles.density(of_triangles)
        of_others = [0.0 if bounds.get(e) is None else float(bounds[e].max()) for e in others]
        bound = np.append(radiance, of_others)
        self.bound = bound
        self.density = mi.Float(density)
        self.density_and_bound = mi.Float(np.stack([density, bound], axis=1).ravel())
        self.probability_of_other = mi.Float(self.choice.probability[-1] if others else 0.0)
        dr.make_opaque(self.density, self.density_and_bound, self.probability_of_other)

    def unmet(self, always: float) -> UnmetSources:
        """Bound of the radiance of sources that no path has hit. always: see `UnmetSources`."""
        if self.is_empty:
            return UnmetSources(always, np.empty(0), np.empty(0))
        split = partial(np.split, indices_or_sections=self.ends[:-1])
        parts = parts_of_emitters(split(self.bound), split(self.choice.probability))
        return UnmetSources(always, *parts)


def is_mesh(emitter) -> bool:
    """Whether an emitter belongs to a mesh, of whose triangles one is drawn."""
    shape = emitter.get_shape()
    return can_be_hit(emitter) and shape is not None and is_faceted(shape)

"""Probabilities with which the panels and the other emitters of a scene are drawn.

`UnmetSources` bounds the radiance of those that no path has hit, which the paths' scatter cannot
show.
"""

import re
from dataclasses import dataclass, field
from functools import partial, reduce

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.plugins.derivatives import members
from mi_lcair.plugins.emission.emissivity import emits
from mi_lcair.plugins.emission.panels import Panels, SeenPanel, chosen
from mi_lcair.plugins.emission.spherical_polygons import Receiver
from mi_lcair.plugins.emission.triangles import Choice, TriangleTable, is_faceted, pointer_id
from mi_lcair.plugins.emitters.thermal_emitter import is_thermal

# Upper bounds of the radiance of emitters and of textures, and the view in which they count
# ------------------------------------------------------------------------------------------

# Textures whose values never exceed the largest number that they or their nested textures contain.
# They interpolate or select numbers, but do not add or multiply them.
BETWEEN_ITS_VALUES = ("UniformSpectrum", "BitmapTextureImpl", "Checkerboard")
PLANE_SIDED = ("OrthographicCamera", "PerspectiveCamera")  # sensors with a box or a frustum
FILM_CORNERS = (0, 1, 1, 0), (0, 0, 1, 1)  # x and y of the film's corners, in film widths


def can_be_hit(emitter) -> bool:
    """Whether a reflected ray can hit the emitter; False for a point light or a parallel beam."""
    return not emitter.flags() & int(mi.EmitterFlags.Delta)


def radiance_bound(emitter) -> np.ndarray | None:
    """Upper bound of the radiance of an emitter that a ray can hit [W m^-2 sr^-1].

    An array of width 1, or with one value per triangle of the emitter's mesh. None if the emitter
    is of a kind whose radiance cannot be bounded from its parameters.
    """
    if is_thermal(emitter):
        return emitter.radiance_bound()
    held = members(emitter)
    if "data" in held and "scale" in held:  # envmap
        return largest(held["data"]) * largest(held["scale"])
    if isinstance(held.get("radiance"), mi.Texture):  # area, constant
        return texture_bound(held["radiance"], emitter.get_shape())
    return None


def texture_bound(texture, shape) -> np.ndarray | None:
    """Upper bound of a texture on a shape, of width 1 or per triangle; None if it is not known."""
    kind, held = texture.class_name().partition("[")[0], members(texture)
    if kind == "MeshAttribute":
        name = re.search(r'name = "(\w+)"', str(texture))
        buffer = members(shape).get(name[1]) if name else None
        if buffer is None:
            return None
        values = dr.detach(buffer).numpy().astype(np.float64) * held.get("scale", 1.0)
        return values if name[1].startswith("face_") else values.max(keepdims=True)
    if kind not in BETWEEN_ITS_VALUES:
        return None
    bounds = [
        texture_bound(value, shape) if isinstance(value, mi.Texture) else largest(value)
        for name, value in held.items()
        if isinstance(value, mi.Texture) or name in ("value", "data")
    ]
    if not bounds or any(bound is None for bound in bounds):
        return None
    return reduce(np.maximum, bounds)  # some of width 1, some per triangle


def texels(values) -> np.ndarray:
    """Values of a texture as numbers; those of 8-bit files are kept as integers, 255 for 1."""
    held = np.asarray(dr.detach(values))
    return held / (np.iinfo(held.dtype).max if held.dtype.kind == "u" else 1.0)


def largest(values) -> np.ndarray:
    """The largest value, as an array of width 1."""
    return np.atleast_1d(np.max(texels(values)))


class FieldOfView:
    """The space that the rays of a sensor fill, as an intersection of half-spaces.

    It is a box for an orthographic sensor, a frustum for a perspective sensor, and all of space for
    any other sensor.
    """

    def __init__(self, sensor):
        self.normals, self.offsets = np.zeros((0, 3)), np.zeros(0)
        if sensor.class_name() not in PLANE_SIDED:
            return
        corners = mi.Point2f(FILM_CORNERS)
        rays, _ = sensor.sample_ray(sensor.shutter_open(), 0, corners, mi.Point2f(0.5))
        o, d = (np.broadcast_to(np.array(v, dtype=np.float64), (3, 4)).T for v in (rays.o, rays.d))
        sides = np.cross(d, np.roll(o + d, -1, axis=0) - o)
        front = np.cross(o[1] - o[0], o[3] - o[0])  # rays start at the near clip
        normals = np.vstack([sides, front])
        points = np.vstack([o, o[:1]])
        middle = (o + d).mean(axis=0)
        inward = np.sign(np.sum(normals * (middle - points), axis=1))
        self.normals = normals * inward[:, None]
        self.offsets = np.sum(self.normals * points, axis=1)

    def excludes(self, points) -> np.ndarray:
        """Whether each set of points lies completely beyond one of the limiting planes, (sets,).

        The sensor cannot see the convex hull of such a set. points: (sets, points of a set, 3) [m].
        """
        beyond = points.reshape(-1, 3) @ self.normals.T < self.offsets  # much faster than by sets
        beyond = beyond.reshape(*points.shape[:2], len(self.normals))
        return beyond.all(axis=1).any(axis=1)


# A part of an emitter that is expected to be drawn this often is drawn with a probability of 95 %
FEW_DRAWS = 3.0
# Value of emitter_sampling, and its factor of the densities of drawn directions where they are
# compared with those of reflected rays. It leaves the latter a share of 1 % where both are equal.
PREFERRED, PREFERENCE = "preferred", 10.0
EXACT = 2  # panels of which one is drawn by its projected solid angle, which is known exactly
SIMILAR = 2.0  # ratio of the radiances of facets of an emitter that stand for each other


@dataclass(frozen=True)
class UnmetSources:
    """Upper bound of the radiance of sources that no path has hit.

    in_view: radiance of the brightest source that the first ray of a path meets by chance
    [W m^-2 sr^-1]. undrawn: that of the brightest source that a path meets by chance alone after a
    reflection. probability, radiance: the parts of emitters that are drawn, by rising probability
    of a draw, and the largest radiance of each part and of those before it [W m^-2 sr^-1].
    brightest: radiance of the brightest source. darker: where rays are guided, that of the
    brightest source that is not one of the `HotParts`; None elsewhere.
    """

    in_view: float
    undrawn: float = 0.0
    probability: np.ndarray = field(default_factory=lambda: np.empty(0))
    radiance: np.ndarray = field(default_factory=lambda: np.empty(0))
    brightest: float = 0.0
    darker: float | None = None

    def rare(self, draws: np.ndarray) -> np.ndarray:
        """Radiance of the brightest source met by chance alone after a reflection [W m^-2 sr^-1].

        A part of an emitter that is drawn less than FEW_DRAWS times on average is met by chance,
        as if it were not drawn at all. What is drawn more often shows in `Sums.unmet`, be it
        hidden or not.
        """
        rare = FEW_DRAWS / np.maximum(draws, 1e-30)
        count = np.searchsorted(self.probability, rare)
        return np.maximum(self.undrawn, np.append(0.0, self.radiance)[count])

    def after_reflection(self, sums: dict, largest_weight=1.0) -> np.ndarray:
        """What a path adds that meets a source by chance after a reflection [W m^-2 sr^-1].

        A source is as likely to be met at one reflection as at another, but for their throughput.
        Hot parts are as likely to be met as their chance at each reflection says.
        Of sources that are drawn and at least BRIGHT, it is what the paths could have met instead
        of the throughput. sums: by the names of `UnmetSource`. largest_weight: that of a path.
        """
        rare = self.rare(sums["draws"])
        of_draws = self_weighted(sums["draws"], sums["squares"], largest_weight)
        if self.darker is None:
            rare = rare * of_draws
        else:
            of_hot = self_weighted(sums["chances"], sums["chance_squares"], largest_weight)
            rare = np.maximum(rare * of_hot, self.darker * of_draws)
        potentials = sums["potential"], sums["potential_squares"]
        largest = sums["largest"] / (self.brightest or 1.0)
        bright = self.brightest * self_weighted(*potentials, largest)
        return np.maximum(np.maximum(rare, sums["darker"]), np.minimum(bright, sums["largest"]))


def self_weighted(sums, squares, largest) -> np.ndarray:
    """Mean of numbers, each weighted by itself, from their sums and sums of squares.

    FEW_DRAWS further numbers are taken to be the largest one.
    """
    sums = sums + FEW_DRAWS * largest
    squares = squares + FEW_DRAWS * largest**2
    return np.divide(squares, sums, out=np.zeros_like(squares), where=sums > 0)


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
    """What is drawn: the panels of emitting meshes, and then all other emitters.

    Panels are drawn by what they send to the receiver, or by their power where they surround the
    scene, see `chosen`. Other emitters have equal probabilities. If there are both, each part gets
    one half.

    panel_choice: draws a panel; None without meshes. panel_count: number of panels. share:
    probability that a panel is drawn. others: pointers to the other emitters as integers; None
    without any. choice: draws one of them. bound: bound of the radiance [W m^-2 sr^-1]. least:
    smallest probability. density_and_bound: pairs of the probability of another emitter, 0 for a
    panel, and the bound. ends: end of each emitter's panels, and then of each other emitter.
    probability_of_other: that of one of the other emitters. all_surfaces: whether all other
    emitters are surfaces. surrounds: whether there are only panels, which surround the scene.
    suffices: whether there are so few panels that a draw is by what they send, and nothing else.
    preference: factor of the densities that are compared with those of
    reflected rays, for the weights of multiple importance sampling.
    """

    UNRECORDED = ("least", "bound", "ends", "surrounds", "suffices")

    def __init__(self, emitters, bounds: dict, brightest: float, preference=1.0, like=None):
        """bounds: bound of the radiance of the emitters that a ray can hit; None if unknown.
        like: table of the same emitters with other radiances; None if there is none.
        """
        # Opaque, so that one kernel serves every preference
        self.preference = dr.opaque(mi.Float, preference)
        meshes = [emitter for emitter in emitters if is_mesh(emitter)]
        others = [emitter for emitter in emitters if not is_mesh(emitter)]
        self.panel_choice, counts = None, []
        radiance, least = np.empty(0), np.empty(0)
        if meshes:
            panels = None if like is None or like.panel_choice is None else like.panel_choice.panels
            table = panels and panels.table
            table = table or TriangleTable([emitter.get_shape() for emitter in meshes])
            # An emitter without a known bound is drawn as if it were the brightest one. The weights
            # change the noise only, not the expected value.
            known = [brightest or 1.0 if bounds[e] is None else bounds[e] for e in meshes]
            of_meshes = per_triangle(known, table.counts)
            if (of_meshes * table.area).sum() > 0:
                both_sides = per_triangle([emits_behind(e) for e in meshes], table.counts)
                emission = of_meshes, both_sides
                panels = Panels(table, *emission) if panels is None else panels.at(*emission)
                self.panel_choice = chosen(panels)
                radiance, least, counts = panels.radiance, self.panel_choice.least, panels.counts
        self.panel_count = len(radiance)
        self.others = None
        if others:
            self.others = mi.UInt32([pointer_id(mi.EmitterPtr(emitter)) for emitter in others])
            self.choice = Choice(np.ones(len(others)))
        self.all_surfaces = all(e.flags() & int(mi.EmitterFlags.Surface) for e in others)
        choice = self.panel_choice
        self.surrounds = choice is not None and choice.surrounds and not others
        few = 0 < len(radiance) <= EXACT and not others and not self.surrounds
        self.suffices = bool(few and least.min() > 0)
        self.is_empty = self.panel_choice is None and not others
        if not self.is_empty:
            self.share = 0.0 if self.panel_choice is None else 1.0 if not others else 0.5
            of_others = (1 - self.share) * self.choice.probability if others else np.empty(0)
            self.least = np.concatenate([self.share * least, of_others])
            bound_of_others = [
                0.0 if bounds.get(e) is None else float(bounds[e].max()) for e in others
            ]
            self.bound = np.append(radiance, bound_of_others)
            density = np.append(np.zeros(len(radiance)), of_others)
            self.density_and_bound = mi.Float(np.stack([density, self.bound], axis=1).ravel())
            self.probability_of_other = mi.Float(of_others[-1] if others else 0.0)
            self.ends = np.cumsum([*counts, *(1 for _ in others)])
            dr.make_opaque(self.density_and_bound, self.probability_of_other)
        dr.make_opaque(self.others)

    def pick(self, number, receiver: Receiver, active) -> tuple[mi.UInt32, SeenPanel, mi.Float]:
        """What a random 32-bit integer draws, and a drawn panel as it is seen and its probability.

        receiver: where it is drawn.
        """
        within = dr.float64_array_t(mi.Float)(number) * 2.0**-32
        from_panels = active & (within < self.share)
        of_panels = within / self.share
        index, seen, probability = self.panel_choice.draw(of_panels, receiver, from_panels)
        if self.others is not None:
            rest = mi.UInt32((within - self.share) / (1 - self.share) * 2.0**32)
            other = self.panel_count + self.choice.pick(rest, active & ~from_panels)
            index = dr.select(from_panels, index, other)
        return index, seen, self.share * probability

    def unmet(self, in_view: float, brightest: float) -> UnmetSources:
        """Bound of the radiance of sources that no path has hit; the others: see `UnmetSources`."""
        split = partial(np.split, indices_or_sections=self.ends[:-1])
        parts = parts_of_emitters(split(self.bound), split(self.least))
        return UnmetSources(in_view, 0.0, *parts, brightest)


def is_mesh(emitter) -> bool:
    """Whether an emitter belongs to a mesh, of whose panels one is drawn."""
    shape = emitter.get_shape()
    return can_be_hit(emitter) and shape is not None and is_faceted(shape)


def emits_behind(emitter) -> bool:
    """Whether the surface of an emitter also emits on the side away from its normal."""
    bsdf = emitter.get_shape().bsdf()
    return is_thermal(emitter) and emits(int(bsdf.flags()), -1.0)


def per_triangle(values: list, counts: list[int]) -> np.ndarray:
    """Values of meshes, each one or one for each triangle, for all of their triangles."""
    return np.concatenate([np.broadcast_to(*pair) for pair in zip(values, counts)])

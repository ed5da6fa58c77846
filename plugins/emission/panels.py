"""The panels of emitting meshes, toward which directions are drawn: rectangles and triangles."""

from copy import copy
from dataclasses import dataclass
from functools import cached_property

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.plugins.emission.spherical_polygons import (
    Receiver,
    SphericalPolygon,
    SphericalRectangle,
    SphericalTriangle,
)
from mi_lcair.plugins.emission.triangles import (
    Choice,
    TriangleTable,
    is_faceted,
    loops,
    random_integer,
    set_triangles,
    triangle_corners,
)

ROUNDING = 1e-5  # relative error of a rectangle's sides and right angles that counts as rounding


class Panels:
    """The triangles of some meshes, of which two that form a rectangle are one panel.

    table: the `TriangleTable`. of_triangles: the panel of each triangle. first: the first triangle
    of each panel; is_rectangle: whether it has two; both NumPy. counts: number of panels of each
    mesh. area: of the panels [m^2]. radiance: bounds [W m^-2 sr^-1]. emits_behind: whether they
    emit on both sides. These three are NumPy, (n,).
    """

    UNRECORDED = ("may_pair", "pairs", "first", "counts", "area", "radiance", "emits_behind")
    UNRECORDED += ("corners", "normal", "order", "spheres")

    def __init__(self, table: TriangleTable, radiance, emits_behind):
        """radiance, emits_behind: one for each triangle."""
        self.table = table
        rows = table.rows.numpy().astype(np.float64).reshape(-1, 3, 4)
        mesh = np.repeat(np.arange(len(table.counts)), table.counts)
        vertices = vertices_of(rows)
        corner = right_angle(vertices)
        self.may_pair = rectangles(vertices, corner) & (mesh[:-1] == mesh[1:])
        pairs = self.pairs = paired(self.may_pair, radiance, emits_behind)
        is_second = np.zeros(len(rows), bool)
        is_second[pairs + 1] = True
        self.first = np.flatnonzero(~is_second)
        self.is_rectangle = np.isin(self.first, pairs)
        self.counts = np.bincount(mesh[self.first], minlength=len(table.counts)).tolist()
        self.area = table.area[self.first] * np.where(self.is_rectangle, 2, 1)
        self.radiance, self.emits_behind = radiance[self.first], emits_behind[self.first]
        vertices = vertices[self.first]
        # The corner of a rectangle is that of its right angle
        turn = (np.where(self.is_rectangle, corner[self.first], 0)[:, None] + np.arange(3)) % 3
        vertices = np.take_along_axis(vertices, turn[:, :, None], axis=1)
        edges = vertices[:, 1:] - vertices[:, :1]
        self.corners = np.concatenate([vertices, vertices[:, 1:2] + edges[:, 1:2]], axis=1)
        self.corners[~self.is_rectangle, 3] = vertices[~self.is_rectangle, 2]
        self.normal = rows[self.first, :, 3]
        panels = np.concatenate([vertices[:, :1], edges], axis=1)
        panels = np.concatenate([panels, self.normal[:, :, None]], axis=2)
        self.rows = mi.Float(panels.ravel())
        self.of_triangles = mi.UInt32(np.cumsum(~is_second) - 1)
        self.kinds = mi.UInt32(self.is_rectangle)
        dr.make_opaque(self.rows, self.of_triangles, self.kinds)

    def at(self, radiance, emits_behind) -> "Panels":
        """Those of the same triangles with other radiances, one for each triangle."""
        if not np.array_equal(self.pairs, paired(self.may_pair, radiance, emits_behind)):
            return Panels(self.table, radiance, emits_behind)
        panels = copy(self)
        panels.radiance, panels.emits_behind = radiance[self.first], emits_behind[self.first]
        return panels

    @cached_property
    def order(self) -> np.ndarray:
        """Order of the panels in a tree, see `neighbours`."""
        return neighbours(self.corners.mean(axis=1), self.normal)

    @cached_property
    def spheres(self) -> np.ndarray:
        """Spheres around the nodes of a tree in that order, see `spheres`."""
        return spheres(self.corners[self.order])

    def find(self, shape, prim_index, active=True) -> tuple[mi.UInt32, mi.Bool]:
        """The panel of a shape's triangle, and whether there is one."""
        triangle, known = self.table.find(shape, prim_index, active)
        return dr.gather(mi.UInt32, self.of_triangles, triangle, known), known

    def seen(self, panel, receiver: Receiver, active=True) -> "SeenPanel":
        """A panel as seen from a point of a surface."""
        corner, *edges = (
            dr.gather(mi.Vector4f, self.rows, 3 * panel + row, active) for row in range(3)
        )
        normal = mi.Vector3f(corner.w, *(edge.w for edge in edges))
        kinds = [SphericalTriangle, SphericalRectangle]
        if not self.is_rectangle.any():
            kinds = kinds[:1]
        elif self.is_rectangle.all():
            kinds = kinds[1:]
        forms = [
            kind.of(corner.xyz, *(edge.xyz for edge in edges), normal, receiver) for kind in kinds
        ]
        is_rectangle = dr.gather(mi.UInt32, self.kinds, panel, active) > 0
        return SeenPanel(forms, is_rectangle)


@dataclass
class SeenPanel:
    """A panel as seen from a point: a polygon for each kind that a scene has, and which it is."""

    forms: list[SphericalPolygon]
    is_rectangle: mi.Bool

    @property
    def n(self) -> mi.Vector3f:
        """The panel's normal."""
        return self.forms[0].n

    @property
    def distance(self) -> mi.Float:
        """Distance of its plane, negative in front of it [m]."""
        return self.forms[0].distance

    @property
    def projected(self) -> mi.Float:
        """Projected solid angle [sr]."""
        return self.of_kind(lambda form: form.projected)

    @property
    def solid_angle(self) -> mi.Float:
        """Solid angle [sr]."""
        return self.of_kind(lambda form: form.solid_angle)

    def draw(self, sample) -> tuple[mi.Vector3f, mi.Float, mi.Float]:
        """See `SphericalPolygon.draw`."""
        return self.of_kind(lambda form: form.draw(sample))

    def along(self, d, length) -> mi.Float:
        """See `SphericalPolygon.along`."""
        return self.of_kind(lambda form: form.along(d, length))

    def of_kind(self, result):
        values = [result(form) for form in self.forms]
        if len(values) == 1:
            return values[0]
        return dr.select(self.is_rectangle, values[1], values[0])


def vertices_of(rows) -> np.ndarray:
    """Vertices of triangles [m], (n, 3, 3). rows: those of a `TriangleTable`."""
    return rows[:, :1, :3] + np.pad(rows[:, 1:, :3], [(0, 0), (1, 0), (0, 0)])


def right_angle(vertices) -> np.ndarray:
    """Number of the corner of each triangle that is nearest to a right angle, (n,)."""
    after, before = (np.roll(vertices, k, axis=1) - vertices for k in (-1, 1))
    cos = np.abs(np.sum(after * before, axis=2))
    return np.argmin(cos / np.maximum(norms(after) * norms(before), 1e-300), axis=1)


def norms(vectors) -> np.ndarray:
    return np.linalg.norm(vectors, axis=-1)


def rectangles(vertices, corner) -> np.ndarray:
    """Which triangles form a rectangle with the next one, (n - 1,).

    corner: the result of `right_angle`.
    """
    turn = (corner[:, None] + np.arange(3)) % 3
    right, end_1, end_2 = np.moveaxis(np.take_along_axis(vertices, turn[:, :, None], 1), 1, 0)
    sides = end_1 - right, end_2 - right
    size = norms(end_1 - end_2)
    is_right = np.abs(np.sum(sides[0] * sides[1], axis=1)) < ROUNDING * norms(sides[0]) * norms(
        sides[1]
    )
    # The next triangle has its right angle opposite, and the same long side the other way round
    apart = [
        right[1:] - (end_1 + end_2 - right)[:-1],
        end_1[1:] - end_2[:-1],
        end_2[1:] - end_1[:-1],
    ]
    is_pair = is_right[:-1]
    for gap in apart:
        is_pair = is_pair & (norms(gap) < ROUNDING * size[:-1])
    return is_pair


def paired(may_pair, radiance, emits_behind) -> np.ndarray:
    """Numbers of the triangles that are one panel with the next one, which emits the same."""
    pairs, last = [], -2
    is_pair = may_pair & (radiance[:-1] == radiance[1:]) & (emits_behind[:-1] == emits_behind[1:])
    for number in np.flatnonzero(is_pair):
        if number > last + 1:
            pairs.append(number)
            last = number
    return np.array(pairs, dtype=int)


# Draws a panel by an estimate of what it sends to a point: by a tree of the panels
# ---------------------------------------------------------------------------------

# Share of the draws that ignore where the point is. It bounds the probability of each panel
# from below, see `LightTree.least`.
ANYWHERE = 0.1
LEVELS = 10  # bits of each coordinate by which panels are put next to each other


@dataclass
class Descent:
    """A way from the root of a tree to a leaf.

    number: what remains of the random number in 0..1; None on the way to a known leaf. node: number
    of the node; the root is 1, and node k has the children 2 k and 2 k + 1. probability: that of
    the way by what the nodes send to the receiver.
    """

    number: mi.Float64
    node: mi.UInt32
    probability: mi.Float


class LightTree:
    """A complete binary tree over emitting panels (A. Conty Estevez, C. Kulla, HPG 2018).

    A node is drawn by an estimate of what it sends to the receiver: its power, the distance, and
    the cosines at both ends. The last choice, of two panels, is by their projected solid angles.

    panels: the `Panels`. panel_of: the panel of each leaf; leaf_of: the leaf of each panel. levels,
    count: number of levels below the root, and of panels. powers: share of each node in the power.
    nodes: `spheres` and `emission`. sides: for each leaf, the bound of the radiance, and 1 where it
    emits on both sides, 0 elsewhere. least: smallest probability of each panel, (n,), NumPy.
    """

    UNRECORDED = ("least",)
    surrounds = False  # see `ByPower`

    def __init__(self, panels: Panels):
        power = panels.radiance * panels.area
        self.panels, self.least = panels, ANYWHERE * power / power.sum()
        order, depth = panels.order, depth_of(panels.order)
        leaves, both_sides = power[order] / power.sum(), panels.emits_behind[order]
        of_emission = emission(panels.normal[order], leaves, both_sides)
        rows = np.concatenate([panels.spheres, of_emission], axis=1)
        self.nodes = mi.Float(rows.ravel())
        self.powers = mi.Float(of_levels(np.pad(leaves, (0, 2**depth - len(order)))))
        self.sides = mi.Float(np.stack([panels.radiance[order], both_sides], axis=1).ravel())
        self.panel_of, self.leaf_of = mi.UInt32(order), mi.UInt32(np.argsort(order))
        # Opaque, so that one kernel serves all trees
        self.levels, self.count = mi.UInt32(depth), mi.UInt32(len(order))
        dr.make_opaque(*(value for value in vars(self).values() if dr.is_array_v(value)))

    def draw(self, number, receiver: Receiver, active) -> tuple[mi.UInt32, SeenPanel, mi.Float]:
        """The panel that a number in 0..1 (Float64) draws, as it is seen, and its probability."""
        anywhere = number < ANYWHERE
        rest = dr.select(anywhere, number / ANYWHERE, (number - ANYWHERE) / (1 - ANYWHERE))
        end, seen = self.descend(receiver, rest, anywhere, None, active)
        leaf = end.node - (1 << self.levels)
        known = active & (leaf < self.count)
        return dr.gather(mi.UInt32, self.panel_of, leaf, known), seen, self.mixed(end, known)

    def probability(self, panel, receiver: Receiver, active) -> tuple[SeenPanel, mi.Float]:
        """A panel as it is seen, and the probability with which `draw` draws it."""
        number = dr.zeros(dr.float64_array_t(mi.Float), dr.width(panel))
        target = dr.gather(mi.UInt32, self.leaf_of, panel, active) + (1 << self.levels)
        end, seen = self.descend(receiver, number, mi.Bool(False), target, active)
        return seen, self.mixed(end, active)

    def mixed(self, end: Descent, active) -> mi.Float:
        share = dr.gather(mi.Float, self.powers, end.node, active)
        return dr.select(active, dr.lerp(end.probability, share, ANYWHERE), 0)

    @dr.syntax
    def descend(self, receiver: Receiver, number, anywhere, target, active) -> tuple:
        """Go down to the leaf `target`, or, if it is None, to the one that the number draws.

        anywhere: whether a node is drawn by power alone. Gives the `Descent` and the `SeenPanel`.
        """
        way = Descent(dr.float64_array_t(mi.Float)(number), mi.UInt32(1), mi.Float(1))
        level = mi.UInt32(self.levels)
        while dr.hint(
            active & (level > 1), label="light_tree", exclude=[receiver, anywhere, target, active]
        ):
            level -= 1
            sent = self.sent(2 * way.node, receiver), self.sent(2 * way.node + 1, receiver)
            self.step(way, sent, level, anywhere, target)
        leaf = 2 * way.node - (1 << self.levels)
        (first, *sent), (second, *more) = (self.leaf(leaf + k, receiver) for k in range(2))
        is_first = self.step(way, sent + more, mi.UInt32(0), anywhere, target)
        return way, dr.select(is_first, first, second)

    def step(self, way: Descent, sent, level, anywhere, target) -> mi.Bool:
        """Go to a child of a node by what both send, and tell whether it is the first one."""
        left = 2 * way.node
        powers = mi.Vector2f(*(dr.gather(mi.Float, self.powers, left + k) for k in range(2)))
        weights = mi.Vector2f(*sent)
        # Where nothing is known to arrive, by power. A power of 0 is never drawn.
        share = part_of_first(dr.select(weights.x + weights.y > 0, weights, powers))
        by = dr.float64_array_t(mi.Float)(dr.select(anywhere, part_of_first(powers), share))
        is_first = way.number < by if target is None else ((target >> level) & 1) == 0
        way.number = dr.select(is_first, way.number / by, (way.number - by) / (1 - by))
        way.probability *= dr.select(is_first, share, 1 - share)
        way.node = dr.select(is_first, left, left + 1)
        return is_first

    def sent(self, node, receiver: Receiver) -> mi.Float:
        """Estimate of what a node sends to a receiver, relative to the power of all nodes [m^-2].

        Each panel of the node is assumed to be somewhere in its sphere.
        """
        sphere, emission = (dr.gather(mi.Vector4f, self.nodes, 2 * node + k) for k in range(2))
        to, radius = sphere.xyz - receiver.p, sphere.w
        distance = dr.sqrt(dr.squared_norm(to) + 0.5 * dr.square(radius)) + 1e-30
        preferred = dr.norm(emission.xyz)
        axis = emission.xyz / dr.maximum(preferred, 1e-30)
        leaving = preferred * height(-dr.dot(axis, to), radius) / distance + emission.w
        return leaving * height(dr.dot(receiver.n, to), radius) / (distance * dr.square(distance))

    def leaf(self, leaf, receiver: Receiver) -> tuple[SeenPanel, mi.Float]:
        """The panel of a leaf, and its radiance times projected solid angle [W m^-2]."""
        is_leaf = leaf < self.count
        panel = dr.gather(mi.UInt32, self.panel_of, leaf, is_leaf)
        seen = self.panels.seen(panel, receiver, is_leaf)
        radiance, is_two_sided = dr.gather(mi.Vector2f, self.sides, leaf, is_leaf)
        is_front = (seen.distance < 0) | (is_two_sided > 0)
        return seen, dr.select(is_leaf & is_front, radiance * seen.projected, 0)


def height(centre, radius) -> mi.Float:
    """Mean height above a plane, 0 below it, between those of the centre -+ radius [m]."""
    across = dr.square(centre + radius) / dr.maximum(4 * radius, 1e-30)
    return dr.select(dr.abs(centre) < radius, across, dr.maximum(centre, 0))


def part_of_first(weights) -> mi.Float:
    return weights.x / dr.maximum(weights.x + weights.y, 1e-30)


def of_levels(leaves, combine=np.add) -> np.ndarray:
    """Values of all nodes by number, from those of the leaves."""
    levels = [leaves]
    while len(levels[-1]) > 1:
        levels.append(combine(levels[-1][::2], levels[-1][1::2]))
    return np.concatenate([np.zeros_like(leaves[:1]), *levels[::-1]])


def depth_of(leaves) -> int:
    """Number of levels of a tree below its root."""
    return max(int(len(leaves) - 1).bit_length(), 1)


def spheres(corners) -> np.ndarray:
    """Centres and radii of spheres around the nodes of a tree, (nodes, 4) [m].

    corners: those of the leaves, (n, 4, 3) [m].
    """
    missing = (0, 2 ** depth_of(corners) - len(corners))
    low = np.pad(corners.min(axis=1), [missing, (0, 0)], constant_values=np.inf)
    high = np.pad(corners.max(axis=1), [missing, (0, 0)], constant_values=-np.inf)
    low, high = of_levels(low, np.minimum), of_levels(high, np.maximum)
    is_empty = ~(low <= high).all(axis=1, keepdims=True)
    low, high = (np.where(is_empty, 0, corner) for corner in (low, high))
    return np.concatenate([0.5 * (low + high), 0.5 * norms(high - low)[:, None]], axis=1)


def emission(normal, power, is_two_sided) -> np.ndarray:
    """Emission of the nodes of a tree, (nodes, 4), from normal and power of the leaves.

    It is a vector and a number: in a direction of unit length, a node emits its product with the
    vector where that is positive, and the number. The vector is the sum of power times normal. The
    rest of the power is assumed to have random normals: the mean cosine of one side is 1/4, of both
    1/2.
    """
    missing = (0, 2 ** depth_of(power) - len(power))
    of_one, of_both = np.where(is_two_sided, 0, power), np.where(is_two_sided, power, 0)
    preferred = of_levels(np.pad(normal * of_one[:, None], [missing, (0, 0)]))
    of_one, of_both = (of_levels(np.pad(share, missing)) for share in (of_one, of_both))
    rest = np.maximum(of_one - norms(preferred), 0) / 4 + of_both / 2
    return np.concatenate([preferred, rest[:, None]], axis=1)


def neighbours(centres, normals) -> np.ndarray:
    """Order in which near panels of like normals follow each other, by interleaved bits.

    centres: (n, 3) [m]. normals: (n, 3).
    """
    size = max(float(np.ptp(centres, axis=0).max()), 1e-30)
    places = (centres - centres.min(axis=0)) / size
    coordinates = np.concatenate([places, 0.5 * (1 + normals)], axis=1)
    bits = np.minimum(coordinates * 2**LEVELS, 2**LEVELS - 1).astype(np.uint64)
    code = np.zeros(len(centres), np.uint64)
    for level in range(LEVELS - 1, -1, -1):
        for column in bits.T:
            code = (code << np.uint64(1)) | ((column >> np.uint64(level)) & np.uint64(1))
    return np.argsort(code, kind="stable")


# Part of their box that panels enclose, from which on they are drawn by power
SURROUNDS = 0.45


class ByPower:
    """Draws a panel by radiance times area, wherever the receiver is; used as a `LightTree`.

    Where emitting walls surround the scene, all reflected paths end at some of them, and a tree
    costs more than it saves.

    surrounds: whether they do.
    """

    UNRECORDED = ("least", "surrounds")

    def __init__(self, panels: Panels, surrounds: bool = False):
        self.surrounds = surrounds
        self.panels, self.choice = panels, Choice(panels.radiance * panels.area)
        self.least = self.choice.probability
        self.probabilities = mi.Float(self.least)
        dr.make_opaque(self.probabilities)

    def draw(self, number, receiver: Receiver, active) -> tuple[mi.UInt32, SeenPanel, mi.Float]:
        panel = mi.UInt32(self.choice.pick(mi.UInt32(number * 2.0**32), active))
        return panel, *self.probability(panel, receiver, active)

    def probability(self, panel, receiver: Receiver, active) -> tuple[SeenPanel, mi.Float]:
        seen = self.panels.seen(panel, receiver, active)
        return seen, dr.gather(mi.Float, self.probabilities, panel, active)


def chosen(panels: Panels) -> LightTree | ByPower:
    """What draws one of the panels in less time for the same noise.

    It depends on the part of their box that panels enclose with their front sides, less what their
    backs enclose. Each counts by its radiance relative to the brightest one; those that emit on
    both sides do not.
    """
    low, high = panels.corners.min(axis=(0, 1)), panels.corners.max(axis=(0, 1))
    inward = np.sum(panels.normal * ((low + high) / 2 - panels.corners[:, 0]), axis=1) / 3
    power = panels.radiance * np.where(panels.emits_behind, 0, panels.area)
    surround = power @ inward > SURROUNDS * np.prod(high - low) * panels.radiance.max()
    return ByPower(panels, bool(surround)) if surround or len(power) == 1 else LightTree(panels)


# Openings of hollow bodies: reflected paths that would escape through them are drawn again
# -----------------------------------------------------------------------------------------

MOST_LIDS = 8  # of a scene; the largest ones are kept
MOST_EDGES = 32  # of a lid; an outline with more is followed by some of its corners
TRIES = 3  # directions of a reflection, of which the last one is kept wherever it goes
# Largest density of a reflected direction, relative to that of the draw toward the lids, for which
# it is drawn again. It keeps the weights of the other paths positive.
LARGEST_SHARE = 0.9


class Openings:
    """The openings of a scene's hollow bodies, closed by lids of triangles.

    Where rays that escape meet no radiance, a reflected path ends in nothing if it leaves through
    an opening. Such rare ends are most of the noise of a cavity. Let E be directions that leave
    through a lid, and P their probability for a reflection. A direction drawn toward the lids gives
    an unbiased estimate of P. A reflected direction in E is drawn again, up to n = TRIES times. If
    one before the last is not in E, the path goes on along it with the weight 1 - P; otherwise
    along the last one, with the weight 1. The mean is that of single tries, since
    (1 - P) (1 + P + ... + P^(n-2)) + P^(n-1) = 1. The variance from escapes falls from about P to
    P^n.

    The lids only choose what is drawn again. The mean does not depend on them.

    panels: the triangles of the lids. tree: draws them by what would arrive from them.
    """

    def __init__(self, triangles: np.ndarray):
        """triangles: those of all lids, (n, 3, 3) [m]."""
        mesh = mi.Mesh("lids", 3 * len(triangles), len(triangles))
        set_triangles(mesh, triangles, np.arange(3 * len(triangles)))
        even = np.ones(len(triangles))
        self.panels = Panels(TriangleTable([mesh]), even, even > 0)
        self.tree = LightTree(self.panels)
        self.count = dr.opaque(mi.UInt32, len(self.panels.first))

    @staticmethod
    def of(scene) -> "Openings | None":
        """The openings of a scene's meshes; None without any, or if escaping rays meet radiance."""
        meshes = [shape for shape in scene.shapes() if is_faceted(shape)]
        if not meshes or scene.environment() is not None:
            return None
        corners = np.concatenate([np.stack(triangle_corners(mesh), axis=1) for mesh in meshes])
        lids = sorted(map(lid, outlines(corners)), key=area)[-MOST_LIDS:]
        lids = [triangles for triangles in lids if area(triangles) > 0]
        return Openings(np.concatenate(lids)) if lids else None

    def reflect(self, scene, emitters, hit, sampler, bs, weight) -> tuple:
        """The direction in which a reflected path goes on, see the class.

        Parameters
        ----------
        scene : mi.Scene
        emitters : EmitterTable
            Its rays start at the hit.
        hit : Hit
            Where paths are reflected that go on.
        sampler : mi.Sampler
        bs, weight : mi.BSDFSample3f, mi.Spectrum
            The first try: direction, and BSDF times cosine divided by its density.

        Returns
        -------
        (bs, weight, factor) : tuple
            The direction, its weight, and the factor of the path's throughput.
        """
        ctx, si, bsdf = mi.BSDFContext(), hit.si, hit.bsdf
        receiver = emitters.receiver(si)
        smooth = hit.goes_on & mi.has_flag(bsdf.flags(), mi.BSDFFlags.Smooth)

        number = dr.float64_array_t(mi.Float)(random_integer(sampler.next_2d())) * 2.0**-32
        panel, seen, probability = self.tree.draw(number, receiver, smooth)
        d, _, density = seen.draw(sampler.next_2d())
        first, distance = self.crossed(receiver.p, d, smooth)
        pdf = bsdf.pdf(ctx, si, si.to_local(d), smooth)
        share = probability * seen.along(d, distance)
        ray = emitters.spawn_ray(si, d)
        in_E = self.leaves(scene, ray, pdf, share, smooth & (first == panel))
        P = dr.select(in_E, pdf / (probability * density), 0)

        leaves = mi.Bool(smooth)
        for _ in range(TRIES - 1):
            leaves &= ~mi.has_flag(bs.sampled_type, mi.BSDFFlags.Delta)
            d = si.to_world(bs.wo)
            panel, distance = self.crossed(receiver.p, d, leaves)
            leaves &= panel < self.count
            seen, share = self.tree.probability(panel, receiver, leaves)
            share *= seen.along(d, distance)
            leaves = self.leaves(scene, emitters.spawn_ray(si, d), bs.pdf, share, leaves)
            again = bsdf.sample(ctx, si, sampler.next_1d(), sampler.next_2d(), leaves)
            bs, weight = dr.select(leaves, again[0], bs), dr.select(leaves, again[1], weight)
        return bs, weight, dr.select(leaves | ~smooth, 1, 1 - P)

    def leaves(self, scene, ray, pdf, share, active) -> mi.Bool:
        """Whether directions of rays that cross a lid are in E.

        pdf: density of the reflection. share: that of the draw toward the lids; both [1/sr].
        """
        active = active & (pdf > 0) & (pdf <= LARGEST_SHARE * share)
        return active & ~scene.ray_test(ray, active)

    @dr.syntax
    def crossed(self, p, d, active) -> tuple[mi.UInt32, mi.Float]:
        """Number of the first panel of the list that a ray crosses, and its distance [m].

        The number of all panels if it crosses none.
        """
        panel, distance, active = mi.UInt32(0), mi.Float(0), mi.Bool(active)
        while dr.hint(active, label="lids"):
            corner, *edges = (
                dr.gather(mi.Vector4f, self.panels.rows, 3 * panel + row).xyz for row in range(3)
            )
            # T. Moeller, B. Trumbore, J. Graph. Tools 2 (1997) 21
            across, to = dr.cross(d, edges[1]), p - corner
            scale, up = dr.rcp(dr.dot(edges[0], across)), dr.cross(to, edges[0])
            u, v = scale * dr.dot(to, across), scale * dr.dot(d, up)
            distance = scale * dr.dot(edges[1], up)
            is_rectangle = dr.gather(mi.UInt32, self.panels.kinds, panel) > 0
            end = dr.select(is_rectangle, dr.maximum(u, v), u + v)
            active &= ~((dr.minimum(u, v) >= 0) & (end <= 1) & (distance > 0))
            panel += dr.select(active, mi.UInt32(1), 0)
            active &= panel < self.count
        return panel, distance


def area(triangles) -> float:
    """Area of triangles, (n, 3, 3) [m^2]."""
    edges = triangles[:, 1:] - triangles[:, :1]
    return 0.5 * float(np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1).sum())


def lid(outline) -> np.ndarray:
    """Triangles between the corners of a closed line, (n, 3), and their centre, (m, 3, 3) [m]."""
    corners = outline[:: -(-len(outline) // MOST_EDGES)]
    centre = np.broadcast_to(corners.mean(axis=0), corners.shape)
    return np.stack([centre, corners, np.roll(corners, -1, axis=0)], axis=1)


def outlines(corners) -> list[np.ndarray]:
    """Closed lines of the edges that belong to one triangle only, each (n, 3) [m].

    corners: those of the triangles, (triangles, 3, 3), Float32. Corners at the same place are one.
    """
    vertices = corners.reshape(-1, 3) + np.float32(0)  # -0 becomes 0, which has other bytes
    # As bytes, which are sorted three times as fast as rows
    _, places, number = np.unique(vertices.view("V12"), return_index=True, return_inverse=True)
    triangles, places = number.reshape(-1, 3), vertices[places]
    edges = np.sort(np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2).reshape(-1, 2))
    edges, count = np.unique(edges[edges[:, 0] != edges[:, 1]], axis=0, return_counts=True)
    return [places[line] for line in loops(edges[count == 1])]

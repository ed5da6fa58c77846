"""Draws a panel by an estimate of what it sends to a point: by a tree of the panels."""

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.plugins.emission.drawing.panels import Panels, norms
from mi_lcair.plugins.emission.drawing.spherical_polygon import Receiver

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
    nodes: see the function `nodes`. sides: for each leaf, the bound of the radiance, and 1 where it
    emits on both sides, 0 elsewhere. least: smallest probability of each panel, (n,), NumPy.
    """

    def __init__(self, panels: Panels):
        power = panels.radiance * panels.area
        self.panels, self.least = panels, ANYWHERE * power / power.sum()
        order = neighbours(panels.corners.mean(axis=1), panels.normal)
        depth = max(int(len(order) - 1).bit_length(), 1)
        leaves, both_sides = power[order] / power.sum(), panels.emits_behind[order]
        rows = nodes(panels.corners[order], panels.normal[order], leaves, both_sides, depth)
        self.nodes = mi.Float(rows.ravel())
        self.powers = mi.Float(of_levels(np.pad(leaves, (0, 2**depth - len(order)))))
        self.sides = mi.Float(np.stack([panels.radiance[order], both_sides], axis=1).ravel())
        self.panel_of, self.leaf_of = mi.UInt32(order), mi.UInt32(np.argsort(order))
        # Opaque, so that one kernel serves all trees
        self.levels, self.count = mi.UInt32(depth), mi.UInt32(len(order))
        dr.make_opaque(*(value for value in vars(self).values() if dr.is_array_v(value)))

    def draw(self, number, receiver: Receiver, active) -> tuple[mi.UInt32, mi.Float]:
        """The panel that a number in 0..1 (Float64) draws, and its probability."""
        anywhere = number < ANYWHERE
        rest = dr.select(anywhere, number / ANYWHERE, (number - ANYWHERE) / (1 - ANYWHERE))
        end = self.descend(receiver, rest, anywhere, None, active)
        leaf = end.node - (1 << self.levels)
        known = active & (leaf < self.count)
        return dr.gather(mi.UInt32, self.panel_of, leaf, known), self.mixed(end, known)

    def probability(self, panel, receiver: Receiver, active) -> mi.Float:
        """Probability with which `draw` draws a panel."""
        number = dr.zeros(dr.float64_array_t(mi.Float), dr.width(panel))
        target = dr.gather(mi.UInt32, self.leaf_of, panel, active) + (1 << self.levels)
        end = self.descend(receiver, number, mi.Bool(False), target, active)
        return self.mixed(end, active)

    def mixed(self, end: Descent, active) -> mi.Float:
        share = dr.gather(mi.Float, self.powers, end.node, active)
        return dr.select(active, dr.lerp(end.probability, share, ANYWHERE), 0)

    @dr.syntax
    def descend(self, receiver: Receiver, number, anywhere, target, active) -> Descent:
        """Go down to the leaf `target`, or, if it is None, to the one that the number draws.

        anywhere: whether a node is drawn by power alone.
        """
        Float64 = dr.float64_array_t(mi.Float)
        way = Descent(Float64(number), mi.UInt32(1), mi.Float(1))
        level = mi.UInt32(self.levels)
        while dr.hint(active & (level > 0), label="light_tree"):
            level -= 1
            left = 2 * way.node
            powers = mi.Vector2f(
                dr.gather(mi.Float, self.powers, left), dr.gather(mi.Float, self.powers, left + 1)
            )
            weights = mi.Vector2f(powers)
            if level == 0:
                first = left - (1 << self.levels)
                weights.x = self.sent_by_panel(first, receiver)
                weights.y = self.sent_by_panel(first + 1, receiver)
            else:
                weights.x = self.sent(left, receiver)
                weights.y = self.sent(left + 1, receiver)
            # Where nothing is known to arrive, by power. A power of 0 is never drawn.
            share = part_of_first(dr.select(weights.x + weights.y > 0, weights, powers))
            by = Float64(dr.select(anywhere, part_of_first(powers), share))
            is_first = way.number < by
            if dr.hint(target is not None, mode="scalar"):
                is_first = ((target >> level) & 1) == 0
            way.number = dr.select(is_first, way.number / by, (way.number - by) / (1 - by))
            way.probability *= dr.select(is_first, share, 1 - share)
            way.node = dr.select(is_first, left, left + 1)
        return way

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

    def sent_by_panel(self, leaf, receiver: Receiver) -> mi.Float:
        """What a panel sends to a receiver: radiance times projected solid angle [W m^-2]."""
        is_leaf = leaf < self.count
        panel = dr.gather(mi.UInt32, self.panel_of, leaf, is_leaf)
        seen = self.panels.seen(panel, receiver, is_leaf)
        radiance, is_two_sided = dr.gather(mi.Vector2f, self.sides, leaf, is_leaf)
        is_front = (seen.distance < 0) | (is_two_sided > 0)
        return dr.select(is_leaf & is_front, radiance * seen.projected, 0)


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


def nodes(corners, normal, power, is_two_sided, depth: int) -> np.ndarray:
    """Spheres around the nodes, and their emission, (nodes, 8).

    corners: (n, 4, 3) [m]. A sphere is its centre and radius [m]. The emission is a vector and a
    number: in a direction of unit length, a node emits its product with the vector where that is
    positive, and the number. The vector is the sum of power times normal. The rest of the power is
    assumed to have random normals: the mean cosine of one side is 1/4, of both 1/2.
    """
    missing = (0, 2**depth - len(power))
    low = np.pad(corners.min(axis=1), [missing, (0, 0)], constant_values=np.inf)
    high = np.pad(corners.max(axis=1), [missing, (0, 0)], constant_values=-np.inf)
    low, high = of_levels(low, np.minimum), of_levels(high, np.maximum)
    is_empty = ~(low <= high).all(axis=1, keepdims=True)
    low, high = (np.where(is_empty, 0, corner) for corner in (low, high))
    radius = 0.5 * norms(high - low)
    of_one, of_both = np.where(is_two_sided, 0, power), np.where(is_two_sided, power, 0)
    preferred = of_levels(np.pad(normal * of_one[:, None], [missing, (0, 0)]))
    of_one, of_both = (of_levels(np.pad(share, missing)) for share in (of_one, of_both))
    rest = np.maximum(of_one - norms(preferred), 0) / 4 + of_both / 2
    columns = 0.5 * (low + high), radius[:, None], preferred, rest[:, None]
    return np.concatenate(columns, axis=1)


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

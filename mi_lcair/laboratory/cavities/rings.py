"""Effective emissivity of a cavity with diffuse walls, from the radiosity of its rings."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from math import cos, pi, sin

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.laboratory.cavities.shape import Shape

# Diffuse exchange between the rings of a convex body of revolution
# -----------------------------------------------------------------
# Two coaxial discs of radii a and b at a distance h exchange radiation over the area
#
#     A_a F_ab = pi/2 (X - sqrt(X^2 - 4 a^2 b^2)),    X = a^2 + b^2 + h^2
#
# (Howell, A Catalog of Radiation Heat Transfer Configuration Factors, C-41). What passes between
# two rings of a convex wall passes the discs between them. Their exchange is therefore a difference
# of those of the discs at their edges, and exact for a curved wall too.


def disc_exchange(a, b, h):
    """Exchange area of two coaxial discs of radii a and b at a distance h, of the unit a^2."""
    X = a**2 + b**2 + h**2
    root = np.sqrt(((a - b) ** 2 + h**2) * ((a + b) ** 2 + h**2))
    return 2 * pi * (a * b) ** 2 / np.maximum(X + root, 1e-300)


def ring_exchange(nodes: np.ndarray, areas: np.ndarray) -> np.ndarray:
    """View factors between rings, (n, n): the share of each row's radiation that reaches a column.

    nodes: radii and depths of the n + 1 circles that bound the rings [m], in order. areas: of the
    rings [m^2]. What is missing to 1 in a row leaves through the first disc, the aperture.
    """
    r, z = nodes
    G = disc_exchange(r[:, None], r, z[:, None] - z)
    # Between rings i < j: G(i+1, j) - G(i+1, j+1) - G(i, j) + G(i, j+1)
    between = np.triu(G[1:, :-1] - G[1:, 1:] - G[:-1, :-1] + G[:-1, 1:], 1)
    discs = pi * r**2
    within = areas - (discs[1:] + discs[:-1] - 2 * np.diagonal(G, 1))
    return (between + between.T + np.diag(within)) / areas[:, None]


# How a cavity is viewed: which rays through the aperture count, and how much each
# --------------------------------------------------------------------------------
# All rays pass a spot in the aperture, a circle about the axis. Depths and radii are in m.


@dataclass(frozen=True)
class CavityView(ABC):
    """Rays through a spot of a radius [m]."""

    spot: float

    @abstractmethod
    def passed(self, r: np.ndarray, z: np.ndarray) -> np.ndarray:
        """Share of the rays that pass discs of radius r about the axis, at depths z [m]."""

    @abstractmethod
    def ray(self, place: mi.Point2f, sample: mi.Point2f) -> tuple[mi.Point3f, mi.Vector3f]:
        """Place in the aperture's plane and direction of rays, from two points in 0..1."""

    def on_spot(self, place: mi.Point2f) -> mi.Point3f:
        """An evenly distributed place in the spot."""
        p = mi.warp.square_to_uniform_disk_concentric(place) * self.spot
        return mi.Point3f(p.x, p.y, 0)


class HemisphereView(CavityView):
    """Rays of all directions: the radiant exitance of the spot."""

    def passed(self, r, z):
        return disc_exchange(self.spot, r, z) / (pi * self.spot**2)

    def ray(self, place, sample):
        return self.on_spot(place), mi.warp.square_to_cosine_hemisphere(sample)


@dataclass(frozen=True)
class Beam(CavityView):
    """Parallel rays at an angle to the axis [rad]."""

    angle: float = 0.0

    def passed(self, r, z):
        return common_area(self.spot, r, z * np.tan(self.angle)) / (pi * self.spot**2)

    def ray(self, place, sample):
        return self.on_spot(place), mi.Vector3f(sin(self.angle), 0, cos(self.angle))


@dataclass(frozen=True)
class Cone(CavityView):
    """Rays to a point on the axis, at a distance [m] in front of the aperture.

    They count as in an irradiance on a small detector that faces the aperture.
    """

    distance: float = 0.0

    def passed(self, r, z):
        return np.minimum(sin_squared(r, self.distance + z) / self.most, 1)

    @property
    def most(self) -> float:
        """Squared sine of the angle of the outermost rays."""
        return sin_squared(self.spot, self.distance)

    def ray(self, place, sample):
        disc = mi.warp.square_to_uniform_disk_concentric(place) * float(np.sqrt(self.most))
        direction = mi.Vector3f(disc.x, disc.y, dr.sqrt(1 - dr.squared_norm(disc)))
        start = direction * (self.distance / direction.z)
        return mi.Point3f(start.x, start.y, 0), direction


def sin_squared(r, distance):
    """Squared sine of the angle under which a radius appears from a point on the axis."""
    return r**2 / (r**2 + distance**2)


def common_area(a: float, b: np.ndarray, distance: np.ndarray) -> np.ndarray:
    """Area that two circles of radii a and b share, their centres a distance apart."""
    b, d = np.broadcast_arrays(np.asarray(b, float), distance)
    crosses = (d < a + b) & (d > abs(a - b)) & (b > 0)
    d_, b_ = np.where(crosses, d, a), np.where(crosses, b, a)

    def segment(radius, other):
        cosine = np.clip((d_**2 + radius**2 - other**2) / (2 * d_ * radius), -1, 1)
        return radius**2 * (np.arccos(cosine) - cosine * np.sqrt(1 - cosine**2))

    within = pi * np.where(d >= a + b, 0, np.minimum(a, b)) ** 2
    return np.where(crosses, segment(a, b_) + segment(b_, a), within)


FIRST = 40  # rings of each straight part of the wall at first; their number is doubled
MOST = 2400  # largest number of rings of the whole wall
ENOUGH = 5e-6  # error from which on the rings are not doubled again
GAUSS = np.polynomial.legendre.leggauss(4)  # places in a ring at which its emission is averaged


def effective_emissivity(shape: Shape, emissivity: float, emission, view: CavityView) -> tuple:
    """Effective emissivity of a diffuse wall, and its numerical error.

    The radiosity of ring i is J_i = epsilon B_i + (1 - epsilon) sum_j F_ij J_j (thesis 3.5.2).

    Parameters
    ----------
    shape : Shape
    emissivity : float
        Emissivity of the wall, at all wavelengths of `emission`.
    emission : callable
        Blackbody radiance at depths [m] as a ratio to that at the reference: (n,) to (n, w).
    view : View

    Returns
    -------
    value, error : ndarray, shape (w,)
        For the wavelengths of `emission`.
    """
    counts = [FIRST, 2 * FIRST]
    values = [of_rings(shape, emissivity, emission, view, count) for count in counts]
    while True:
        counts.append(2 * counts[-1])
        values.append(of_rings(shape, emissivity, emission, view, counts[-1]))
        # The error falls as the square of the rings' width. Where the edge of the view crosses a
        # ring, one difference may be small by chance, but not two.
        error = np.max([abs(b - a) for a, b in zip(values[-3:], values[-2:])], axis=0)
        if error.max() <= ENOUGH or 2 * counts[-1] * shape.parts > MOST:
            return values[-1] + (values[-1] - values[-2]) / 3, error


def of_rings(shape: Shape, emissivity: float, emission, view: CavityView, count: int) -> np.ndarray:
    """Effective emissivity with a number of rings for each straight part of the wall."""
    nodes = shape.nodes(count)
    areas = shape.areas(nodes)
    weight = -np.diff(view.passed(*nodes))
    x, w = GAUSS
    z = nodes[1]
    depths = (z[1:] + z[:-1])[:, None] / 2 + np.diff(z)[:, None] / 2 * x
    B = np.einsum("ikw,k->iw", emission(depths.ravel()).reshape(*depths.shape, -1), w / 2)
    matrix = np.eye(len(areas)) - (1 - emissivity) * ring_exchange(nodes, areas)
    return weight @ np.linalg.solve(matrix, emissivity * B)


# Method of Gouffé for the emissivity of a cavity (thesis 3.6, Eqs 3.10-3.12, Table 3.3)
# --------------------------------------------------------------------------------------


def cavity_emissivity(emissivity: float, s: float, S: float) -> float:
    """Emissivity epsilon_0' of a cavity (Eq 3.12), exact for a diffuse sphere.

    emissivity: that of the wall. s: area of the aperture. S: area of the wall and the aperture.
    """
    return emissivity / (emissivity * (1 - s / S) + s / S)


def shape_term(emissivity: float, s: float, S: float, S0: float) -> float:
    """Correction k for the shape (Eq 3.11). S0: area of a sphere of the cavity's depth."""
    return (1 - emissivity) * (s / S - s / S0)


def gouffe(emissivity: float, s: float, S: float, S0: float) -> float:
    """Total emissivity epsilon_0 of a cavity (Eq 3.10)."""
    return cavity_emissivity(emissivity, s, S) * (1 + shape_term(emissivity, s, S, S0))

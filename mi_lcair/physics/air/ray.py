"""Rays through the air, bent by refraction, over a round Earth; layers along them.

Along a ray n (R + h) cos(elevation) is constant (Bouguer), with the refractive index n at the
height h. With u = n (R + h) this is u^2 = p^2 + x^2, where x = u sin(elevation) rises along the ray
from negative values before its lowest point to positive ones after it. The length follows from
ds = dx / (du/dh), which is smooth at the lowest point, too.
"""

from dataclasses import dataclass

import numpy as np

from mi_lcair.physics.air.levels import EARTH_KM, Levels

FIRST_KM, GROWTH = 0.005, 0.2  # length of the first layer, and of the others per distance
THICKEST_KM, THICKEST_HIGH_KM, HIGH_KM = 0.5, 2.0, 30.0  # vertical extent of a layer; above HIGH_KM
SAMPLES = 400  # places along a ray from which its layers are chosen
TOP_KM = 100.0
# Nodes and weights over 0..1, in a layer for its amounts, and over a whole ray for its length
(NODES, WEIGHTS), (LONG_NODES, LONG_WEIGHTS) = (
    ((1 + nodes) / 2, weights / 2)
    for nodes, weights in map(np.polynomial.legendre.leggauss, (3, 32))
)


@dataclass(frozen=True, eq=False)
class Ray:
    """A ray from a viewer, in layers that grow with the distance from the viewer.

    Attributes
    ----------
    lengths_km
        Distances of the layers' edges along the ray [km], (n + 1,), from 0.
    heights_km, elevations_deg
        Height above the ground [km] and elevation of the ray [degrees] at the edges, (n + 1,).
    turned_deg
        Angle at the Earth's centre between the viewer and each edge [degrees], (n + 1,).
    temperatures
        Mean temperature of each layer by mass [K], (n,).
    amounts
        Amounts of the absorbers from the viewer to each edge, (n + 1, c).
    """

    lengths_km: np.ndarray
    heights_km: np.ndarray
    elevations_deg: np.ndarray
    turned_deg: np.ndarray
    temperatures: np.ndarray
    amounts: np.ndarray


def ray(levels: Levels, height_km: float, elevation_deg: float, length_km: float = np.inf) -> Ray:
    """The ray from a height in a direction, up to a length, the ground or the top of the air.

    Parameters
    ----------
    levels
        The air.
    height_km
        Height of the viewer [km], 0..100.
    elevation_deg
        Apparent elevation at the viewer [degrees], -90..90.
    length_km
        Length of the ray [km]. The ray ends before if it meets the ground or leaves the air.
    """
    path = Path(levels, height_km, elevation_deg)
    edges = path.edges(length_km)
    starts, steps = edges[:-1], np.diff(edges)
    x = starts[:, None] + steps[:, None] * NODES
    heights, per_x = path.at(x)
    densities, temperature, pressure = levels.at(heights)
    lengths = steps[:, None] * WEIGHTS * per_x
    amounts = np.einsum("ng,ngc->nc", lengths, densities)
    mass = lengths * pressure / temperature
    at_edges, _ = path.at(edges)
    u = np.hypot(path.perigee, edges)
    # d(angle) = cos(elevation) ds / (R + h)
    turned = (lengths * path.perigee / np.hypot(path.perigee, x) / (EARTH_KM + heights)).sum(axis=1)
    return Ray(
        np.append(0, np.cumsum(lengths.sum(axis=1))),
        at_edges,
        np.degrees(np.arcsin(np.clip(edges / u, -1, 1))),
        np.degrees(np.append(0, np.cumsum(turned))),
        (mass * temperature).sum(axis=1) / mass.sum(axis=1),
        np.vstack([np.zeros(amounts.shape[1]), np.cumsum(amounts, axis=0)]),
    )


def ray_end(
    levels: Levels, height_km: float, elevation_deg: float, length_km: float
) -> tuple[float, float, float]:
    """Length [km], height [km] and elevation [degrees] at the end of a ray, see `ray`."""
    path = Path(levels, height_km, elevation_deg)
    x = max(min(path.end(), path.place(length_km)), path.start)
    (height,), _ = path.at(np.array([x]))
    elevation = np.degrees(np.arctan2(x, path.perigee))
    return path.length(x)[0], min(float(height), TOP_KM), float(elevation)


class Path:
    """The way of a ray in its coordinate x, see the module."""

    def __init__(self, levels: Levels, height_km: float, elevation_deg: float):
        self.levels, self.start_km = levels, height_km
        index, _ = levels.refraction(np.array(height_km))
        u = (1 + float(index)) * (EARTH_KM + height_km)
        elevation = np.radians(elevation_deg)
        self.perigee, self.start = u * np.cos(elevation), u * np.sin(elevation)

    def at(self, x) -> tuple[np.ndarray, np.ndarray]:
        """Heights [km] at coordinates x [km], and lengths along the ray per x."""
        u = np.hypot(self.perigee, x)
        heights = u - EARTH_KM
        # u (h) is inverted by Newton's method; refraction lowers the first guess by 2 km at most
        for _ in range(3):
            index, slope = self.levels.refraction(np.clip(heights, 0, TOP_KM))
            per_height = 1 + index + (EARTH_KM + heights) * slope
            heights = heights - ((1 + index) * (EARTH_KM + heights) - u) / per_height
        return np.maximum(heights, 0), 1 / per_height

    def edges(self, length_km: float) -> np.ndarray:
        """Coordinates of the layers' edges [km], (n + 1,), for a ray of at most a length [km]."""
        end = self.end()
        if np.isfinite(length_km):
            end = min(end, self.place(length_km))
        if end <= self.start:
            return np.array([self.start, self.start])
        # Sampling that is fine near the viewer
        share = np.linspace(0, 1, SAMPLES)
        near = FIRST_KM * np.expm1(share * np.log1p((end - self.start) / FIRST_KM))
        x = self.start + np.sort(np.concatenate([near, (end - self.start) * share[1:-1]]))
        heights, per_x = self.at(x)
        thickest = np.where(heights[1:] > HIGH_KM, THICKEST_HIGH_KM, THICKEST_KM)
        distance = np.maximum(x[1:] - self.start, 0)
        layers = np.log1p(GROWTH * distance / FIRST_KM) / np.log1p(GROWTH)
        layers = layers + np.cumsum(np.abs(np.diff(heights)) / thickest)
        layers = np.append(0, layers)
        count = max(int(np.ceil(layers[-1])), 1)
        return np.interp(np.linspace(0, layers[-1], count + 1), layers, x)

    def place(self, length_km: float) -> float:
        """Coordinate x [km] at a length from the viewer."""
        x = self.start + length_km
        for _ in range(3):  # Newton's method; x rises by 0.8..1 per length
            length, per_x = self.length(x)
            x -= (length - length_km) / per_x
        return x

    def length(self, x: float) -> tuple[float, float]:
        """Length from the viewer to the coordinate x [km], and its derivative."""
        _, per_x = self.at(self.start + (x - self.start) * np.append(LONG_NODES, 1.0))
        return float(per_x[:-1] @ LONG_WEIGHTS) * (x - self.start), float(per_x[-1])

    def end(self) -> float:
        """Coordinate at which the ray meets the ground or leaves the air [km]."""
        index, _ = self.levels.refraction(np.array([0.0, TOP_KM]))
        ground, top = (1 + index) * (EARTH_KM + np.array([0.0, TOP_KM]))
        if self.start < 0 and self.perigee < ground:
            return -np.sqrt((ground - self.perigee) * (ground + self.perigee))
        return np.sqrt(max((top - self.perigee) * (top + self.perigee), 0))

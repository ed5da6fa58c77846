"""Effective emissivity of diffuse bodies of revolution by the integral equation of their meridian.

It knows nothing of discs: the kernel is the cosine law, integrated over the azimuth. Source:
Howell, Menguc, Siegel, Thermal Radiation Heat Transfer, integral equation of diffuse enclosures.
"""

from functools import lru_cache

import numpy as np

ANGLES = 240  # azimuths, dense near 0
NODES = 48  # places on each straight part, dense at its ends


def places(corners):
    """Places on the meridian, their normals to the inside, their areas, and their number."""
    x, w = np.polynomial.legendre.leggauss(NODES)
    u, du = (x + 1) / 2, w / 2
    t = u**3 * (10 - 15 * u + 6 * u**2)  # dense at both ends
    dt = 30 * u**2 * (1 - u) ** 2 * du
    r, z, n_r, n_z, area = [], [], [], [], []
    for (r0, z0), (r1, z1) in zip(corners, corners[1:]):
        length = np.hypot(r1 - r0, z1 - z0)
        radius = r0 + (r1 - r0) * t
        r.append(radius)
        z.append(z0 + (z1 - z0) * t)
        # The walk goes from the aperture over the wall to the axis; the inside is on its right
        n_r.append(np.full(NODES, -(z1 - z0) / length))
        n_z.append(np.full(NODES, (r1 - r0) / length))
        area.append(2 * np.pi * radius * length * dt)
    return map(np.concatenate, (r, z, n_r, n_z, area))


def kernel(r, z, n_r, n_z, other):
    """Mean over the azimuth of cos cos' / (pi d^2) between places and other rings, [1/m^2]."""
    r2, z2, m_r, m_z = other
    u, w = np.polynomial.legendre.leggauss(ANGLES)
    u, w = (u + 1) / 2, w / 2
    phi, weight = np.pi * u**3, 3 * u**2 * w  # of 0..pi, with the mean over it
    result = np.empty((len(r), len(r2)))
    for k in range(len(r)):
        x = r2[:, None] * np.cos(phi) - r[k]
        y = r2[:, None] * np.sin(phi)
        h = (z2 - z[k])[:, None]
        d2 = x**2 + y**2 + h**2
        here = n_r[k] * x + n_z[k] * h
        there = -(m_r[:, None] * (np.cos(phi) * x + np.sin(phi) * y) + m_z[:, None] * h)
        result[k] = (np.maximum(here * there, 0) / (np.pi * np.maximum(d2, 1e-30) ** 2)) @ weight
    return result


@lru_cache(maxsize=1)
def enclosure(corners):
    """Places on the wall (r, z), their areas, their exchange, and the aperture's view factor."""
    r, z, n_r, n_z, area = places(corners)
    K = kernel(r, z, n_r, n_z, (r, z, n_r, n_z)) * area
    a = corners[0][0]
    x, w = np.polynomial.legendre.leggauss(120)
    u = (x + 1) / 2
    radii, weight = a * (1 - u**4), a * 2 * u**3 * w  # dense at the edge
    disc = (radii, np.zeros(120), np.zeros(120), np.ones(120))
    escaping = kernel(r, z, n_r, n_z, disc) @ (2 * np.pi * radii * weight)
    # Where the kernel is singular, only differences of radiosity count: the rows add up to 1
    np.fill_diagonal(K, 0)
    np.fill_diagonal(K, 1 - escaping - K.sum(axis=1))
    return r, z, area, K, escaping


def radiosity(corners, emissivity, emission):
    """Places on the wall (r, z), their areas, the radiosity there, and the aperture's view factor.

    corners: from the aperture's edge to the axis. emission: blackbody radiance by depth.
    """
    r, z, area, K, escaping = enclosure(tuple(corners))
    B = emission(z)
    J = np.linalg.solve(np.eye(len(r)) - (1 - emissivity) * K, emissivity * B)
    return r, z, area, J, escaping


def hemispherical(corners, emissivity, emission):
    """Effective emissivity of the aperture for all directions."""
    _, _, area, J, escaping = radiosity(corners, emissivity, emission)
    return float(np.sum(area * escaping * J) / (np.pi * corners[0][0] ** 2))


def normal(corners, emissivity, emission):
    """Effective emissivity of the aperture along the axis."""
    r, z, area, J, _ = radiosity(corners, emissivity, emission)
    last = slice(len(r) - NODES, None)  # the bottom, or the cone
    (r0, z0), (r1, z1) = corners[-2:]
    seen = r[last] <= corners[0][0]
    projected = area[last] * abs(r1 - r0) / np.hypot(r1 - r0, z1 - z0)
    if seen.all():
        return float(np.sum(projected * J[last]) / np.sum(projected))
    order = np.argsort(r[last])
    x, w = np.polynomial.legendre.leggauss(40)
    radii = corners[0][0] * (x + 1) / 2
    from scipy.interpolate import CubicSpline

    return float(CubicSpline(r[last][order], J[last][order])(radii) @ (radii * w) / (radii @ w))

"""Exact answers of the bundled scenes, independent of the renderer. SI units; band radiances L in W m^-2 sr^-1."""
from math import cos, pi, radians

import numpy as np
from scipy.integrate import dblquad

PLATE_AREA = 0.2 * 0.1  # m^2, thesis Appendix A.1
CAVITY_RADIUS = 0.5     # m, thesis 3.2.3.1
GREY = 0.5              # emissivity of the cavity's walls and of the open box's floor
CAVITY_BLOCKS = {2: (2, 1), 4: (2, 2), 8: (4, 2), 16: (4, 4), 24: (6, 4), 36: (6, 6), 60: (10, 6), 80: (10, 8)}


def perpendicular_view_factor(edge, height, depth):
    """View factor from a rectangle edge x height to a rectangle edge x depth at right angles to it, sharing `edge` (m).

    By quadrature: two elements that face each other's plane have the kernel z x / (pi s^4), s^2 = x^2 + z^2 + (y - y')^2
    (Howell, Menguc, Daun, Thermal Radiation Heat Transfer, chapter 5). Over x' = depth and over y - y' = u the integral
    is elementary or weighed by (edge - |u|); what is left, over z and u, is smooth but for a logarithm at the corner.
    """
    def over_depth(u, z):
        near, far = z * z + u * u, z * z + u * u + depth * depth
        return z * (1 / near - 1 / far) * (edge - u)  # = 2 z times the integral of x / s^4 dx, times the weight of u

    # twice for u < 0; the kernel's z / (z^2 + u^2) is integrable but steep at the corner, so z is split there
    parts = [(0, 1e-6), (1e-6, 1e-4), (1e-4, 1e-2), (1e-2, height)]
    total = sum(dblquad(over_depth, a, b, 0, edge, epsabs=1e-13, epsrel=1e-11)[0] for a, b in parts)
    return total / (pi * edge * height)


def two_plates_intensity(L_800):
    """Intensity [W/sr] of scene two_plates, from the blackbody's band radiance at 800 K (thesis Appendix A.1)."""
    return L_800 * PLATE_AREA * perpendicular_view_factor(0.1, 0.2, 0.2)


def open_box_intensity(L_800, L_300):
    """Intensity [W/sr] of scene open_box, from the blackbody's band radiance at 800 K and 300 K (thesis Appendix A.2)."""
    reflected = (1 - GREY) * L_800 * perpendicular_view_factor(0.2, 0.1, 0.1)
    return cos(radians(45)) * PLATE_AREA * (reflected + GREY * L_300)


def cavity_opening_fraction(opening):
    """Share of the true sphere's surface that the opening's block covers: (cos top - cos bottom) x columns / 20 / 2."""
    rows, columns = CAVITY_BLOCKS[opening]
    top = pi / 2 - rows / 2 * pi / 20
    return 2 * cos(top) * columns / 20 / 2


def cavity_emissivity(opening, max_bounces=None):
    """Radiance of a spherical cavity in units of the blackbody's, after max_bounces reflections (None: the limit, Eq 3.12)."""
    kept = (1 - GREY) * (1 - cavity_opening_fraction(opening))
    bounces = np.inf if max_bounces is None else max_bounces
    return GREY * (1 - kept ** (bounces + 1)) / (1 - kept)

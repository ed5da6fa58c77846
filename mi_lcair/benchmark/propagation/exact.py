"""Exact answers of the bundled scenes, independent of the renderer. SI units; band radiances L in W
m^-2 sr^-1.
"""

from math import atan, cos, inf, log, pi, radians, sqrt

PLATE_AREA = 0.2 * 0.1  # m^2, thesis Appendix A.1
CAVITY_RADIUS = 0.5  # m, thesis 3.2.3.1
GREY = 0.5  # emissivity of the cavity's walls and of the open box's floor
CAVITY_BLOCKS = {
    2: (2, 1),
    4: (2, 2),
    8: (4, 2),
    16: (4, 4),
    24: (6, 4),
    36: (6, 6),
    60: (10, 6),
    80: (10, 8),
}


def perpendicular_view_factor(edge, height, depth):
    """View factor from a rectangle edge x height to a rectangle edge x depth at right angles to it,
    sharing `edge` (m).

    Closed form: Howell, A Catalog of Radiation Heat Transfer Configuration Factors, C-14.
    """
    h, w = depth / edge, height / edge
    h2, w2, s2 = h * h, w * w, h * h + w * w
    logarithms = (
        log((1 + w2) * (1 + h2) / (1 + s2))
        + w2 * log(w2 * (1 + s2) / ((1 + w2) * s2))
        + h2 * log(h2 * (1 + s2) / ((1 + h2) * s2))
    )
    return (w * atan(1 / w) + h * atan(1 / h) - sqrt(s2) * atan(1 / sqrt(s2)) + logarithms / 4) / (
        pi * w
    )


def two_plates_intensity(L_800):
    """Intensity [W/sr] of scene two_plates, from the blackbody's band radiance at 800 K (thesis
    Appendix A.1).
    """
    return L_800 * PLATE_AREA * perpendicular_view_factor(0.1, 0.2, 0.2)


def open_box_intensity(L_800, L_300):
    """Intensity [W/sr] of scene open_box, from the blackbody's band radiance at 800 K and 300 K
    (thesis Appendix A.2).
    """
    reflected = (1 - GREY) * L_800 * perpendicular_view_factor(0.2, 0.1, 0.1)
    return cos(radians(45)) * PLATE_AREA * (reflected + GREY * L_300)


def cavity_opening_fraction(opening):
    """Share of the true sphere's surface that the opening's block covers: (cos top - cos bottom) x
    columns / 20 / 2.
    """
    rows, columns = CAVITY_BLOCKS[opening]
    top = pi / 2 - rows / 2 * pi / 20
    return 2 * cos(top) * columns / 20 / 2


def cavity_emissivity(opening, max_bounces=None):
    """Radiance of a spherical cavity in units of the blackbody's, after max_bounces reflections
    (None: the limit, Eq 3.12).
    """
    kept = (1 - GREY) * (1 - cavity_opening_fraction(opening))
    bounces = inf if max_bounces is None else max_bounces
    return GREY * (1 - kept ** (bounces + 1)) / (1 - kept)

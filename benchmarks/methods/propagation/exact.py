"""Exact answers of the bundled scenes, computed without the renderer.

Lengths are in m. Radiances L are in-band radiances of a blackbody in W m^-2 sr^-1.
"""

from math import atan, cos, inf, log, pi, radians, sqrt

PLATE_AREA = 0.2 * 0.1  # m^2, thesis Appendix A.1
CAVITY_RADIUS = 0.5  # m, thesis 3.2.3.1
GREY = 0.5  # emissivity of the cavity's walls and of the open box's floor
# Facets removed -> (rows, columns) of the block of facets that makes the opening, thesis Table B.1.
BLOCKS = (2, 1), (2, 2), (4, 2), (4, 4), (6, 4), (6, 6), (10, 6), (10, 8)
CAVITY_BLOCKS = {rows * columns: (rows, columns) for rows, columns in BLOCKS}


def perpendicular_view_factor(edge, height, depth):
    """View factor between two perpendicular rectangles with a common edge.

    Parameters
    ----------
    edge
        Length of the common edge [m].
    height
        Other side of the rectangle that the radiation leaves [m].
    depth
        Other side of the rectangle that receives it [m].

    Returns
    -------
    float
        Share of the radiation from the first rectangle that reaches the second.

    Source: Howell, A Catalog of Radiation Heat Transfer Configuration Factors, C-14.
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
    """Intensity [W/sr] of the scene two_plates (thesis Appendix A.1).

    L_800: in-band radiance of a blackbody at 800 K [W m^-2 sr^-1].
    """
    return L_800 * PLATE_AREA * perpendicular_view_factor(0.1, 0.2, 0.2)


def open_box_intensity(L_800, L_300):
    """Intensity [W/sr] of the scene open_box (thesis Appendix A.2).

    L_800, L_300: in-band radiances of a blackbody at 800 K and 300 K [W m^-2 sr^-1].
    """
    reflected = (1 - GREY) * L_800 * perpendicular_view_factor(0.2, 0.1, 0.1)
    return cos(radians(45)) * PLATE_AREA * (reflected + GREY * L_300)


def cavity_opening_fraction(opening):
    """Share of the sphere's surface that the opening covers.

    opening: number of facets removed. On the sphere the block covers (cos top - cos bottom) / 2 x
    columns / 20 of the surface. top and bottom are its colatitudes.
    """
    rows, columns = CAVITY_BLOCKS[opening]
    top = pi / 2 - rows / 2 * pi / 20
    return 2 * cos(top) * columns / 20 / 2


def cavity_emissivity(opening, max_bounces=None):
    """Radiance of a spherical cavity divided by the blackbody's radiance (Eq 3.12).

    opening: number of facets removed. max_bounces: reflections that are counted, or None for the
    limit of infinitely many.
    """
    kept = (1 - GREY) * (1 - cavity_opening_fraction(opening))
    bounces = inf if max_bounces is None else max_bounces
    return GREY * (1 - kept ** (bounces + 1)) / (1 - kept)

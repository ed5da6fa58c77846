"""Float32's rounding along a path: the error below which no number of samples brings a radiance."""

from math import sqrt

UNIT = 2.0**-24  # the largest relative error of one rounding
OPERATIONS = 8  # roundings of a path's radiance at each reflection: of weights, products and a sum


def rounding_error(reflections: int) -> float:
    """Relative rms error of a radiance that was reflected so many times.

    Each rounding is taken to be off by anything up to UNIT, independently of the others. Paths that
    are alike, as in an isothermal room, share their roundings: the mean over many of them is no
    better than one.
    """
    return UNIT * sqrt(OPERATIONS * (reflections + 1) / 3)

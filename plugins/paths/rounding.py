"""Error of a radiance from Float32 rounding along a path, which more samples do not reduce."""

from math import sqrt

UNIT = 2.0**-24  # the largest relative error of one rounding
OPERATIONS = 8  # roundings at each reflection of a path: in weights, in products and in a sum


def rounding_error(reflections: int) -> float:
    """Relative rms error of a radiance after this number of reflections.

    The error of each rounding is assumed to be uniform up to UNIT and independent of the others. In
    an isothermal room all paths are alike and round in the same way. The mean over many paths then
    has the same error as one path.
    """
    return UNIT * sqrt(OPERATIONS * (reflections + 1) / 3)

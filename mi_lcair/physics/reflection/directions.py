"""Directions in the frame of a surface, whose z axis is the normal.

They are Dr.Jit 3-vectors of any float type.
"""

import drjit as dr

# Smallest denominator. It replaces 0 where a quotient has a removable limit. Its square, which
# occurs in derivatives, is a normal Float32 number.
SMALLEST = 1e-18


def cos_theta(w):
    """Cosine of the angle between direction w and the normal; 0 below the horizon."""
    return dr.maximum(w.z, 0)


def sin2_theta(w):
    """Squared sine of the angle between direction w and the normal."""
    return dr.square(w.x) + dr.square(w.y)


def sample_cosine(Vector, u1, u2):
    """A random direction with density cos(theta) / pi [1/sr], of the type Vector.

    u1, u2: uniform random numbers in 0..1. u1 gives the azimuth, as in the sampling of lobes;
    the compiler then computes its sine and cosine once for both.
    """
    sin_phi, cos_phi = dr.sincos(dr.two_pi * u1)
    radius = dr.sqrt(u2)
    return Vector(radius * cos_phi, radius * sin_phi, dr.safe_sqrt(1 - u2))

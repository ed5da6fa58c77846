"""Directions in the frame of a surface, z along its normal, as Dr.Jit 3-vectors of any float type."""

import drjit as dr

# Keeps 0/0 out of limits that are 0 or 1. Its square, in derivatives, is a normal Float32 number.
SMALLEST = 1e-18


def cos_theta(w):
    """Cosine to the normal, 0 below the horizon."""
    return dr.maximum(w.z, 0)


def sin2_theta(w):
    return dr.square(w.x) + dr.square(w.y)


def sample_cosine(Vector, u1, u2):
    """A direction of density cos(theta) / pi; shares its azimuth, and so its sine and cosine, with
    `sample_half_vector`.
    """
    sin_phi, cos_phi = dr.sincos(dr.two_pi * u1)
    radius = dr.sqrt(u2)
    return Vector(radius * cos_phi, radius * sin_phi, dr.safe_sqrt(1 - u2))

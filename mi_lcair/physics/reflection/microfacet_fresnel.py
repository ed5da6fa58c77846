"""Fresnel's equations for unpolarised radiation in air on a surface of refractive index n + ik.

With p the cosine of the angle of incidence and s^2 = 1 - p^2, let (a + ib)^2 = (n + ik)^2 - s^2.

    R_s = ((a - p)^2 + b^2) / ((a + p)^2 + b^2)                               perpendicular
    R_p = R_s Q,  Q = ((a p - s^2)^2 + b^2 p^2) / ((a p + s^2)^2 + b^2 p^2)   parallel
    F = (R_s + R_p) / 2,  1 - F = (1 - R_s) + R_s (1 - Q) / 2

(Born and Wolf, Principles of Optics, 1.5 and 14.2; k = 0 for dielectrics.) No small number is
computed as the difference of large ones. The larger of a and b is a square root, and the smaller
follows from a b = n k. a - p is computed as ((n^2 - 1 - k^2) + b^2) / (a + p). 1 - R_s and 1 - Q
are computed as products.
"""

import drjit as dr

# Smallest cosine. Its fourth power is a normal Float32 number. At this cosine F differs from 1 by
# less than the rounding of Float32.
GRAZING = 1e-9


def reflectance(cos, contrast, nk):
    """Fresnel reflectance F at the cosine `cos`, 0..1, of the angle of incidence.

    contrast = n^2 - 1 - k^2 and nk = n k, with n >= 1, should be computed in Float64.
    """
    R_s, Q, _, _ = polarised(cos, contrast, nk)
    return 0.5 * R_s * (1 + Q)


def transmittance(cos, contrast, nk):
    """1 - F, computed without cancellation; arguments as in `reflectance`."""
    R_s, _, one_minus_R_s, one_minus_Q = polarised(cos, contrast, nk)
    return one_minus_R_s + 0.5 * R_s * one_minus_Q


def polarised(cos, contrast, nk):
    """R_s, Q, 1 - R_s and 1 - Q of the module's equations; arguments as in `reflectance`."""
    p = dr.clip(cos, GRAZING, 1)
    p2 = dr.square(p)
    s2 = 1 - p2
    real = contrast + p2
    larger = dr.sqrt(0.5 * (dr.sqrt(dr.square(real) + 4 * dr.square(nk)) + dr.abs(real)))
    smaller = nk / larger
    refracted = real >= 0
    a, b = dr.select(refracted, larger, smaller), dr.select(refracted, smaller, larger)
    b2 = dr.square(b)
    inverse_s = 1 / (dr.square(a + p) + b2)
    inverse_p = 1 / (dr.square(a * p + s2) + b2 * p2)
    R_s = (dr.square((contrast + b2) / (a + p)) + b2) * inverse_s
    Q = (dr.square(a * p - s2) + b2 * p2) * inverse_p
    return R_s, Q, 4 * a * p * inverse_s, 4 * a * p * s2 * inverse_p

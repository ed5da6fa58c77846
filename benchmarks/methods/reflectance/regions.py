"""The two regions into which the thesis divides the hemisphere (3.3.2.2): peak and rest.

The peak region spans 10 degrees in theta and 20 degrees in phi to each side of the specular
direction. It ends at the normal and at the horizon. Each region is the image of the unit square
under a map that is uniform in theta_r and phi_r.
"""

import drjit as dr
from drjit.llvm import Float64

from benchmarks.methods.reflectance.problem import direction

HALF_THETA, HALF_PHI = dr.pi / 18, dr.pi / 9
PEAK_SHARE = HALF_PHI / dr.pi  # share of all azimuths that the peak region covers
REST_PER_PEAK = 50 / 80  # ratio of samples per dimension, rest to peak, as in the thesis (3.3.3)


def in_peak(problem, u_theta, u_phi):
    """Return directions r in the peak region, and their weights [sr].

    u_theta, u_phi: coordinates in the unit square. The weight is
    sin(theta) dtheta dphi / (du_theta du_phi).
    """
    low, high = peak_elevations(problem)
    theta = dr.lerp(low, high, u_theta)
    phi = dr.pi + HALF_PHI * (2 * u_phi - 1)
    return direction(theta, phi), dr.sin(theta) * (high - low) * (2 * HALF_PHI)


def in_rest(problem, u_theta, u_phi, beside_share, below_share):
    """Return directions r in the rest of the hemisphere, and their weights [sr], as `in_peak` does.

    Points with u_phi < beside_share lie in the azimuths of the peak region. Among them those with
    u_theta < below_share have a smaller theta than the peak region, the others a larger one.
    """
    low, high = peak_elevations(problem)
    horizon = Float64(0.5 * dr.pi)
    beside = u_phi < beside_share
    below = u_theta < below_share
    theta, height = stretch(u_theta, 0, 1, Float64(0), horizon)
    for strip, ends in (
        (below, (0, below_share, Float64(0), low)),
        (~below, (below_share, 1, high, horizon)),
    ):
        strip_theta, strip_height = stretch(u_theta, *ends)
        theta = dr.select(beside & strip, strip_theta, theta)
        height = dr.select(beside & strip, strip_height, height)
    phi_in, width_in = stretch(u_phi, 0, beside_share, -HALF_PHI, HALF_PHI)
    phi_out, width_out = stretch(u_phi, beside_share, 1, HALF_PHI, dr.two_pi - HALF_PHI)
    phi, width = dr.select(beside, phi_in, phi_out), dr.select(beside, width_in, width_out)
    return direction(theta, dr.pi + phi), dr.sin(theta) * height * width


def stretch(u, u_low, u_high, low, high):
    """Map u linearly from u_low..u_high to low..high. Return the image and its derivative."""
    slope = (high - low) / (u_high - u_low)
    return low + slope * (u - u_low), slope


def strip_share(problem):
    """Return the range of theta below the peak region as a share of the ranges below and above."""
    low, high = peak_elevations(problem)
    return low / (low + 0.5 * dr.pi - high)


def peak_elevations(problem):
    """Return the lower and upper limit of the peak region in theta [rad]."""
    return dr.maximum(problem.theta_i - HALF_THETA, 0), dr.minimum(
        problem.theta_i + HALF_THETA, 0.5 * dr.pi
    )

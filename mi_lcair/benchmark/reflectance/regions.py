"""The thesis's two regions of the hemisphere (3.3.2.2): the peak, 20 x 40 degrees, and the rest.

The peak region spans 10 degrees of elevation and 20 of azimuth to each side of the specular
direction, cut off at the normal and the horizon. Both regions are images of the unit square,
uniform in theta_r and phi_r.
"""

import drjit as dr
from drjit.llvm import Float64

from mi_lcair.benchmark.reflectance.problem import direction

HALF_THETA, HALF_PHI = dr.pi / 18, dr.pi / 9
PEAK_SHARE = HALF_PHI / dr.pi  # of all azimuths, those of the peak region
REST_PER_PEAK = 50 / 80  # samples per dimension: what the thesis found to suffice (3.3.3)


def in_peak(problem, u_theta, u_phi):
    """Direction r, and the weight sin(theta) dtheta dphi / (du_theta du_phi), of points of the peak
    region.
    """
    low, high = peak_elevations(problem)
    theta = dr.lerp(low, high, u_theta)
    phi = dr.pi + HALF_PHI * (2 * u_phi - 1)
    return direction(theta, phi), dr.sin(theta) * (high - low) * (2 * HALF_PHI)


def in_rest(problem, u_theta, u_phi, beside_share, below_share):
    """As `in_peak`, of the rest: where u_phi < beside_share, in the azimuths of the peak region,
    and there below it in elevation where u_theta < below_share, above it elsewhere.
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
    """u_low..u_high to low..high: the image of u, and its derivative."""
    slope = (high - low) / (u_high - u_low)
    return low + slope * (u - u_low), slope


def strip_share(problem):
    """The share that elevations below the peak region have in all those below and above it."""
    low, high = peak_elevations(problem)
    return low / (low + 0.5 * dr.pi - high)


def peak_elevations(problem):
    return dr.maximum(problem.theta_i - HALF_THETA, 0), dr.minimum(
        problem.theta_i + HALF_THETA, 0.5 * dr.pi
    )

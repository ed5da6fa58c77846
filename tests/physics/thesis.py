"""The thesis's Eqs 2.14-2.26 as printed, as a reference for tests.

m is the module whose functions are used, mpmath or numpy. In Float64 the printed equations are
inexact for b = 0, b = 1 and narrow lobes. EXACT uses mpmath with 40 digits.
"""

import mpmath
import numpy as np

EXACT = mpmath.workdps(40)


def g(m, theta, b):
    return 1 / (1 + b**2 * m.tan(theta) ** 2)  # Eqs 2.16, 2.17, and d of Eq 2.24


def G(m, b):
    return 1 / (1 - b**2) * (1 - b**2 / (1 - b**2) * m.log(1 / b**2))  # Eq 2.18


def glint_angle(m, theta_i, theta_r, dphi):
    """alpha of Eqs 2.25 and 2.26; dphi = pi in the mirror direction's half-plane."""
    o = (m.sin(theta_r), 0, m.cos(theta_r))
    s = (m.sin(theta_i) * m.cos(dphi), m.sin(theta_i) * m.sin(dphi), m.cos(theta_i))
    glint_z = (o[2] + s[2]) / m.sqrt(2 * (1 + o[0] * s[0] + o[1] * s[1] + o[2] * s[2]))
    return m.acos(glint_z)


def h(m, alpha, e):
    return 1 / (e**2 * m.cos(alpha) ** 2 + m.sin(alpha) ** 2) ** 2  # Eq 2.22


def H(m, theta_i, e):
    c = m.cos(theta_i)
    root = m.sqrt((1 - e**2) ** 2 * c**2 + 4 * e**2)
    # Eq 2.23
    return 1 / (2 * e**2) * ((1 - e**2) * c + (2 * e**2 + (1 - e**2) ** 2 * c**2) / root)


def rho_s(m, theta_i, epsilon, rho_d, b):
    # Eqs 2.20, 2.21
    return 1 - rho_d * g(m, theta_i, b) / G(m, b) - epsilon * g(m, theta_i, b) / G(m, b)


def brdf(m, theta_i, theta_r, dphi, epsilon, rho_d, b, e, form="thesis"):
    f_d = 1 / m.pi * g(m, theta_r, b) * rho_d * g(m, theta_i, b) / G(m, b) ** 2  # Eq 2.15
    d = g(m, theta_r, b) if form == "thesis" else 1  # the form "normalized" has no such factor
    lobe = h(m, glint_angle(m, theta_i, theta_r, dphi), e) / H(m, theta_i, e)
    # Eq 2.19
    f_s = 1 / (4 * m.pi) * rho_s(m, theta_i, epsilon, rho_d, b) * lobe / m.cos(theta_r) * d
    return f_d + f_s  # Eq 2.14


def hemisphere(peak, width, nodes=120):
    """Directions (theta, phi) and weights [sr] of a quadrature over the hemisphere.

    The integrand is a function of theta and dphi = pi - phi that is even in phi. It has a peak at
    theta = peak, phi = 0, with the given width in theta. The width in phi is 1 / tan(peak) times as
    large. The Gauss nodes on x = width sinh(t) are dense around the peak.
    """
    x, weight = np.polynomial.legendre.leggauss(nodes)
    x, weight = (x + 1) / 2, weight / 2

    def panel(length, width):
        end = np.arcsinh(length / width)
        return width * np.sinh(end * x), weight * end * width * np.cosh(end * x)

    below, below_weight = panel(peak, width) if peak else (np.empty(0), np.empty(0))
    above, above_weight = panel((np.pi / 2 - peak) / 2, width)
    horizon, horizon_weight = panel((np.pi / 2 - peak) / 2, width / 10)
    theta = np.concatenate([peak - below, peak + above, np.pi / 2 - horizon])
    theta_weight = np.concatenate([below_weight, above_weight, horizon_weight]) * np.sin(theta)
    phi, phi_weight = panel(np.pi, min(width / max(np.tan(peak), width), 1))
    theta, phi = np.meshgrid(theta, phi, indexing="ij")
    return theta, phi, theta_weight[:, None] * 2 * phi_weight

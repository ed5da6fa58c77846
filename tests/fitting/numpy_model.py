"""The Sandford-Robertson model in plain NumPy, as a reference for tests.

It is written from the thesis (Eqs 2.14-2.26) and shares no code with the project.
"""

import numpy as np


def G(b):
    x = b * b
    return (1 - x / (1 - x) * np.log(1 / x)) / (1 - x)


def brdf(theta_i, theta_r, epsilon, rho_d, b, e, form="thesis", azimuth=0.0):
    """BRDF [1/sr] for 0 < b < 1.

    azimuth: angle between r and the plane of incidence [radians]. In this plane, theta_r > 0 is the
    specular side.
    """
    g_i, g_r = (1 / (1 + b * b * np.tan(theta) ** 2) for theta in (theta_i, theta_r))
    x = np.sin(theta_i) - np.sin(theta_r) * np.cos(azimuth)
    y, z = np.sin(theta_r) * np.sin(azimuth), np.cos(theta_i) + np.cos(theta_r)
    sin2_alpha = (x * x + y * y) / (x * x + y * y + z * z)
    h = (e * e * (1 - sin2_alpha) + sin2_alpha) ** -2.0
    c = (1 - e * e) * np.cos(theta_i)
    H = (c + (2 * e * e + c * c) / np.sqrt(c * c + 4 * e * e)) / (2 * e * e)
    rho_s = 1 - (epsilon + rho_d) * g_i / G(b)
    d = g_r if form == "thesis" else 1
    return g_i * g_r * rho_d / (np.pi * G(b) ** 2) + rho_s * h / H * d / (
        4 * np.pi * np.cos(theta_r)
    )

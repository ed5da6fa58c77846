"""Sandford-Robertson in plain NumPy, written from the thesis (Eqs 2.14-2.26) for the specular plane: what tests compare with."""
import numpy as np


def G(b):
    x = b * b
    return (1 - x / (1 - x) * np.log(1 / x)) / (1 - x)


def brdf(theta_i, theta_r, epsilon, rho_d, b, e, form="thesis"):
    """f_r in the plane of incidence [1/sr]; theta_r > 0 on the specular side; 0 < b < 1."""
    g_i, g_r = (1 / (1 + b * b * np.tan(theta) ** 2) for theta in (theta_i, theta_r))
    alpha = (theta_r - theta_i) / 2
    h = (e * e * np.cos(alpha) ** 2 + np.sin(alpha) ** 2) ** -2.0
    c = (1 - e * e) * np.cos(theta_i)
    H = (c + (2 * e * e + c * c) / np.sqrt(c * c + 4 * e * e)) / (2 * e * e)
    rho_s = 1 - (epsilon + rho_d) * g_i / G(b)
    d = g_r if form == "thesis" else 1
    return g_i * g_r * rho_d / (np.pi * G(b) ** 2) + rho_s * h / H * d / (4 * np.pi * np.cos(theta_r))

"""Temperatures by the makers' measurement formula (FLIR, Photon user's manual, Eq 2).

Reference: random objects whose apparent temperature follows from the formula by quadrature of
Planck's law and root finding.
"""

import numpy as np
from scipy.integrate import quad
from scipy.optimize import brentq

import mi_lcair
from docs.studies.cases.comparison import Comparison

H, C, K = 6.62607015e-34, 299792458.0, 1.380649e-23


def radiance(kelvin: float, low: float, high: float) -> float:
    """In-band radiance of a blackbody by adaptive quadrature [W m^-2 sr^-1]."""

    def planck(x):
        return 2 * H * C**2 / x**5 / np.expm1(H * C / (x * K * kelvin))

    return quad(planck, low * 1e-6, high * 1e-6, epsrel=1e-12)[0]


def compare() -> Comparison:
    """24 objects of 250 to 900 K in three bands."""
    rng, computed, reference = np.random.default_rng(3), [], []
    for draw in range(24):
        limits = [(3.0, 5.0), (8.0, 12.0), (7.5, 13.0)][draw % 3]
        T, reflected, air = rng.uniform(250, 900), *rng.uniform(230, 330, 2)
        emissivity, through = rng.uniform(0.05, 1), rng.uniform(0.2, 1)
        parts = (
            (emissivity * through, T),
            ((1 - emissivity) * through, reflected),
            (1 - through, air),
        )
        total = sum(share * radiance(kelvin, *limits) for share, kelvin in parts)
        seen = brentq(lambda t, b=limits, x=total: radiance(t, *b) / x - 1, 20, 6000, xtol=1e-9)
        result = mi_lcair.temperature(
            seen, f"{limits[0]}-{limits[1]}", emissivity=emissivity, reflected=reflected,
            transmittance=through, air_temperature=air,
        )  # fmt: skip
        computed.append(result.kelvin)
        reference.append(T)
    return Comparison("Measurement formula of FLIR", "K", computed, reference, reach=0.02)

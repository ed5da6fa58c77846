"""Directions and surfaces that several tests use."""

import drjit as dr
import numpy as np
from drjit.llvm.ad import Array3f64, Float64

from mi_lcair.physics.reflection import sandford_robertson_equations as sr

# epsilon, rho_d, b, e of thesis Tables 2.2 and 2.3, for bare aluminum in MWIR and LWIR and for
# gloss black in MWIR and LWIR.
MATERIALS = [
    (0.11, 0.02, 0.05, 0.0042),
    (0.08, 0.02, 0.05, 0.0042),
    (0.89, 0.001, 0.16, 0.005),
    (0.88, 0.00075, 0.16, 0.005),
]


def direction(theta, phi=0.0, Vector=Array3f64):
    """Unit vectors at the angle theta from the normal and the azimuth phi [rad]."""
    theta, phi = np.broadcast_arrays(np.atleast_1d(theta), phi)
    return Vector(np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta))


def surface(epsilon, rho_d, b, e, form="thesis"):
    numbers = [Float64(number) for number in (epsilon, rho_d, b, e)]
    dr.make_opaque(*numbers)  # one kernel serves all values
    return sr.surface(*numbers, form=form)


def random_parameters(count, seed=0):
    """Rows (epsilon, rho_d, b, e) spread over the whole feasible set.

    They include points on its faces and very close to them.
    """
    rng = np.random.default_rng(seed)
    b = np.where(
        rng.random(count) < 0.2, rng.choice([0, 1e-4, 1 - 1e-9, 1], count), rng.random(count)
    )
    e = np.where(
        rng.random(count) < 0.2,
        rng.choice([0.0015, 1], count),
        np.exp(rng.uniform(np.log(0.0015), 0, count)),
    )
    total = (
        np.where(rng.random(count) < 0.3, rng.choice([0, 1 - 1e-6, 1], count), rng.random(count))
        * sr.G(Float64(b)).numpy()
    )
    share = np.where(rng.random(count) < 0.2, rng.choice([0, 1], count), rng.random(count))
    return np.stack([total * share, total * (1 - share), b, e], axis=1)

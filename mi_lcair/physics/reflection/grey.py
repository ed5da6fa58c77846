"""A grey diffuse surface, given by its emissivity alone.

By Kirchhoff's law its reflectance is 1 - emissivity (Harkiss 2007, Eq 2.4), the same for all
directions (Lambert): f = (1 - emissivity) / pi. A derivative with respect to the emissivity
therefore holds both the emitted and the reflected radiance. The Sandford-Robertson model with
rho_d = 1 - epsilon and b = 0 is the same surface, but there rho_d stays when epsilon changes.
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr
import numpy as np

from mi_lcair.physics.reflection import interface


@dataclass
class GreySurface(interface.Surface):
    """Emissivity of a grey diffuse surface, and its reflectance, which is exact near 0."""

    emissivity: Any
    reflectance: Any


class GreyModel(interface.ReflectionModel):
    """Grey diffuse surface with the parameter `emissivity`."""

    name = "grey"
    title = "Grey diffuse"
    parameters = interface.bundled_parameters("grey")
    is_compared = False

    def surface(self, *values, form: str = "standard"):
        return GreySurface(values[0], 1 - values[0])

    def f(self, S, i, r):
        return dr.select((i.z > 0) & (r.z > 0), S.reflectance * dr.inv_pi, 0)

    def HDR(self, S, theta_r):
        return self.floor_HDR(S, dr.cos(theta_r), None)

    def DHR(self, S, theta_i):
        return self.HDR(S, theta_i)

    def floor_HDR(self, S, cos, sin2):
        # A sum with zeros would widen the variable of S.reflectance itself
        return dr.select(cos >= -1, S.reflectance, 0)

    def from_cube(self, u) -> tuple:
        return tuple(u)

    def to_cube(self, values) -> np.ndarray:
        return np.clip(np.asarray(values, dtype=float), 0, 1)

    def starting_points(self, count: int, seed: int) -> np.ndarray:
        return np.random.default_rng(seed).uniform(0.02, 0.98, (count, 1))


MODEL = GreyModel()

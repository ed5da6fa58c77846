"""The Minnaert reflection model: a reciprocal diffuse surface that darkens toward its limb.

f(i, r) = rho (k + 1) / (2 pi) (cos theta_i cos theta_r)^(k - 1), so that HDR(theta_r) is
rho cos(theta_r)^(k - 1). Source: M. Minnaert, The reciprocity principle in lunar photometry,
Astrophysical Journal 93, 1941. An example of a model that is added to the project.
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr
import numpy as np
from scipy.stats import qmc

from mi_lcair.physics.reflection import interface
from mi_lcair.physics.reflection.interface import SMALLEST, cos_theta


@dataclass
class Surface(interface.Surface):
    rho: Any
    k: Any


class Minnaert(interface.ReflectionModel):
    name = "minnaert"
    title = "Minnaert"
    parameters = (
        interface.ModelParameter(
            "rho", r"$\rho$", meaning="reflectance seen along the normal", lower=0, upper=1
        ),
        interface.ModelParameter(
            "k", r"$k$", meaning="limb darkening; 1 is Lambertian", lower=1, upper=3
        ),
    )
    restrictions = (interface.Restriction("k = 1", coordinate=1),)

    def surface(self, *values, form="standard"):
        return Surface(*values)

    def check_feasible(self, *values, form="standard"):
        for parameter, value in zip(self.parameters, values):
            parameter.check(value, f"minnaert: {parameter.name}")

    def f(self, S, i, r):
        product = dr.maximum(cos_theta(i) * cos_theta(r), SMALLEST)
        value = S.rho * (S.k + 1) * (0.5 * dr.inv_pi) * product ** (S.k - 1)
        return dr.select((i.z > 0) & (r.z > 0), value, 0)

    def floor_HDR(self, S, cos, sin2):
        return S.rho * dr.maximum(cos, SMALLEST) ** (S.k - 1)

    def HDR(self, S, theta_r):
        return self.floor_HDR(S, dr.cos(theta_r), None)

    def DHR(self, S, theta_i):
        return self.HDR(S, theta_i)  # the model is reciprocal

    def from_cube(self, u):
        return u[0], 1 + 2 * u[1]

    def to_cube(self, values):
        values = np.asarray(values, dtype=float)
        return np.clip(np.stack([values[..., 0], (values[..., 1] - 1) / 2], axis=-1), 0, 1)

    def starting_points(self, count, seed):
        return qmc.LatinHypercube(2, rng=np.random.default_rng(seed)).random(count)


MODEL = Minnaert()

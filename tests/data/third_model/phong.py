"""The Phong reflection model in its reciprocal form: a diffuse floor and a lobe that may be narrow.

f(i, r) = rho ((1 - s) / pi + s (n + 2) / (2 pi) cos^n alpha), where alpha is the angle between i
and the mirror direction of r, below 90 degrees. HDR(0) = rho. Source: R. R. Lewis, Making shaders
more physically plausible, Computer Graphics Forum 13, 1994. An example of a model with a lobe that
is added to the project.
"""

from dataclasses import dataclass
from math import log
from typing import Any

import drjit as dr
import numpy as np
from drjit.llvm.ad import Float64
from scipy.stats import qmc

from mi_lcair.physics.reflection import interface
from mi_lcair.physics.reflection.interface import SMALLEST

NODES = 48  # of the quadrature over the part of the lobe that the horizon cuts
NARROWEST = 1e5  # largest exponent; the lobe is then .2 degrees wide


@dataclass
class Surface(interface.Surface):
    rho: Any
    share: Any
    n: Any


def squared_distance(i, r):
    """|i - m|^2 = 2 - 2 cos alpha, with the mirror direction m of r; precise for narrow lobes."""
    return dr.square(i.x + r.x) + dr.square(i.y + r.y) + dr.square(i.z - r.z)


def lobe(n, i, r):
    """cos^n alpha, 0 beyond 90 degrees."""
    half = 0.5 * squared_distance(i, r)  # 1 - cos alpha
    inside = half < 1
    half = dr.select(inside, half, 0)
    return dr.select(inside, dr.exp(-2 * n * dr.atanh(half / (2 - half))), 0)


class Phong(interface.ReflectionModel):
    name = "phong"
    title = "Phong"
    parameters = (
        interface.ModelParameter(
            "rho", r"$\rho$", meaning="reflectance seen along the normal", lower=0, upper=1
        ),
        interface.ModelParameter(
            "share", r"$s$", meaning="the lobe's share of it", lower=0, upper=1
        ),
        interface.ModelParameter("n", r"$n$", meaning="exponent", lower=1, upper=NARROWEST),
    )
    restrictions = (interface.Restriction("diffuse", coordinate=1),)

    def surface(self, *values, form="standard"):
        return Surface(*values)

    def check_feasible(self, *values, form="standard"):
        for parameter, value in zip(self.parameters, values):
            parameter.check(value, f"phong: {parameter.name}")

    def f(self, S, i, r):
        peak = S.share * (S.n + 2) * (0.5 * dr.inv_pi)
        value = S.rho * ((1 - S.share) * dr.inv_pi + peak * lobe(S.n, i, r))
        return dr.select((i.z > 0) & (r.z > 0), value, 0)

    def floor_HDR(self, S, cos, sin2):
        return S.rho * (1 - S.share) + 0 * cos

    def lobe_HDR(self, S, theta_r):
        """What lies closer to the mirror direction than the horizon has a closed form, cos(theta)
        (1 - sin^(n + 2) theta). The rest is integrated over cos alpha = q sin(theta).
        """
        sin, cos = dr.sincos(theta_r)
        sin = dr.maximum(sin, SMALLEST)
        closed = cos * (1 - sin ** (S.n + 2))

        x, weights = (Float64(half) for half in np.polynomial.legendre.leggauss(NODES))
        lanes, n = dr.width(theta_r), S.repeat(NODES).n
        x, weight = dr.tile(0.5 * (x + 1), lanes), dr.tile(0.5 * weights, lanes)
        s, c = dr.repeat(sin, NODES), dr.repeat(cos, NODES)
        sin_x, cos_x = dr.sincos(0.5 * dr.pi * x)
        q = sin_x ** (2 / (n + 1))
        along, across = c * q, dr.sqrt(1 - dr.square(s * q))
        phi = dr.safe_acos(-along / across)  # beyond it the lobe is below the horizon
        cosine = 2 * s * (along * phi + across * dr.sin(phi))
        cut = dr.block_sum(weight * dr.pi * sin_x * cos_x * cosine, NODES)
        cut *= (S.n + 2) / (S.n + 1) * (0.5 * dr.inv_pi) * sin ** (S.n + 1)
        return S.rho * S.share * (closed + cut)

    def HDR(self, S, theta_r):
        return self.floor_HDR(S, dr.cos(theta_r), None) + self.lobe_HDR(S, theta_r)

    def DHR(self, S, theta_i):
        return self.HDR(S, theta_i)  # the model is reciprocal

    def sample_lobe(self, S, r, u1, u2, u3):
        log_cos = dr.log(dr.maximum(u2, SMALLEST)) / (S.n + 1)
        sin = dr.safe_sqrt(-2 * dr.sinh(log_cos) * dr.exp(log_cos))
        sin_phi, cos_phi = dr.sincos(dr.two_pi * u1)
        Vector = type(r)
        v = Vector(sin * cos_phi, sin * sin_phi, dr.exp(log_cos))
        half = dr.normalize(Vector(-r.x, -r.y, 1 + r.z))  # reflects the normal to the mirror of r
        return 2 * dr.dot(half, v) * half - v

    def lobe_pdf(self, S, i, r):
        return (S.n + 1) * (0.5 * dr.inv_pi) * lobe(S.n, i, r)

    def lobe_width(self, S):
        """The half-vector's angle is about half of alpha."""
        return dr.sqrt(dr.tanh(0.5 * log(4) / S.n))

    def from_cube(self, u):
        return u[0], u[1], dr.exp(log(NARROWEST) * u[2])

    def to_cube(self, values):
        values = np.asarray(values, dtype=float)
        n = np.log(np.maximum(values[..., 2], 1)) / log(NARROWEST)
        return np.clip(np.stack([values[..., 0], values[..., 1], n], axis=-1), 0, 1)

    def starting_points(self, count, seed):
        return qmc.LatinHypercube(3, rng=np.random.default_rng(seed)).random(count)


MODEL = Phong()

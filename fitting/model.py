"""Predicted readings of the instruments, with derivatives.

They are computed for many sets of parameters at once, with Dr.Jit in Float64.
"""

import drjit as dr
import numpy as np
from drjit.llvm.ad import Array3f64, Float64, UInt32

from mi_lcair.fitting.aperture import Disc
from mi_lcair.fitting.cube import with_tangents
from mi_lcair.physics.reflection.interface import ReflectionModel


class Scatterometer:
    """In-plane BRDFs as a scatterometer measures them.

    A measured BRDF is the average over the disc of the source, weighted by the cosine of the angle
    of incidence.

    Parameters
    ----------
    model, form
        Reflection model of the surfaces, and the form of its equations.
    theta_i, theta_r
        Elevations of source and observer as in `Measurements` [radians], (p,).
    half_angle
        Angular radius of the source [radians], 0 for a point source.
    """

    def __init__(
        self, model: ReflectionModel, form: str, theta_i, theta_r, half_angle: float = 0.0
    ):
        self.model, self.form = model, form
        self.disc = Disc(theta_i, theta_r, half_angle) if half_angle else None
        point = self.disc.point if half_angle else np.arange(len(theta_i))
        self.nodes = len(point)
        self.theta_i, self.theta_r = (
            Float64(np.asarray(theta_i)[point]),
            Float64(np.asarray(theta_r)[point]),
        )
        dr.eval(self.theta_i, self.theta_r)

    def __call__(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """BRDFs [1/sr] of the surfaces at coordinates u (m, n), and their derivatives.

        The BRDFs are (m, points), their derivatives with respect to u are (m, points, n).
        """
        surface, node = lanes(len(u), self.nodes)
        theta_i, theta_r = (
            dr.gather(Float64, self.theta_i, node),
            dr.gather(Float64, self.theta_r, node),
        )
        sin_r, cos_r = dr.sincos(theta_r)
        r = Array3f64(-sin_r, 0, cos_r)  # the source has x > 0, the specular side x < 0

        def brdf(*u):
            S = self.model.surface(*self.model.from_cube(u), form=self.form)
            if self.disc is None:
                sin_i, cos_i = dr.sincos(theta_i)
                return self.model.f(S, Array3f64(sin_i, 0, cos_i), r)
            # The width only places the nodes. The average does not depend on it.
            lobe_width = dr.detach(self.model.lobe_width(S))
            i, weight = self.disc.direction(theta_i, theta_r, lobe_width, node)
            return self.model.f(S, i, r) * weight, weight

        values, slopes = with_tangents(
            brdf, u, lambda coordinate: dr.gather(Float64, coordinate, surface)
        )
        if self.disc is None:
            return values.reshape(len(u), -1), slopes.reshape(len(u), self.nodes, -1)
        return self.disc.average(
            values.reshape(len(u), self.nodes, 2), slopes[:, 0].reshape(len(u), self.nodes, -1)
        )


class Hemispherical:
    """Directional emissivities or reflectances as an instrument measures them.

    Parameters
    ----------
    model, form
        Reflection model of the surfaces, and the form of its equations.
    theta
        Angles [radians], (a,).
    quantity
        "emissivity" for 1 - HDR(theta_r), or "dhr" for DHR(theta_i).
    """

    def __init__(self, model: ReflectionModel, form: str, theta, quantity: str):
        self.model, self.form, self.quantity = model, form, quantity
        self.theta = Float64(np.asarray(theta, dtype=float))

    def __call__(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Values of the surfaces at coordinates u (m, n), and their derivatives.

        The values are (m, angles), their derivatives with respect to u are (m, angles, n).
        """
        count = dr.width(self.theta)
        surface, angle = lanes(len(u), count)
        theta = dr.gather(Float64, self.theta, angle)

        def directional(*u):
            S = self.model.surface(*self.model.from_cube(u), form=self.form)
            if self.quantity == "dhr":
                return self.model.DHR(S, theta)
            return 1 - self.model.HDR(S, theta)

        values, slopes = with_tangents(
            directional, u, lambda coordinate: dr.gather(Float64, coordinate, surface)
        )
        return values.reshape(len(u), count), slopes.reshape(len(u), count, -1)


def lanes(surfaces: int, rows: int) -> tuple[UInt32, UInt32]:
    """Index of the surface and of the row for each of the surfaces * rows lanes.

    The number of rows is opaque to Dr.Jit, so that the same kernel is used for any number.
    """
    lane, rows = dr.arange(UInt32, surfaces * rows), dr.opaque(UInt32, rows)
    surface = lane // rows
    return surface, lane - surface * rows

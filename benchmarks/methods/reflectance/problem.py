"""The integral on which the methods are compared.

It is the directional-hemispherical reflectance (DHR) of a Sandford-Robertson surface, in Float64.
"""

from dataclasses import dataclass

import drjit as dr
from drjit.llvm import Array3f64, Float64

from mi_lcair.physics.reflection import sandford_robertson_equations
from mi_lcair.physics.reflection import sandford_robertson_equations as sr
from mi_lcair.physics.reflection.interface import cos_theta


@dataclass(frozen=True, eq=False)
class ReflectanceProblem:
    """The DHR of one surface at one angle of incidence.

    DHR(theta_i) = int f_r(i, r) cos(theta_r) domega_r (thesis Eq 2.8), dimensionless; theta_i in
    rad.
    """

    surface: sr.SandfordRobertsonSurface
    theta_i: Float64

    def incident(self, phi=0) -> Array3f64:
        """Return the direction to the source at azimuth phi. The specular peak is at phi + pi."""
        return direction(self.theta_i, phi)

    def integrand(self, i, r):
        """Return f_r(i, r) cos(theta_r) [1/sr], which is 0 below the surface."""
        return sr.f(self.surface, i, r) * cos_theta(r)

    def exact(self) -> float:
        """Return the DHR with an error of 1e-9.

        The integral over phi is a closed form. That over theta is a quadrature that resolves the
        lobe.
        """
        return sandford_robertson_equations.DHR(self.surface, self.theta_i)[0]


def problem(
    epsilon: float, rho_d: float, b: float, e: float, theta_i_deg: float, form: str = "thesis"
) -> ReflectanceProblem:
    """Return the problem for one surface.

    Parameters
    ----------
    epsilon, rho_d, b, e
        Parameters of the Sandford-Robertson model.
    theta_i_deg
        Angle of incidence [degrees].
    form
        Form of the model, "thesis" or "normalized".

    Raises
    ------
    InputError
        The parameters are outside their feasible set.
    """
    sr.check_feasible(epsilon, rho_d, b, e, form)
    # The numbers are opaque to Dr.Jit, so that one compiled kernel serves all surfaces and angles.
    numbers = [dr.opaque(Float64, number) for number in (epsilon, rho_d, b, e)]
    S = sr.surface(*numbers, form=form)
    theta_i = dr.opaque(Float64, theta_i_deg * dr.pi / 180)
    dr.make_opaque(S)
    return ReflectanceProblem(S, theta_i)


def direction(theta, phi) -> Array3f64:
    """Return the unit vector at angle theta from the normal and azimuth phi [rad]."""
    sin_theta, cos_theta = dr.sincos(theta)
    sin_phi, cos_phi = dr.sincos(phi)
    return Array3f64(sin_theta * cos_phi, sin_theta * sin_phi, cos_theta)

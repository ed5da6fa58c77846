"""What is integrated: the directional-hemispherical reflectance of a Sandford-Robertson surface, in
Float64.
"""

from dataclasses import dataclass

import drjit as dr
from drjit.llvm import Array3f64, Float64

from mi_lcair.physics.reflection import sandford_robertson_equations as sr
from mi_lcair.physics.reflection import sandford_robertson_hemispherical as hemispherical
from mi_lcair.physics.reflection.directions import cos_theta


@dataclass(frozen=True, eq=False)
class Problem:
    """DHR(theta_i) = int f_r(i, r) cos(theta_r) domega_r (thesis Eq 2.8), dimensionless, for one
    surface and one theta_i [rad].
    """

    surface: sr.Surface
    theta_i: Float64

    def incident(self, phi=0) -> Array3f64:
        """The direction to the source, at the azimuth phi; that of the specular peak is phi + pi."""
        return direction(self.theta_i, phi)

    def integrand(self, i, r):
        """f_r(i, r) cos(theta_r) [1/sr]; 0 below the surface."""
        return sr.f(self.surface, i, r) * cos_theta(r)

    def exact(self) -> float:
        """The DHR to 1e-9: the azimuth in closed form, the elevation by a quadrature that resolves
        the lobe.
        """
        return hemispherical.DHR(self.surface, self.theta_i)[0]


def problem(
    epsilon: float, rho_d: float, b: float, e: float, theta_i_deg: float, form: str = "thesis"
) -> Problem:
    """The problem for the parameters of a surface. Raises InputError for parameters that are not
    feasible.
    """
    sr.check_feasible(epsilon, rho_d, b, e, form)
    # Opaque: one compiled kernel serves all surfaces and angles.
    numbers = [dr.opaque(Float64, number) for number in (epsilon, rho_d, b, e)]
    S = sr.surface(*numbers, form=form)
    theta_i = dr.opaque(Float64, theta_i_deg * dr.pi / 180)
    dr.make_opaque(S)
    return Problem(S, theta_i)


def direction(theta, phi) -> Array3f64:
    """The unit vector at the angle theta from the normal and the azimuth phi [rad]."""
    sin_theta, cos_theta = dr.sincos(theta)
    sin_phi, cos_phi = dr.sincos(phi)
    return Array3f64(sin_theta * cos_phi, sin_theta * sin_phi, cos_theta)

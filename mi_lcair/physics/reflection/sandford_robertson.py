"""The Sandford-Robertson model, with its equations, integrals and search coordinates.

The equations are in `sandford_robertson_equations`, their hemispherical integrals in
`sandford_robertson_hemispherical`, and the search coordinates in `sandford_robertson_cube`.
"""

import drjit as dr

from mi_lcair.physics.reflection import sandford_robertson_equations as sr
from mi_lcair.physics.reflection import sandford_robertson_hemispherical as hemispherical
from mi_lcair.physics.reflection.sandford_robertson_cube import SandfordRobertsonCube


class SandfordRobertson(SandfordRobertsonCube):
    """The Sandford-Robertson reflection model (thesis 2.3.4)."""

    has_emissivity = True

    surface = staticmethod(sr.surface)
    check_feasible = staticmethod(sr.check_feasible)
    f = staticmethod(sr.f)
    HDR = staticmethod(hemispherical.HDR)
    DHR = staticmethod(hemispherical.DHR)
    emissivity = staticmethod(sr.emissivity)

    def floor_HDR(self, S, cos, sin2):
        return S.floor * S.G * sr.g(cos, sin2, S.b)

    def lobe_HDR(self, S, theta_r):
        return hemispherical.HDR_lobe(S, theta_r) / sr.e2_H(dr.cos(theta_r), S.e)

    def lobe_scale(self, S, cos, sin2):
        return sr.observer_factor(S, cos, sin2) * sr.e2_H(cos, S.e)

    def sample_lobe(self, S, r, u1, u2, u3):
        half = sr.sample_half_vector(r, S.e, u1, u2)
        return dr.fma(half, 2 * dr.dot(r, half), -r)

    def lobe_pdf(self, S, i, r):
        return sr.lobe_pdf(i, r, S.e)

    def lobe_width(self, S):
        return S.e


MODEL = SandfordRobertson()

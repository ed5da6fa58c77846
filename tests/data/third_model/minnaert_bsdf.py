r"""BSDF `minnaert`: the Minnaert reflection model."""

from mi_lcair.physics import reflection
from mi_lcair.plugins.bsdfs.reflection_bsdf import ReflectionBSDF


class Minnaert(ReflectionBSDF):
    r"""Minnaert BRDF.

    ============== ======= ==================================================================
    rho            float   reflectance seen along the normal, 0..1           (differentiable)
    k              float   limb darkening, 1..3; 1 is Lambertian             (differentiable)
    ============== ======= ==================================================================
    """

    model = reflection.model("minnaert")

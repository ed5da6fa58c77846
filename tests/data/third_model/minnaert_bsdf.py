r"""BSDF `minnaert`: the Minnaert reflection model."""

import mitsuba as mi

from mi_lcair.physics import reflection
from mi_lcair.plugins import reflection_bsdf


class Minnaert(reflection_bsdf.ReflectionBSDF):
    r"""Minnaert BRDF.

    ============== ======= ==================================================================
    rho            float   reflectance seen along the normal, 0..1           (differentiable)
    k              float   limb darkening, 1..3; 1 is Lambertian             (differentiable)
    ============== ======= ==================================================================
    """

    model = reflection.model("minnaert")


mi.register_bsdf("minnaert", Minnaert)

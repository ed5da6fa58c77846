r"""BSDF `phong`: the Phong reflection model in its reciprocal form."""

from mi_lcair.physics import reflection
from mi_lcair.plugins.bsdfs.reflection_bsdf import ReflectionBSDF


class Phong(ReflectionBSDF):
    r"""Phong BRDF.

    ============== ======= ==================================================================
    rho            float   reflectance seen along the normal, 0..1           (differentiable)
    share          float   the lobe's share of it, 0..1                      (differentiable)
    n              float   exponent of the lobe, 1..100000                   (differentiable)
    ============== ======= ==================================================================
    """

    model = reflection.model("phong")

r"""BSDF `grey`: a grey diffuse surface, given by its emissivity."""

from mi_lcair.physics import reflection
from mi_lcair.plugins.bsdfs.reflection_bsdf import ReflectionBSDF


class Grey(ReflectionBSDF):
    r"""Grey diffuse surface.

    ============== ======= =========================================================================
    emissivity     float   emissivity, 0..1; the reflectance is 1 - emissivity      (differentiable)
    ============== ======= =========================================================================

    The other properties are those of `material`, except `emissivity`: `material`, `band`,
    `materials`, `allow_band`, `average_K`, `form`, `lobe`. Give either the number or `material`. A
    material whose name is a number, such as 0.92, is this surface too.

    .. code-block:: xml

        <bsdf type="grey"> <float name="emissivity" value="0.92"/> </bsdf>

    The model (Harkiss 2007, Eq 2.4 for a Lambertian surface; i: direction to the source, r:
    direction to the observer):

    .. math::

        f(i, r) = \frac{1 - \varepsilon}{\pi}

    A derivative with respect to the emissivity includes both the change of the emitted radiance and
    the change of the reflected radiance.
    """

    model = reflection.model("grey")

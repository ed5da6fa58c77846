r"""BSDF `material`: a surface of a named material."""

from mi_lcair.plugins.bsdfs.reflection_bsdf import ReflectionBSDF


class Material(ReflectionBSDF):
    r"""A named material, with the reflection model that was fitted to it.

    ============== ======= =========================================================================
    material       string  name of a material, or path of a fit's JSON file
    band           string  band for which the material must have been measured
    materials      string  TOML file with the user's materials, which is searched first
    allow_band     boolean use the nearest band if there is no measurement for `band`        (false)
    average_K      float   for a material with a spectrum: its mean in the band, weighted with the
                           radiation of a blackbody at this temperature [K]
    form           string  form of the model                                        (the material's)
    emissivity     string  kirchhoff: 1 - HDR(theta); model: the model's own formula, if it
                           has one; or a CSV file theta_deg,emissivity                   (kirchhoff)
    lobe           string  brdf: the model's BRDF; mirror: HDR(theta) as a perfect mirror;
                           diffuse: HDR(theta) as a Lambertian surface                        (brdf)
    ============== ======= =========================================================================

    .. code-block:: xml

        <bsdf type="material">
            <string name="material" value="gloss_black"/> <string name="band" value="MWIR"/>
        </bsdf>

    For each model there is also a plugin with the model's name. It accepts these properties, too,
    or the model's parameters as numbers. All parameters are differentiable.

    `si.wi` points to the observer and `wo` to the source. A model may violate reciprocity, so the
    order of the directions matters; TransportMode.Importance swaps them. The surface is one-sided:
    it reflects and emits on the side of its normal. At angles where a model would reflect more than
    the incident power, HDR(theta_r) > 1, the BRDF is divided by HDR(theta_r) and the emissivity is
    0.
    """

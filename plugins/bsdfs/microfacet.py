r"""BSDF `microfacet`: microfacets with Fresnel reflection and a diffuse floor."""

from mi_lcair.physics import reflection
from mi_lcair.plugins.bsdfs.reflection_bsdf import ReflectionBSDF


class Microfacet(ReflectionBSDF):
    r"""Microfacet BRDF: generalised Trowbridge-Reitz distribution, Fresnel reflectance, floor.

    ============== ======= =========================================================================
    alpha          float   width of the distribution of facet slopes, 1e-4..1       (differentiable)
    gamma          float   exponent of the distribution's tail, 0.5..4; 2 is GGX    (differentiable)
    n              float   refractive index, effective in the band                  (differentiable)
    k              float   extinction coefficient, effective in the band, 0 for a
                           dielectric                                               (differentiable)
    rho_d          float   diffuse reflectance of the floor, before the factors
                           1 - F for the surface's Fresnel reflection, 0..1         (differentiable)
    ============== ======= =========================================================================

    The other properties are those of `material`: `material`, `band`, `materials`, `allow_band`,
    `average_K`, `emissivity`, `lobe`. Give either the five numbers or `material`.

    .. code-block:: xml

        <bsdf type="microfacet">
            <float name="alpha" value="0.2"/> <float name="gamma" value="2"/>
            <float name="n" value="1.5"/> <float name="k" value="0"/>
            <float name="rho_d" value="0.1"/>
        </bsdf>

    The model (i: direction to the source, r: direction to the observer, c_i and c_r: their cosines,
    m: half-vector at the angle theta_m to the normal, p = i . m = r . m):

    .. math::

        f(i, r) &= \frac{F(p)\, D(m)\, G(i, r)}{4\, c_i\, c_r}
                 + \frac{\rho_d}{\pi}\, (1 - F(c_i))\, (1 - F(c_r)) \\
        D(m) &= \frac{D_0}{\left(\alpha^2 \cos^2\theta_m + \sin^2\theta_m\right)^{\gamma}},
                 \qquad \int D(m) \cos\theta_m\, d\omega_m = 1 \\
        G(i, r) &= \min\left(1,\ \frac{2\, c_i \cos\theta_m}{p},\
                 \frac{2\, c_r \cos\theta_m}{p}\right) \\
        F(p) &= \tfrac{1}{2}\left(|r_s|^2 + |r_p|^2\right), \quad
        r_s = \frac{p - q}{p + q}, \quad
        r_p = \frac{(n + \mathrm{i} k)^2 p - q}{(n + \mathrm{i} k)^2 p + q}, \quad
        q = \sqrt{(n + \mathrm{i} k)^2 - 1 + p^2}

    G describes facets that form V-shaped cavities. It is exact for every D, so the lobe never
    reflects more than the incident power. The model is reciprocal. Radiation that facets reflect to
    each other is lost; `mi_lcair.physics.reflection.microfacet` computes how much.

    Sources: K. E. Torrance and E. M. Sparrow, J. Opt. Soc. Am. 57, 1105, 1967; R. L. Cook and K. E.
    Torrance, ACM Trans. Graph. 1, 7, 1982; B. Walter et al., Microfacet models for refraction
    through rough surfaces, EGSR 2007; B. Burley, Physically based shading at Disney, SIGGRAPH
    course 2012; E. Heitz and E. d'Eon, Importance sampling microfacet-based BSDFs using the
    distribution of visible normals, EGSR 2014; M. Ribardiere et al., Comput. Graph. Forum 36, 2017.
    """

    model = reflection.model("microfacet")

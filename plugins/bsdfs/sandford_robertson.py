r"""BSDF `sandford_robertson`: the Sandford-Robertson reflection model."""

from mi_lcair.physics import reflection
from mi_lcair.plugins.bsdfs.reflection_bsdf import ReflectionBSDF


class SandfordRobertson(ReflectionBSDF):
    r"""Sandford-Robertson BRDF with GGX half-vector sampling.

    ============== ======= =========================================================================
    epsilon        float   emissivity parameter, >= 0                               (differentiable)
    rho_d          float   diffuse reflectance parameter, >= 0;
                           epsilon + rho_d <= G(b)                                  (differentiable)
    b              float   grazing-angle parameter, 0..1                            (differentiable)
    e              float   width of the specular lobe, 0..1, 0 excluded             (differentiable)
    form           string  thesis | normalized                              (the material's, thesis)
    ============== ======= =========================================================================

    The other properties are those of `material`: `material`, `band`, `materials`, `allow_band`,
    `average_K`, `emissivity`, `lobe`. Give either the four numbers or `material`.

    .. code-block:: xml

        <bsdf type="sandford_robertson">
            <float name="epsilon" value="0.3"/> <float name="rho_d" value="0.2"/>
            <float name="b" value="0.4"/> <float name="e" value="0.05"/>
        </bsdf>

    The model (i: direction to the source, r: direction to the observer, h: half-vector,
    alpha: angle between h and the normal; equation numbers of Harkiss 2007):

    .. math::

        f(i, r) &= f_d + f_s                                                    && (2.14) \\
        f_d &= \frac{\rho_d}{\pi G(b)^2}\, g(\theta_i)\, g(\theta_r)            && (2.15) \\
        g(\theta) &= \frac{1}{1 + b^2 \tan^2\theta}                             && (2.16, 2.17) \\
        G(b) &= 2 \int_0^{\pi/2} g(\theta) \cos\theta \sin\theta \, d\theta
              = \frac{1 - b^2 + b^2 \ln b^2}{(1 - b^2)^2}                       && (2.18) \\
        f_s &= \frac{1}{4\pi}\, \rho_s(\theta_i)\, \frac{h(\alpha)}{H(\theta_i)}\,
               \frac{d(\theta_r)}{\cos\theta_r}                                 && (2.19) \\
        \rho_s(\theta_i) &= 1 - \rho_d\frac{g(\theta_i)}{G(b)} - \varepsilon(\theta_i) && (2.20) \\
        \varepsilon(\theta) &= \varepsilon\, \frac{g(\theta)}{G(b)}             && (2.21) \\
        h(\alpha) &= \frac{1}{(e^2 \cos^2\alpha + \sin^2\alpha)^2}              && (2.22) \\
        H(\theta_i) &= \frac{1}{2 e^2}\left[(1 - e^2)\cos\theta_i + \frac{2 e^2 + (1 - e^2)^2
               \cos^2\theta_i}{\sqrt{(1 - e^2)^2 \cos^2\theta_i + 4 e^2}}\right]  && (2.23) \\
        d(\theta) &= g(\theta)                                                  && (2.24)

    `form="normalized"` drops d(theta_r) from Eq 2.19, so that DHR(theta_i) = 1 - epsilon(theta_i)
    exactly. The model is not reciprocal. h is the Trowbridge-Reitz (GGX) distribution of width e.

    Sources: B. P. Sandford and D. C. Robertson, Infrared reflectance properties of aircraft paints,
    Proc. IRIS Targets, Backgrounds and Discrimination, 1985; S. I. Harkiss, A Study of
    Bi-Directional Reflectance Distribution Functions and Their Effect on Infrared Signature Models,
    2007; T. S. Trowbridge and K. P. Reitz, J. Opt. Soc. Am. 65, 531, 1975.
    """

    model = reflection.model("sandford_robertson")

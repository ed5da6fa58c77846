"""The equations of the microfacet model as its docstring prints them, as a reference for tests.

m is the module whose functions are used, mpmath or numpy. The Fresnel reflectance is computed from
complex amplitudes, and the angles of facets from scalar products.
"""


def normalisation(m, alpha, gamma):
    """The constant c of D = c / (alpha^2 cos^2 + sin^2)^gamma, for alpha and gamma other than 1.

    It follows from int D cos(theta) domega = 1.
    """
    a = alpha**2
    return (gamma - 1) * (1 - a) / (m.pi * (a ** (1 - gamma) - 1))


def distribution(m, cos2, alpha, gamma):
    return normalisation(m, alpha, gamma) / (alpha**2 * cos2 + 1 - cos2) ** gamma


def fresnel(m, cos, n, k):
    index2 = (n + 1j * k) ** 2
    root = m.sqrt(index2 - 1 + cos**2)
    r_s, r_p = (cos - root) / (cos + root), (index2 * cos - root) / (index2 * cos + root)
    return (abs(r_s) ** 2 + abs(r_p) ** 2) / 2


def brdf(m, i, r, alpha, gamma, n, k, rho_d):
    """BRDF [1/sr]; i and r are triples, both above the surface."""
    h = [a + b for a, b in zip(i, r)]
    length = m.sqrt(sum(x * x for x in h))
    half = [x / length for x in h]
    p = sum(a * b for a, b in zip(i, half))
    hidden = [2 * half[2] * w[2] / p for w in (i, r)]
    G = m.minimum(1, m.minimum(*hidden)) if hasattr(m, "minimum") else min(1, *hidden)
    F = fresnel(m, p, n, k)
    lobe = F * distribution(m, half[2] ** 2, alpha, gamma) * G / (4 * i[2] * r[2])
    return lobe + rho_d / m.pi * (1 - fresnel(m, i[2], n, k)) * (1 - fresnel(m, r[2], n, k))

"""Surfaces at which a render of derivatives explores what they do not reflect.

A path ends where its weight becomes 0. The derivative with respect to a reflectance of 0 is not 0,
and needs the radiance that the surface would reflect. A render of derivatives therefore explores
such surfaces. Its paths go on from there as latent paths, which count for the derivative at that
surface alone. The floor and the lobe of a reflection model are both sampled, also where one of them
is 0.
"""

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.plugins.bsdfs.plume import is_plume
from mi_lcair.plugins.bsdfs.reflection_bsdf import is_reflection_bsdf, parts_of_HDR, tables
from mi_lcair.plugins.columns.surface_slopes import DIFFUSE
from mi_lcair.plugins.derivatives import attached, children, variables

SMALL = 0.02  # reflectance, or share of it, below which too few paths follow it for a derivative
DEGREES = (5, 30, 55, 75)  # angles of the observer at which reflectances are compared with SMALL


def needs_exploring(bsdf, names) -> bool:
    """Whether paths would miss a part of the derivatives of a surface where they are not explored.

    names: the parameters of the BSDF with respect to which it is differentiated.
    """
    if not is_reflection_bsdf(bsdf):
        # Of other BSDFs it is not known where they reflect nothing
        is_known = bsdf.class_name() == DIFFUSE or is_plume(bsdf)
        numbers = [
            value for key, value in mi.traverse(bsdf).items() if key.removesuffix(".value") in names
        ]
        return not is_known or any(np.min(np.array(number)) < SMALL for number in numbers)
    if bsdf.change:
        return False  # has no derivatives along paths
    theta = np.radians(DEGREES)
    cos, sin2 = mi.Float(np.cos(theta)), mi.Float(np.sin(theta) ** 2)
    floor, lobe = (dr.detach(part).numpy() for part in bsdf.raw_HDR(cos, sin2))
    if np.min(floor + lobe) < SMALL:
        return True
    if bsdf.lobe != "brdf":
        return False
    is_small = [np.min(part / (floor + lobe)) < SMALL for part in (floor, lobe)]
    return any(is_small) and any(
        np.any(np.array(is_small) & depends_on(bsdf, name, cos, sin2)) for name in names
    )


def depends_on(bsdf, name: str, cos, sin2) -> np.ndarray:
    """Whether the floor's and the lobe's HDR depend on a parameter of a reflection model, (2,)."""
    with dr.resume_grad():
        values = {key: mi.Float(value) for key, value in zip(bsdf.model.names, bsdf.values)}
        dr.make_opaque(values)
        dr.enable_grad(values[name])
        derived = tables(bsdf.model, tuple(values.values()), bsdf.form)
        parts = parts_of_HDR(bsdf.model, derived, cos, sin2)
        dr.forward_from(values[name])
        return np.array([np.abs(dr.grad(part).numpy()).max() > SMALL for part in parts])


def explored_by_gradients(objects) -> frozenset:
    """The BSDFs of a scene that a replay has to explore, for the parameters that have gradients."""
    names_by_bsdf = differentiated(objects)
    return frozenset(bsdf for bsdf, names in names_by_bsdf.items() if needs_exploring(bsdf, names))


def differentiated(objects) -> dict:
    """The BSDFs of a scene that have parameters with gradients, and the names of these."""
    names_by_bsdf = {}
    for bsdf in objects:
        if not isinstance(bsdf, mi.BSDF) or any(isinstance(c, mi.BSDF) for c in children(bsdf)):
            continue
        arrays = [(key, value) for key, value in mi.traverse(bsdf).items() if dr.is_array_v(value)]
        names = {key.removesuffix(".value") for key, v in arrays if attached(variables(v))}
        if names:
            names_by_bsdf[bsdf] = names
    return names_by_bsdf

"""Upper bounds of the radiance of emitters and of textures, from their parameters."""

import re
from functools import reduce

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.plugins.derivatives import members
from mi_lcair.plugins.emitters.thermal_emitter import is_thermal

# Textures whose values never exceed the largest number that they or their nested textures contain.
# They interpolate or select numbers, but do not add or multiply them.
BETWEEN_ITS_VALUES = ("UniformSpectrum", "BitmapTextureImpl", "Checkerboard")


def can_be_hit(emitter) -> bool:
    """Whether a reflected ray can hit the emitter; False for a point light or a parallel beam."""
    return not emitter.flags() & int(mi.EmitterFlags.Delta)


def radiance_bound(emitter) -> np.ndarray | None:
    """Upper bound of the radiance of an emitter that a ray can hit [W m^-2 sr^-1].

    An array of width 1, or with one value per triangle of the emitter's mesh. None if the emitter
    is of a kind whose radiance cannot be bounded from its parameters.
    """
    if is_thermal(emitter):
        return emitter.radiance_bound()
    held = members(emitter)
    if "data" in held and "scale" in held:  # envmap
        return largest(held["data"]) * largest(held["scale"])
    if isinstance(held.get("radiance"), mi.Texture):  # area, constant
        return texture_bound(held["radiance"], emitter.get_shape())
    return None


def texture_bound(texture, shape) -> np.ndarray | None:
    """Upper bound of a texture on a shape, of width 1 or per triangle; None if it is not known."""
    kind, held = texture.class_name().partition("[")[0], members(texture)
    if kind == "MeshAttribute":
        name = re.search(r'name = "(\w+)"', str(texture))
        buffer = members(shape).get(name[1]) if name else None
        if buffer is None:
            return None
        values = dr.detach(buffer).numpy().astype(np.float64) * held.get("scale", 1.0)
        return values if name[1].startswith("face_") else values.max(keepdims=True)
    if kind not in BETWEEN_ITS_VALUES:
        return None
    bounds = [
        texture_bound(value, shape) if isinstance(value, mi.Texture) else largest(value)
        for name, value in held.items()
        if isinstance(value, mi.Texture) or name in ("value", "data")
    ]
    if not bounds or any(bound is None for bound in bounds):
        return None
    return reduce(np.maximum, bounds)  # some of width 1, some per triangle


def largest(values) -> np.ndarray:
    """The largest value, as an array of width 1."""
    return np.atleast_1d(np.max(np.asarray(dr.detach(values), dtype=np.float64)))

"""Upper bounds of the radiance of emitters, from their parameters."""

import re

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.plugins.derivatives import members

# Textures whose values never exceed the largest number that they or their nested textures contain.
# They interpolate or select numbers, but do not add or multiply them.
BETWEEN_ITS_VALUES = ("UniformSpectrum", "BitmapTextureImpl", "Checkerboard")


def radiance_bound(emitter) -> np.ndarray | None:
    """Upper bound of the radiance of an emitter that a ray can hit [W m^-2 sr^-1].

    An array of width 1, or with one value per triangle of the emitter's mesh. None if the emitter
    is of a kind whose radiance cannot be bounded from its parameters. An emitter written in Python
    may have a method `radiance_bound()` that returns such an array.
    """
    held = members(emitter)
    if hasattr(emitter, "radiance_bound"):
        return emitter.radiance_bound()
    if hasattr(emitter, "group"):
        return thermal_bound(emitter)
    if "data" in held and "scale" in held:  # envmap
        return largest(held["data"]) * largest(held["scale"])
    if isinstance(held.get("radiance"), mi.Texture):  # area, constant
        return texture_bound(held["radiance"], emitter.get_shape())
    return None


def thermal_bound(emitter) -> np.ndarray | None:
    """Bound for emitter `thermal`: blackbody or given radiance, times a given emissivity."""
    source = emitter.derived if emitter.radiance is None else emitter.radiance
    if source is not None:
        bound = dr.detach(source).numpy().astype(np.float64)
    else:
        temperature = texture_bound(emitter.texture, emitter.get_shape())
        bound = None if temperature is None else in_band_radiance(emitter.band, temperature)
    if bound is None or emitter.given_emissivity is None:
        return bound
    return bound * largest(emitter.given_emissivity)


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
    return None if not bounds or None in bounds else np.max(bounds, axis=0)


def largest(values) -> np.ndarray:
    """The largest value, as an array of width 1."""
    return np.atleast_1d(np.max(np.asarray(dr.detach(values), dtype=np.float64)))

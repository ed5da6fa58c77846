"""Emitters of a user's own: one in the style of Mitsuba's tutorial, one of a known spectrum."""

import drjit as dr
import mitsuba as mi

from mi_lcair.plugins.emitters.distant_emitter import DistantEmitter
from mi_lcair.plugins.properties import Property


class Glow(mi.Emitter):
    """Radiance L cos^n from a surface: `radiance` L [W m^-2 sr^-1] and `exponent` n."""

    def __init__(self, props):
        super().__init__(props)
        self.radiance = mi.Float(props.get("radiance", 1.0))
        self.exponent = mi.Float(props.get("exponent", 1.0))
        self.m_flags = +mi.EmitterFlags.Surface

    def eval(self, si, active=True):
        cos = mi.Frame3f.cos_theta(si.wi)
        value = self.radiance * dr.power(dr.maximum(cos, 1e-6), self.exponent)
        return mi.Spectrum(dr.select(active & (cos > 0), value, 0))

    def traverse(self, callback):
        callback.put("radiance", self.radiance, mi.ParamFlags.Differentiable)
        callback.put("exponent", self.exponent, mi.ParamFlags.Differentiable)

    def to_string(self):
        return "Glow[]"


class SlopingSky(DistantEmitter):
    """Sky of a radiance that rises from the horizon as cos^n of the zenith angle."""

    PROPERTIES = (
        Property("exponent", "float", 1.0),
        Property("band", "string", is_file=True),
        Property("group", "string", "sky", is_label=True),
    )

    def __init__(self, props):
        super().__init__(props)
        self.exponent = mi.Float(self.values["exponent"])

    def facet_radiance(self):
        return self.scale

    def along(self, d, active):
        rise = dr.power(dr.maximum(d.z, 1e-6), self.exponent)
        return mi.Spectrum(dr.select(active & (d.z > 0), self.scale * rise, 0))

    def traverse(self, callback):
        super().traverse(callback)
        callback.put("exponent", self.exponent, mi.ParamFlags.Differentiable)


mi.register_emitter("glow", Glow)
mi.register_emitter("sloping_sky", SlopingSky)

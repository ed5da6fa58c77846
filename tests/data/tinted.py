"""A diffuse BSDF in the style of Mitsuba's tutorial."""

import drjit as dr
import mitsuba as mi


class Tinted(mi.BSDF):
    def __init__(self, props):
        super().__init__(props)
        self.tint = mi.Float(props.get("tint", 0.3))
        self.m_components = [mi.BSDFFlags.DiffuseReflection | mi.BSDFFlags.FrontSide]
        self.m_flags = self.m_components[0]

    def sample(self, ctx, si, sample1, sample2, active=True):
        cos = mi.Frame3f.cos_theta(si.wi)
        bs = mi.BSDFSample3f()
        bs.wo = mi.warp.square_to_cosine_hemisphere(sample2)
        bs.pdf = mi.warp.square_to_cosine_hemisphere_pdf(bs.wo)
        bs.eta = 1.0
        bs.sampled_type = mi.UInt32(+mi.BSDFFlags.DiffuseReflection)
        bs.sampled_component = 0
        active &= (cos > 0) & (bs.pdf > 0)
        return bs, dr.select(active, mi.Spectrum(self.tint), 0)

    def eval(self, ctx, si, wo, active=True):
        cos_i, cos_o = mi.Frame3f.cos_theta(si.wi), mi.Frame3f.cos_theta(wo)
        return dr.select(
            active & (cos_i > 0) & (cos_o > 0), mi.Spectrum(self.tint * dr.inv_pi * cos_o), 0
        )

    def pdf(self, ctx, si, wo, active=True):
        cos_i = mi.Frame3f.cos_theta(si.wi)
        pdf = mi.warp.square_to_cosine_hemisphere_pdf(wo)
        return dr.select(active & (cos_i > 0) & (mi.Frame3f.cos_theta(wo) > 0), pdf, 0)

    def eval_pdf(self, ctx, si, wo, active=True):
        return self.eval(ctx, si, wo, active), self.pdf(ctx, si, wo, active)

    def traverse(self, callback):
        callback.put("tint", self.tint, mi.ParamFlags.Differentiable)

    def to_string(self):
        return f"Tinted[tint={self.tint}]"


mi.register_bsdf("tinted", Tinted)

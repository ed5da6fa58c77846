"""A BSDF that a user wrote in Python and registered with Mitsuba renders and emits."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

import mi_lcair
from mi_lcair.physics.blackbody import in_band_radiance


class HalfMirror(mi.BSDF):
    """Reflects 0.3 in the mirror direction and 0.4 cos(theta) diffusely, without mi_lcair."""

    def __init__(self, props):
        mi.BSDF.__init__(self, props)
        self.mirror = mi.Float(props.get("mirror", 0.3))
        self.m_components = [
            mi.BSDFFlags.DeltaReflection | mi.BSDFFlags.FrontSide,
            mi.BSDFFlags.DiffuseReflection | mi.BSDFFlags.FrontSide,
        ]
        self.m_flags = self.m_components[0] | self.m_components[1]

    def traverse(self, cb):
        cb.put("mirror", self.mirror, mi.ParamFlags.Differentiable)

    def diffuse(self, wi):
        return 0.4 * dr.maximum(wi.z, 0)

    def sample(self, ctx, si, sample1, sample2, active=True):
        bs = dr.zeros(mi.BSDFSample3f)
        specular = sample1 < 0.5
        mirrored = mi.Vector3f(-si.wi.x, -si.wi.y, si.wi.z)
        bs.wo = dr.select(specular, mirrored, mi.warp.square_to_cosine_hemisphere(sample2))
        bs.pdf = dr.select(specular, 0.5, 0.5 * dr.inv_pi * bs.wo.z)
        bs.eta = 1
        bs.sampled_component = dr.select(specular, mi.UInt32(0), 1)
        bs.sampled_type = dr.select(
            specular, mi.UInt32(+mi.BSDFFlags.DeltaReflection), +mi.BSDFFlags.DiffuseReflection
        )
        weight = dr.select(specular, 2 * self.mirror, 2 * self.diffuse(si.wi))
        return bs, mi.Spectrum(dr.select(active & (si.wi.z > 0), weight, 0))

    def eval(self, ctx, si, wo, active=True):
        value = self.diffuse(si.wi) * dr.inv_pi * wo.z
        return mi.Spectrum(dr.select(active & (si.wi.z > 0) & (wo.z > 0), value, 0))

    def pdf(self, ctx, si, wo, active=True):
        return dr.select(active & (si.wi.z > 0) & (wo.z > 0), 0.5 * dr.inv_pi * wo.z, 0)

    def eval_pdf(self, ctx, si, wo, active=True):
        return self.eval(ctx, si, wo, active), self.pdf(ctx, si, wo, active)

    def to_string(self):
        return "HalfMirror[]"


SCENE = """<scene version="3.0.0">
    <integrator type="bounce_path"> <integer name="max_bounces" value="{bounces}"/> </integrator>
    <sensor type="orthographic">
        <transform name="to_world">
            <scale x="0.1" y="0.1"/> <lookat origin="{x}, 0, {z}" target="0, 0, 0" up="0, 1, 0"/>
        </transform>
        <film type="hdrfilm">
            <integer name="width" value="8"/> <integer name="height" value="8"/>
            <string name="pixel_format" value="luminance"/> <rfilter type="box"/>
        </film>
    </sensor>
    <shape type="rectangle">
        <bsdf type="half_mirror"/>
        <emitter type="thermal">
            <string name="band" value="MWIR"/> <float name="temperature" value="300"/>
        </emitter>
    </shape>
    <shape type="sphere">
        <float name="radius" value="20"/> <boolean name="flip_normals" value="true"/>
        <bsdf type="diffuse"> <rgb name="reflectance" value="0"/> </bsdf>
        <emitter type="thermal">
            <string name="band" value="MWIR"/> <float name="temperature" value="300"/>
            <string name="group" value="room"/>
        </emitter>
    </shape>
</scene>"""


@pytest.fixture(scope="module", autouse=True)
def registered():
    mi.register_bsdf("half_mirror", HalfMirror)


@pytest.mark.slow
@pytest.mark.parametrize("theta_deg", [0, 60])
def test_emits_what_it_does_not_reflect(tmp_path, theta_deg):
    """Emission is 1 - 0.3 - 0.4 cos(theta); an isothermal room hides the surface (Kirchhoff)."""
    theta = np.radians(theta_deg)
    blackbody = in_band_radiance(mi_lcair.physics.bands.band("MWIR"), 300.0)
    path = tmp_path / "room.xml"
    for bounces, expected in ((0, 0.7 - 0.4 * np.cos(theta)), (1, 1.0)):
        path.write_text(SCENE.format(bounces=bounces, x=np.sin(theta), z=np.cos(theta)))
        image = mi_lcair.render(mi_lcair.load(path), spp=1024)
        assert image.mean / blackbody == pytest.approx(expected, abs=3e-3)

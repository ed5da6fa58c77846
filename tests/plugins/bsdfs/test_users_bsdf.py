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


class Tutorial(HalfMirror):
    """The same in the style of Mitsuba's tutorial: `active` has no default."""

    def sample(self, ctx, si, sample1, sample2, active):
        return super().sample(ctx, si, sample1, sample2, active)

    def eval(self, ctx, si, wo, active):
        return super().eval(ctx, si, wo, active)

    def pdf(self, ctx, si, wo, active):
        return super().pdf(ctx, si, wo, active)

    def eval_pdf(self, ctx, si, wo, active):
        return super().eval_pdf(ctx, si, wo, active)

    def has_attribute(self, name, active):
        return False


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
        <bsdf type="{bsdf}"/>
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
    mi.register_bsdf("tutorial", Tutorial)


@pytest.mark.slow
@pytest.mark.parametrize(
    "bsdf, theta_deg", [("half_mirror", 0), ("half_mirror", 60), ("tutorial", 60)]
)
def test_emits_what_it_does_not_reflect(tmp_path, bsdf, theta_deg):
    """Emission is 1 - 0.3 - 0.4 cos(theta); an isothermal room hides the surface (Kirchhoff)."""
    theta = np.radians(theta_deg)
    blackbody = in_band_radiance(mi_lcair.physics.bands.band("MWIR"), 300.0)
    path = tmp_path / "room.xml"
    for bounces, expected in ((0, 0.7 - 0.4 * np.cos(theta)), (1, 1.0)):
        path.write_text(SCENE.format(bsdf=bsdf, bounces=bounces, x=np.sin(theta), z=np.cos(theta)))
        image = mi_lcair.render(mi_lcair.load(path), spp=1024)
        assert image.mean / blackbody == pytest.approx(expected, abs=3e-3)


@pytest.mark.slow
def test_all_calls_state_active(tmp_path):
    """No function calls the BSDF without `active`, and the result is that of one with a default."""
    intensity = []
    for bsdf in ("half_mirror", "tutorial"):
        path = tmp_path / "plate.xml"
        path.write_text(SCENE.format(bsdf=bsdf, bounces=2, x=0.5, z=0.5))
        scene = mi_lcair.load(path)
        signature = mi_lcair.signature(scene, spp=64, facets=True, by_spectrum=True)
        intensity.append(signature.intensity)
        mi_lcair.derivative_images(scene, ["room.temperature"], spp=4)
        mi_lcair.sensitivities(scene, ["room.temperature"], spp=4)
        mi_lcair.audit(scene, paths=256)
    assert intensity[0] == pytest.approx(intensity[1], rel=1e-3)

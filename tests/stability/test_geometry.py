"""Extreme geometry.

Scenes from 1e-6 to 1e6 m, thin triangles, scenes far from their origin, coincident facets, narrow
gaps and clipping planes.
"""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

import mi_lcair
from benchmarks.methods.propagation.exact import perpendicular_view_factor
from docs.studies.leaks import write_ply
from mi_lcair.errors import InputError
from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.plugins.emission.emitter_table import EmitterTable
from mi_lcair.rendering.loading.remarks import clipped

SCENE = """<scene version="3.0.0">
    <integrator type="bounce_path">
        <integer name="max_bounces" value="1"/>
        <boolean name="emitter_sampling" value="{sampling}"/>
    </integrator>
    <sensor type="orthographic">
        {clips}
        <transform name="to_world">
            <scale x="{window}" y="{window}"/>
            <lookat origin="{x}, 0, {z}" target="{x}, 0, 0" up="0, 1, 0"/>
        </transform>
        <film type="hdrfilm">
            <integer name="width" value="16"/> <integer name="height" value="16"/>
            <string name="pixel_format" value="luminance"/>
            <rfilter type="box"/>
        </film>
    </sensor>
    {shapes}
</scene>"""
SHAPE = """<shape type="ply">
        <string name="filename" value="{name}.ply"/> <boolean name="face_normals" value="true"/>
        <bsdf type="diffuse"> <spectrum name="reflectance" value="{reflectance}"/> </bsdf> {emitter}
    </shape>"""
EMITTER = """<emitter type="thermal">
        <string name="band" value="total"/> <float name="temperature" value="{temperature}"/>
    </emitter>"""


def clipping(near, far):
    """Return the XML of a sensor's clipping planes [m]."""
    return f'<float name="near_clip" value="{near}"/> <float name="far_clip" value="{far}"/>'


def load(folder, meshes, window=0.12, x=0.1, z=1.0, sampling="true", clips=None):
    """Write and load a scene.

    meshes: name -> (vertices in m, facets, reflectance, temperature in K or None). window: half
    width of the sensor's window [m]. x, z: position of the sensor [m]. clips: XML of its clipping
    planes, or None for planes around the scene.
    """
    shapes = []
    for name, (vertices, facets, reflectance, temperature) in meshes.items():
        write_ply(folder / f"{name}.ply", np.array(vertices, dtype=float), facets)
        emitter = EMITTER.format(temperature=temperature) if temperature else ""
        shapes.append(SHAPE.format(name=name, reflectance=reflectance, emitter=emitter))
    file = folder / "scene.xml"
    file.write_text(
        SCENE.format(
            sampling=sampling,
            clips=clipping(1e-3 * z, 10 * z) if clips is None else clips,
            window=window,
            x=x,
            z=z,
            shapes=" ".join(shapes),
        )
    )
    return mi_lcair.load(file)


def two_plates(scale=1.0, strips=1, shift=0.0):
    """Return the plates of thesis Appendix A.1, each divided into strips.

    scale: factor of all lengths. shift: distance from the origin along x [m].
    """
    x = np.linspace(0, 0.2, strips + 1)
    row = lambda y, vertical: np.stack(
        [0 * x, y + 0 * x, x] if vertical else [x, y + 0 * x, 0 * x], axis=1
    )
    facets = [(k, k + 1, strips + k + 2, strips + k + 1) for k in range(strips)]
    move = np.array([shift, 0, 0])
    return {
        "reflector": (
            np.concatenate([row(-0.05, False), row(0.05, False)]) * scale + move,
            facets,
            1,
            None,
        ),
        "emitter": (
            np.concatenate([row(0.05, True), row(-0.05, True)]) * scale + move,
            facets,
            0,
            800,
        ),
    }


def assert_exact(scene, scale=1.0, allowed=0.0, spp=1024):
    """Assert that the mean radiance is L A F / (area of the window); return it.

    The relative deviation is at most 4 standard errors plus `allowed`.
    """
    result = mi_lcair.render(scene, spp=spp)
    exact = (
        float(in_band_radiance(band("total"), 800))
        * 0.02
        * perpendicular_view_factor(0.1, 0.2, 0.2)
        / 0.24**2
    )
    error = result.rms_error / 16
    assert result.invalid == 0 and error < 0.01
    assert abs(result.mean / exact - 1) <= 4 * error + allowed
    return result.mean


@pytest.mark.slow
@pytest.mark.parametrize("sampling", ["true", "false"])
def test_radiance_does_not_depend_on_scale(tmp_path, sampling):
    """The mean radiance is the same to 1e-6 for plates from 0.2 um to 0.2 m, to 3e-6 up to 200 km.

    All renders have the same paths. Near the origin, rays start 9e-5 m off a surface at most, as in
    Mitsuba. That is nearer than 64 roundings of the longest side if it is longer than 23 m.
    """
    means = [
        assert_exact(
            load(tmp_path, two_plates(scale), 0.12 * scale, 0.1 * scale, scale, sampling), scale
        )
        for scale in (1e-6, 1e-3, 1, 1e3, 1e6)
    ]
    np.testing.assert_allclose(means[:2], means[2], rtol=1e-6)
    np.testing.assert_allclose(means[3:], means[2], rtol=3e-6)


@pytest.mark.slow
@pytest.mark.parametrize("strips", [100, 30_000])
def test_slivers(tmp_path, strips):
    """The result is exact for strips that are 7 um wide and 15,000 times as long."""
    assert_exact(load(tmp_path, two_plates(strips=strips)))


@pytest.mark.slow
@pytest.mark.parametrize("shift", [10, 100])
def test_meshes_far_from_their_origin(tmp_path, shift):
    """Plates of 0.2 m with vertices at 10 m and 100 m are moved to the origin; nothing is lost."""
    assert_exact(load(tmp_path, two_plates(shift=shift), x=shift + 0.1))


@pytest.mark.parametrize("shift", [1000, 10_000])
def test_meshes_too_far_from_their_origin(tmp_path, shift):
    """In single precision, plates of 0.2 m at 1 km have edges that are wrong by 0.03 %: refused."""
    with pytest.raises(InputError, match="too far for the renderer's single precision"):
        load(tmp_path, two_plates(shift=shift), x=shift + 0.1)


@pytest.mark.slow
def test_a_large_ground_costs_nothing(tmp_path):
    """A ground of 2000 km under plates of 0.2 m does not change the result.

    The offset of a ray's start is at most Mitsuba's own, which does not depend on the scene's size.
    """
    ground = 1e6 * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) - [0, 0, 1e-3]
    assert_exact(load(tmp_path, two_plates() | {"ground": (ground, [(0, 1, 2, 3)], 0, None)}))


SQUARE = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], dtype=float)


@pytest.mark.slow
@pytest.mark.parametrize("gap, parted", [(1e-3, True), (1e-6, True), (1e-8, False), (0, False)])
def test_coincident_facets(tmp_path, gap, parted):
    """Two plates at a small distance are distinguished down to a gap of 0.1 um.

    A plate of 400 K is above one of 300 K. Both are 2 m wide and seen from 1 m. With a smaller gap
    the image shows one, the other or both, depending on their order in the file, with a remark.
    """
    plates = {
        "below": (SQUARE, [(0, 1, 2, 3)], 0, 300),
        "above": (SQUARE + [0, 0, gap], [(0, 1, 2, 3)], 0, 400),
    }
    images = []
    for order in (plates, dict(reversed(plates.items()))):
        result = mi_lcair.render(load(tmp_path, order, x=0), spp=4)
        images.append(result.channels["temperature.Y"])
        assert np.all((images[-1] > 299.9) & (images[-1] < 400.1))
    assert all(np.allclose(image, 400, atol=0.1) for image in images) == parted


@pytest.mark.slow
@pytest.mark.parametrize("gap, crossed", [(1e-3, True), (2e-5, True), (5e-6, False), (1e-7, False)])
def test_narrow_gaps(tmp_path, gap, crossed):
    """A ray between parallel plates hits the other plate, unless the gap is too narrow.

    A ray starts off its surface by 8e-6 of the scene's extent. If the other plate is closer, the
    ray starts beyond it.
    """
    plates = {
        "below": (SQUARE, [(0, 1, 2, 3)], 0.5, 300),
        "above": (SQUARE + [0, 0, gap], [(3, 2, 1, 0)], 0.5, 300),
    }
    scene = load(tmp_path, plates).mi
    rng = np.random.default_rng(0)
    uniform = lambda: mi.Float(rng.random(1000))
    si = scene.ray_intersect(
        mi.Ray3f(mi.Point3f(0.1 * uniform(), 0.1 * uniform(), 0.5 * gap), mi.Vector3f(0, 0, -1))
    )
    wo = mi.warp.square_to_cosine_hemisphere(mi.Point2f(uniform(), uniform()))
    following = scene.ray_intersect(EmitterTable(scene, False).spawn_ray(si, si.to_world(wo)))
    hits_other = following.is_valid() & (following.shape != si.shape) & (following.wi.z > 0)
    assert dr.mean(dr.select(hits_other, mi.Float(1), 0))[0] == pytest.approx(
        1 if crossed else 0, abs=0.01
    )


@pytest.mark.slow
def test_clipping_planes(tmp_path):
    """Surfaces outside Mitsuba's default planes, 0.01 m and 10 km, are black.

    A remark says so when the scene is loaded.
    """
    small = load(tmp_path, two_plates(1e-3), 0.12e-3, 0.1e-3, 1e-3, clips="")
    assert mi_lcair.render(small, spp=4).mean == 0
    assert small.remarks == ["sensor 0: does not see surfaces nearer than its near_clip = 0.01 m"]
    large = load(tmp_path, two_plates(1e5), 0.12e5, 0.1e5, 1e5, clips="")
    assert mi_lcair.render(large, spp=4).mean == 0
    assert large.remarks == ["sensor 0: does not see surfaces farther than its far_clip = 10000 m"]
    between = load(tmp_path, two_plates(), clips="")
    assert not [remark for remark in between.remarks if "clip" in remark]
    # The scale of the sensor is also that of the distance to its near plane
    T = mi.ScalarTransform4f()
    place = T.look_at([0, 0, 1], [0, 0, 0], [0, 1, 0]) @ T.scale(0.5)
    far = {"type": "orthographic", "to_world": place, "near_clip": 3.0}
    (remark,) = clipped(between.mi, [mi.load_dict({**far, "far_clip": 1e9})])
    assert remark.endswith("nearer than its near_clip = 1.5 m, scaled by its to_world")

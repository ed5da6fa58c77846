"""Derivatives by differences with common random numbers, against closed forms."""

import mitsuba as mi
import numpy as np
import pytest

import mi_lcair
from docs.studies.differences import differences, image_differences
from mi_lcair.errors import InputError
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.rendering.parameters.values import changed, parameter

mi.set_variant("llvm_ad_mono")


@pytest.fixture(scope="module")
def plate(tmp_path_factory):
    """A square plate of 2 m x 2 m of reflectance 0.4 at 310 K, alone, in a window of 4 m x 4 m."""
    path = tmp_path_factory.mktemp("plate") / "plate.xml"
    path.write_text(
        """<scene version="3.0.0">
        <integrator type="bounce_path"> <integer name="max_bounces" value="2"/> </integrator>
        <sensor type="orthographic">
            <transform name="to_world"> <scale x="2" y="2"/>
            <lookat origin="0, 0, 5" target="0, 0, 0" up="0, 1, 0"/> </transform>
            <film type="hdrfilm"> <integer name="width" value="16"/>
            <integer name="height" value="16"/> <string name="pixel_format" value="luminance"/>
            <rfilter type="box"/> </film>
            <sampler type="lattice"> <integer name="sample_count" value="16"/> </sampler>
        </sensor>
        <shape type="rectangle">
            <bsdf type="diffuse" id="paint"> <spectrum name="reflectance" value="0.4"/> </bsdf>
            <emitter type="thermal"> <string name="band" value="LWIR"/>
            <float name="temperature" value="310"/> <string name="group" value="plate"/> </emitter>
        </shape> </scene>"""
    )
    return mi_lcair.load(path)


def test_a_plate_in_closed_form(plate):
    """I = (1 - reflectance) A B(T): both derivatives are known."""
    names = ("plate.temperature", "paint.reflectance")
    found = differences(plate, names, (0.1, 0.01), spp=64)
    B = lambda T: float(in_band_radiance(plate.band, T))
    slope = (B(310.01) - B(309.99)) / 0.02
    expected = np.array([0.6 * 4 * slope, -4 * B(310)])
    assert found.value == pytest.approx(0.6 * 4 * B(310), rel=0.005)
    # The edge of the plate is the only noise: it is the same fraction of all results
    edge = found.value / (0.6 * 4 * B(310))
    np.testing.assert_allclose(found.derivative, edge * expected, rtol=2e-4)
    assert np.all(np.abs(found.derivative - expected) < 6 * found.error[1:])
    assert found.method == ("difference",) * 2 and found.deviations.shape == (3, 8)
    assert found.by_bounce[0] == pytest.approx(found.value) and found.by_bounce[1:].max() == 0


def test_a_step_ends_at_a_bound(plate):
    with changed(plate, {"paint.reflectance": 0.0}):
        found = differences(plate, ["paint.reflectance"], 0.05, spp=16)
        assert found.derivative[0] == pytest.approx(-found.value, rel=1e-4)
    with pytest.raises(InputError, match="plate.temperature: step 0 must be positive"):
        differences(plate, ["plate.temperature"], 0.0)


@pytest.mark.study
def test_error_of_a_derivative_covers_the_truth():
    """24 seeds agree within the standard errors that each of them states."""
    scene = mi_lcair.load("cylinder_ir_range", finish="gloss_black", resolution=16, spp=16)
    names, steps = ("gloss_black.epsilon", "gloss_black.b"), (0.01, 0.01)
    found = [differences(scene, names, steps, seed=seed) for seed in range(24)]
    slopes = np.array([result.derivative for result in found])
    stated = np.sqrt(np.mean([result.error[1:] ** 2 for result in found], axis=0))
    ratio = slopes.std(axis=0, ddof=1) / stated
    assert np.all((ratio > 0.4) & (ratio < 1.8)), ratio


def test_common_numbers_keep_the_noise_of_a_difference_small():
    """The error of a small change is far below that of the intensity itself."""
    scene = mi_lcair.load("cylinder_ir_range", finish="gloss_black", resolution=16, spp=16)
    found = differences(scene, ["gloss_black.epsilon"], 0.001)
    change = found.derivative[0] * 0.001
    assert found.error[1] * 0.001 < 0.1 * abs(change) < 0.1 * found.error[0]


def test_weights_of_sources(plate):
    """With a factor for the only source, value and derivative are multiplied by it."""
    plain = differences(plate, ["paint.reflectance"], 0.01, spp=16)
    weighted = differences(
        plate, ["paint.reflectance"], 0.01, spp=16, weights={("plate", "310 K"): 0.5}
    )
    assert weighted.value == pytest.approx(0.5 * plain.value, rel=1e-6)
    assert weighted.derivative == pytest.approx(0.5 * plain.derivative, rel=1e-6)
    np.testing.assert_allclose(weighted.deviations, 0.5 * plain.deviations, atol=1e-6 * plain.value)
    with pytest.raises(InputError, match="temperatures cannot change under weights"):
        differences(plate, ["plate.temperature"], 1.0, spp=16, weights={("plate", "310 K"): 0.5})


def test_images_agree_with_the_intensity(plate):
    """The sum of an image over its pixels, times their area, is the intensity."""
    names = ("plate.temperature", "paint.reflectance")
    images = image_differences(plate, names, (0.1, 0.01), spp=16)
    assert images.radiance.shape == (4, 16, 16) and images.derivatives.shape == (4, 2, 16, 16)
    pixel = (4 / 16) ** 2
    number = differences(plate, names, (0.1, 0.01), spp=16, part="scene")
    assert images.mean.sum() * pixel == pytest.approx(number.value, rel=0.01)
    np.testing.assert_allclose(
        images.derivative.sum(axis=(1, 2)) * pixel, number.derivative, rtol=0.01
    )
    assert images.error.shape == (16, 16) and images.derivative_error.shape == (2, 16, 16)
    assert parameter(plate, "paint.reflectance").value == pytest.approx(0.4)

"""Error of Float32 in a radiance whose paths are all alike: the stated error contains it."""

import numpy as np
import pytest

import mi_lcair
from docs.studies.leaks import cube
from mi_lcair.errors import InputError
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.plugins.paths.launch import rounding_error
from mi_lcair.rendering.scene import changed


@pytest.mark.slow
@pytest.mark.parametrize("bounces, reflectance", [(4, 0.5), (30, 0.9), (200, 0.7)])
def test_stated_errors_contain_the_rounding(tmp_path, bounces, reflectance):
    """An isothermal room: 1 - rho^(N + 1) of the blackbody's radiance, without scatter. (A path in
    1e7 is lost at an edge; the median over the pixels knows nothing of it.)
    """
    scene = cube(tmp_path, reflectance=reflectance, max_bounces=bounces)
    image = mi_lcair.render(scene, spp=512)
    unit = float(in_band_radiance(scene.band, 300.0))
    exact = unit * (1 - float(np.float32(reflectance)) ** (bounces + 1))
    off = abs(np.median(image.channels["Y"].astype(float)) / exact - 1)
    assert 0 < off < 3 * rounding_error(bounces) < 1e-5
    assert np.all(image.channels["stderr.Y"] >= 0.99 * rounding_error(bounces) * exact)
    assert image.mean_error >= rounding_error(bounces) * image.mean


def test_sums_of_many_equal_samples(tmp_path):
    """Float32 sums of 16,000 equal numbers are off by up to 1.6e-5."""
    scene = cube(tmp_path, reflectance=0.3, max_bounces=4)
    with changed(scene, max_bounces=0):
        image = mi_lcair.render(scene, spp=2**14, parts=True)
    expected = 0.7 * float(in_band_radiance(scene.band, 300.0))
    np.testing.assert_allclose(image.channels["Y"], expected, rtol=5e-7)
    np.testing.assert_allclose(image.channels["bounce00.Y"], expected, rtol=5e-7)


def test_a_tolerance_below_the_rounding_is_refused():
    scene = mi_lcair.load("open_box", resolution=4)
    with pytest.raises(InputError, match="tolerance = 1e-08 cannot be reached: Float32's rounding"):
        mi_lcair.render(scene, tolerance=1e-8)
    with pytest.raises(InputError, match="cannot be reached"):
        mi_lcair.trend(scene, [0.0], resolution=4, tolerance=1e-8)


@pytest.mark.parametrize("factor", [0.9, 1.5])
def test_a_tolerance_below_the_interval_of_the_rounding_is_refused(factor):
    """Half of the 95 % interval contains 1.96 times the systematic error."""
    scene = mi_lcair.load("open_box", resolution=4)
    with scene.prepared() as tracer:
        tolerance = factor * tracer.systematic_error
    for refused in (
        lambda: mi_lcair.signature(scene, tolerance=tolerance, max_spp=16),
        lambda: mi_lcair.trend(scene, [0.0], resolution=4, tolerance=tolerance, max_spp=16),
    ):
        with pytest.raises(InputError, match="leave half a 95 % interval of"):
            refused()
    if factor > 1:  # an image's tolerance is that of the standard error
        assert mi_lcair.render(scene, tolerance=tolerance, max_spp=16).reached is False

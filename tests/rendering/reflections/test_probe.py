"""Probes: the radiance by number of reflections, through a window or some pixels."""

import numpy as np
import pytest

import mi_lcair
from mi_lcair.rendering.reflections.probe import Probe, pixels_launch


@pytest.mark.parametrize("each_pixel, size", [(False, 1), (True, 50)])
def test_the_furnace_by_number_of_reflections(each_pixel, size):
    """All numbers add up to what a render gives. Sources that no path has met are bounded."""
    scene = mi_lcair.load("furnace", resolution=16, max_bounces=12)
    probe = Probe.of(scene, each_pixel, seed=1, sensor=0, factor=1)
    assert probe.by_bounce.shape[1] == 13 and probe.by_bounce.shape[2] >= size
    rendered = mi_lcair.render(scene, spp=64)
    assert probe.by_bounce.sum(axis=1).mean() == pytest.approx(rendered.mean, rel=1e-3)
    more = Probe.of(scene, each_pixel, seed=1, sensor=0, factor=4)
    assert 0 < more.may_lack == pytest.approx(probe.may_lack / 4, rel=1e-3)


@pytest.mark.parametrize(
    ("size", "windows"), [((8, 8), 64), ((32, 32), 64), ((128, 128), 1024), ((1000, 500), 2048)]
)
def test_number_of_pixels(size, windows):
    """One of 16, between 64 and 2048; a stride without a divisor of the width."""
    launch = pixels_launch(*size, seed=3, factor=5)
    assert 0.85 * windows <= launch.windows <= windows + 10
    assert np.gcd(launch.stride, size[0]) == 1
    assert (launch.points, launch.randomisations, launch.seed) == (10, 8, 3)
    assert (launch.columns, launch.rows) == size

"""Errors that the pixels of an image share: patterns of a camera's faults, and errors of groups."""

import numpy as np
import pytest

import mi_lcair
from mi_lcair.knowing.inversion.data.nuisances import (
    GAIN,
    GRADIENT,
    MODEL,
    OFFSET,
    VIGNETTING,
    camera_faults,
    group_errors,
    shares_of_groups,
)
from tests.knowing.inversion.plate import write_scene

COUNTS = np.array([[True, True, False, True], [True, True, True, True]])


def test_faults_of_a_camera():
    """Places of the pixels that count: x at -3/4, -1/4, 1/4, 3/4, and y at -1/2, 1/2."""
    faults = camera_faults(COUNTS, 0.02, True, True)
    assert faults.names == [GAIN, OFFSET, VIGNETTING, GRADIENT, GRADIENT]
    assert faults.is_offset.tolist() == [False, True, False, False, False]
    x = np.array([-3, -1, 3, -3, -1, 1, 3]) / 4
    y = np.array([-1, -1, -1, 1, 1, 1, 1]) / 2
    expected = 0.02 * np.array([1 + 0 * x, 1 + 0 * x, (x**2 + y**2) / 2, x, y])
    np.testing.assert_allclose(faults.patterns.T, expected)


@pytest.mark.parametrize("gain, offset", [(False, True), (True, False)])
def test_an_unknown_gain_or_offset_has_no_error_beside_it(gain, offset):
    faults = camera_faults(COUNTS, 0.02, gain, offset)
    assert (GAIN in faults.names, OFFSET in faults.names) == (gain, offset)
    assert camera_faults(COUNTS, 0.0, True, True).patterns.shape == (7, 0)


def test_errors_of_groups(tmp_path):
    """A plate of radiance (1 - R) B(T) + R B(S) fills the image: it alone has a share, of 1."""
    scene = mi_lcair.load(write_scene(tmp_path), size=4)
    shares = shares_of_groups(scene, 0, np.ones((4, 4), dtype=bool))
    assert set(shares) == {"plate", "sky"} and not shares["sky"].any()
    np.testing.assert_allclose(shares["plate"], 1, rtol=1e-6)
    errors = group_errors({"a": np.array([0.25, 1.0]), "b": np.array([0.75, 0.0])}, 0.02)
    assert errors.names == [MODEL, MODEL] and errors.labels == ["radiance of a", "radiance of b"]
    np.testing.assert_allclose(errors.patterns, [[0.005, 0.015], [0.02, 0.0]])

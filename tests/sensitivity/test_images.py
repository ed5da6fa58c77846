"""Errors of derivatives by pixel, against closed forms."""

import numpy as np
import pytest

import mi_lcair
from docs.studies.claims import planck
from docs.studies.claims.lit import X, Y, turned_to_front
from docs.studies.claims.scene_file import BLACK, UP, Place, SceneFile, diffuse, thermal
from docs.studies.claims.sources import corners
from docs.studies.claims.view_factors import to_polygon

REFLECTANCE, HOT, HALF_WINDOW = 0.5, 1000.0, 0.02


@pytest.mark.parametrize("sampling", ["false", "true"])
def test_errors_hold_a_lamp_that_no_path_meets(tmp_path, sampling):
    """8 x 8 pixels of a floor below a lamp of 1 cm, which fills 1.3e-4 of its hemisphere."""
    file, height = SceneFile(Place()), 0.5
    file.rectangle(np.zeros(3), X, Y, diffuse(REFLECTANCE, "floor") + thermal("floor", 250.0))
    lamp = turned_to_front((height * UP, 5e-3 * X, 5e-3 * Y), -UP)
    file.rectangle(*lamp, BLACK + thermal("lamp", HOT))
    file.camera(0.2 * UP, -UP, Y, HALF_WINDOW, 4.0)
    scene = mi_lcair.load(file.write(tmp_path, "MWIR", 1, sampling))
    names = ["lamp.temperature", "floor.reflectance"]
    result = mi_lcair.derivative_images(scene, names, spp=16, seed=1)
    share = to_polygon(np.zeros((1, 3)), UP, corners(lamp))[0]
    radiance = {T: planck.in_band_radiance("MWIR", T) for T in (HOT - 1, HOT, HOT + 1, 250.0)}
    slope = (radiance[HOT + 1] - radiance[HOT - 1]) / 2
    truths = [REFLECTANCE * share * slope, share * radiance[HOT] - radiance[250.0]]
    for truth, value, error in zip(truths, result.derivative, result.derivative_error):
        assert np.mean(abs(value - truth) < 2 * error + 1e-3 * abs(truth)) > 0.9
    if sampling == "true":
        assert np.median(result.derivative_error[0]) < 0.1 * truths[0]

"""Variances of pixels from noisy derivatives."""

import numpy as np
import pytest

from mi_lcair.rendering.sampling import Sampling
from mi_lcair.uncertainty.image import budget_image, variance
from mi_lcair.uncertainty.inputs import Inputs
from mi_lcair.uncertainty.uncertainties import Uncertainties
from tests.uncertainty.plate_scene import EMISSIVITY, TEMPERATURE, plate_scene, slope


class Images:
    """Derivatives (R, K, H, W) of an image, and their mean."""

    def __init__(self, derivatives):
        self.derivatives, self.derivative = derivatives, derivatives.mean(axis=0)


COVARIANCE = np.array([[4.0, -0.6], [-0.6, 0.25]])


def test_products_of_different_randomisations():
    d = np.random.default_rng(0).normal(3, 1, (3, 2, 4, 5))
    expected = np.mean(
        [
            np.einsum("khw,kl,lhw->hw", d[r], COVARIANCE, d[s])
            for r in range(3)
            for s in range(3)
            if r != s
        ],
        axis=0,
    )
    assert expected.min() > 0
    np.testing.assert_allclose(variance(Images(d), COVARIANCE), expected)


def test_one_randomisation_and_noise_alone():
    d = np.random.default_rng(0).normal(3, 1, (1, 2, 4, 5))
    np.testing.assert_allclose(
        variance(Images(d), COVARIANCE), np.einsum("khw,kl,lhw->hw", d[0], COVARIANCE, d[0])
    )
    noise = np.random.default_rng(1).normal(0, 1, (2, 2, 40, 50))
    found = variance(Images(noise), COVARIANCE)
    assert found.min() == 0 and np.mean(found == 0) == pytest.approx(0.5, abs=0.05)


@pytest.mark.slow
def test_maps_of_a_plate(tmp_path):
    """The plate is 2 m wide in a window of 4 m: eps B'(T) on the plate, 0 beside it."""
    scene = plate_scene(tmp_path)
    stated = Uncertainties.read({"sigma": {"plate.temperature": 2.0}})
    from mi_lcair.api.parameters import parameters

    channels, header = budget_image(
        scene, Inputs.of(stated, parameters(scene), "plate"), Sampling(spp=16)
    )
    expected = EMISSIVITY * slope(scene.band, TEMPERATURE)
    column = channels["d.plate.temperature.Y"]
    np.testing.assert_allclose(column[5:11, 5:11], expected, rtol=1e-3)
    np.testing.assert_allclose(channels["sigma.Y"][5:11, 5:11], 2 * expected, rtol=1e-3)
    assert not column[:3].any() and header["covariance"] == "[[4.0]]"

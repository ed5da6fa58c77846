"""The camera's MTF: its parts, energy, and the slanted edge."""

from functools import partial

import numpy as np
import pytest
from scipy.integrate import quad

from mi_lcair.camera.electronics.response import electron_band
from mi_lcair.camera.measures import measured_mtf
from mi_lcair.camera.optics import MARGIN, OVERSAMPLING, Optics, defocus, diffraction, jitter
from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import spectral_radiance
from mi_lcair.physics.imager import Imager

PARTS = [
    {},
    {"jitter_urad": 50.0},
    {"defocus_um": 60.0},
    {"f_number": 2.0, "fill_factor": 0.7},
]


def optics(**changes) -> Optics:
    camera = {
        "focal_length_mm": 100.0,
        "f_number": 4.0,
        "pitch_um": 15.0,
        "width": 64,
        "height": 64,
        "integration_time_ms": 10.0,
        "well_Me": 5.0,
    }
    imager = Imager(**(camera | changes))
    thermal = partial(spectral_radiance, temperature=300.0)
    return Optics(imager, electron_band(band("MWIR"), imager), thermal)


def test_diffraction_is_the_autocorrelation_of_the_aperture():
    """Two circles of diameter 1, shifted by u: area of their lens over that of the circle."""
    for u in (0.0, 0.1, 0.5, 0.9, 1.0, 1.7):
        half = lambda x: 2 * np.sqrt(max(0.25 - x * x, 0))
        lens = 2 * quad(half, min(u / 2, 0.5), 0.5)[0]
        value = diffraction(np.array([u * 1e3 / (4.0 * 4.2)]), 4.0, np.array([4.2]), np.ones(1))
        assert value[0] == pytest.approx(lens / (np.pi / 4), abs=1e-7)


def test_jitter_and_defocus_are_transforms_of_their_spreads():
    frequency, sigma, diameter = 21.0, 6.0, 14.0
    turn = 2 * np.pi * frequency * 1e-3
    gauss = lambda x: np.exp(-(x**2) / 2 / sigma**2) / sigma / np.sqrt(2 * np.pi) * np.cos(turn * x)
    assert jitter(frequency, sigma) == pytest.approx(quad(gauss, -60, 60)[0], rel=1e-8)
    disc = lambda x: 8 / np.pi / diameter**2 * np.sqrt(diameter**2 / 4 - x * x) * np.cos(turn * x)
    assert defocus(frequency, diameter) == pytest.approx(
        quad(disc, -diameter / 2, diameter / 2)[0], rel=1e-6
    )
    assert defocus(0.0, diameter) == 1


@pytest.mark.parametrize("changes", PARTS)
def test_slanted_edge_measures_the_product_of_the_parts(changes):
    camera = optics(**changes)
    frequency, value = measured_mtf(camera)
    assert frequency[-1] == pytest.approx(camera.nyquist)
    assert value == pytest.approx(camera.mtf(frequency), abs=0.02)
    assert camera.mtf(frequency) == pytest.approx(
        np.prod(list(camera.parts(frequency).values()), axis=0)
    )


def test_energy_is_conserved():
    samples = np.zeros((90, 60))
    samples[40:47, 20:33] = np.random.default_rng(1).random((7, 13))
    for changes in PARTS[:3]:
        image = optics(**changes).seen(samples)
        assert image.shape == (30 + 2 * MARGIN, 20 + 2 * MARGIN)
        assert image.sum() * OVERSAMPLING**2 == pytest.approx(samples.sum(), rel=1e-3)


def test_uniform_scene_stays_uniform():
    samples = np.ones((240, 240))
    image = optics(jitter_urad=50.0).seen(samples)
    middle = image[MARGIN + 35 : -MARGIN - 35, MARGIN + 35 : -MARGIN - 35]
    # Diffraction brings 2 wavelength N / (pi^2 r) = 0.6 % from outside a radius of 38 pixels
    assert middle == pytest.approx(1, abs=6e-3)


def test_variance_of_independent_samples():
    camera, random = optics(), np.random.default_rng(2)
    variances = np.zeros((24, 24))
    variances[9:15, 6:18] = 4.0
    images = [
        camera.seen(np.sqrt(variances) * random.standard_normal(variances.shape))
        for _ in range(150)
    ]
    predicted = camera.variance(variances)
    assert np.var(images, axis=0).sum() == pytest.approx(predicted.sum(), rel=0.08)


def test_noise_equivalent_pixels():
    """The mean over the places of a point in a pixel of 1 / (sum of squares) is its own inverse."""
    camera, squares = optics(), []
    for dy in range(OVERSAMPLING):
        for dx in range(OVERSAMPLING):
            samples = np.zeros((OVERSAMPLING * 9, OVERSAMPLING * 9))
            samples[12 + dy, 12 + dx] = OVERSAMPLING**2  # one pixel's worth of light
            squares.append(np.sum(camera.seen(samples) ** 2))
    # A sample is a square and not a point, and spreads a little more
    assert 1 / np.mean(squares) == pytest.approx(camera.noise_equivalent_pixels, rel=0.06)
